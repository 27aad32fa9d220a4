"""The camera of the tracked trials: heights at its frame rate, differenced as the tracker does."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.scene import Scene
from cosim.trials.published import FRAME_RATE

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Frames:
    """What a camera sees: heights (m) and velocities (m/s, by central differences) at frames."""

    time: Array
    z_surface: Array
    v_surface: Array
    z_part: Array
    v_part: Array


def laid_over(scene: Scene) -> tuple[float, float]:
    """The first time of a run that may be laid over a trial's first frame, s, and its period, s."""
    if scene.drive.file is not None:
        return 0.0, 0.0  # the trial's own surface: there is nothing to shift
    return scene.run.settle, 1.0 / scene.drive.frequency


def through_camera(waveforms: dict[str, Array], start: float, frames: int) -> Frames:
    """The run as a camera reads it from ``start`` (s) on."""
    time = start + np.arange(frames) / FRAME_RATE
    heights = {
        body: hermite(time, waveforms["time"], waveforms[f"z_{body}"], waveforms[f"v_{body}"])
        for body in ("surface", "part")
    }
    speeds = {body: differences(z) for body, z in heights.items()}
    return Frames(
        time - start, heights["surface"], speeds["surface"], heights["part"], speeds["part"]
    )


def visible_frames(waveforms: dict[str, Array], start: float) -> int:
    """How many frames the camera takes from ``start`` (s) to the run's end."""
    return max(0, int((waveforms["time"][-1] - start) * FRAME_RATE + 1e-6) + 1)


def differences(z: Array) -> Array:
    """Velocity, m/s, by the tracker's central differences; NaN in the first and last frame."""
    v = np.full(len(z), np.nan)
    v[1:-1] = (z[2:] - z[:-2]) * FRAME_RATE / 2.0
    return v


def second_differences(z: Array) -> Array:
    """Acceleration by the tracker's differences, over five frames; NaN in the two at either end."""
    a = np.full(len(z), np.nan)
    a[2:-2] = (2 * z[4:] - z[3:-1] - 2 * z[2:-2] - z[1:-3] + 2 * z[:-4]) * FRAME_RATE**2 / 7.0
    return a


def hermite(at: Array, time: Array, z: Array, v: Array) -> Array:
    """Cubic interpolation of heights with known velocities."""
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[k + 1] - time[k]
    s = (at - time[k]) / h
    left = (1 + 2 * s) * (1 - s) ** 2 * z[k] + s * (1 - s) ** 2 * h * v[k]
    right = s**2 * (3 - 2 * s) * z[k + 1] + s**2 * (s - 1) * h * v[k + 1]
    return left + right
