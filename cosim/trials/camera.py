"""The camera of the published trials: what it sees of a run, and how Tracker differences that.

Tracker (physlets.org/tracker) takes velocities over three frames and accelerations over five, by
least squares; the columns of the trials hold these.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array

FRAME_RATE = 960.0  # 1/s


@dataclass(frozen=True)
class Frames:
    """Heights, m, and velocities by :func:`velocities`, m/s, at times in s; time 0 is the first."""

    time: Array
    z_surface: Array
    v_surface: Array
    z_part: Array
    v_part: Array


def frame_count(waveforms: Mapping[str, Array], start: float) -> int:
    """How many frames the camera takes from ``start`` (s) to the run's end."""
    return max(0, int((waveforms["time"][-1] - start) * FRAME_RATE + 1e-6) + 1)


def film(waveforms: Mapping[str, Array], start: float, count: int) -> Frames:
    """``count`` frames of a run (its waveforms, SI, by name) from ``start`` (s) on."""
    time = start + np.arange(count) / FRAME_RATE
    z_surface, z_part = (
        hermite(time, waveforms["time"], waveforms[f"z_{body}"], waveforms[f"v_{body}"])
        for body in ("surface", "part")
    )
    return Frames(time - start, z_surface, velocities(z_surface), z_part, velocities(z_part))


def velocities(z: Array) -> Array:
    """Central differences of heights frame by frame; NaN in the first and the last frame."""
    v = np.full(len(z), np.nan)
    v[1:-1] = (z[2:] - z[:-2]) * FRAME_RATE / 2.0
    return v


def accelerations(z: Array) -> Array:
    """Tracker's five-point differences of heights; NaN in the first two and the last two frames."""
    a = np.full(len(z), np.nan)
    a[2:-2] = (2 * z[4:] - z[3:-1] - 2 * z[2:-2] - z[1:-3] + 2 * z[:-4]) * FRAME_RATE**2 / 7.0
    return a


def three_point_accelerations(z: Array) -> Array:
    """Second differences of heights, without the first and the last frame."""
    return np.diff(z, 2) * FRAME_RATE**2


def hermite(at: Array, time: Array, z: Array, v: Array) -> Array:
    """Cubic interpolation of heights with known velocities."""
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[k + 1] - time[k]
    s = (at - time[k]) / h
    left = (1 + 2 * s) * (1 - s) ** 2 * z[k] + s * (1 - s) ** 2 * h * v[k]
    right = s**2 * (3 - 2 * s) * z[k + 1] + s**2 * (s - 1) * h * v[k + 1]
    return left + right
