"""The motion of the surface between the frames of a camera."""
