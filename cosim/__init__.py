"""Co-simulation bench: SPICE circuits, voice-coil actuators and stick-slip mechanics."""

__version__ = "0.1.0"
