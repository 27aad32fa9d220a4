"""The camera of the published trials: what it sees of a run, and how Tracker differences that.

A frame shows where a body was on average while the shutter was open: Tracker's user, or its
template matching, marks the middle of what is blurred. The exposure lies about the frame's time.

Tracker (physlets.org/tracker) takes velocities over three frames and accelerations over five:
v_i = (z_i+1 − z_i−1)/(2 Δt) and a_i = (2 z_i+2 − z_i+1 − 2 z_i − z_i−1 + 2 z_i−2)/(7 Δt²), the
parabola through five points by least squares. The columns of the trials hold these.
"""

from collections.abc import Mapping

import numpy as np

from cosim.arrays import Array
from cosim.scene.tables import FRAME_RATE

INSTANTS = 16
"""Of an exposure, whose mean a frame shows. A velocity that jumps by 0.3 m/s within the longest
exposure makes this mean wrong by 0.2 µm at most."""

SHORTEST = 1e-6  # s; a shorter exposure is an instant


def frame_count(waveforms: Mapping[str, Array], start: float) -> int:
    """How many frames the camera takes from ``start`` (s) to the run's end."""
    return max(0, int((waveforms["time"][-1] - start) * FRAME_RATE + 1e-6) + 1)


def frame_times(start: float, count: int) -> Array:
    """Times (s) of ``count`` frames of the published trials' camera, the first at ``start``."""
    return start + np.arange(count) / FRAME_RATE


def instants_a_frame(exposure: float) -> int:
    """How many instants stand for an exposure (s)."""
    return INSTANTS if exposure >= SHORTEST else 1


def instants(frames: Array, exposure: float) -> Array:
    """Times (s) within the exposure (s) of each frame, evenly spread, frame after frame."""
    n = instants_a_frame(exposure)
    return np.add.outer(frames, exposure * ((np.arange(n) + 0.5) / n - 0.5)).ravel()


def shown(heights: Array, exposure: float) -> Array:
    """What frames show of heights (or rows of them) at their instants: means of exposures (s)."""
    n = instants_a_frame(exposure)
    return heights.reshape(-1, n, *heights.shape[1:]).mean(axis=1) if n > 1 else heights


def heights(waveforms: Mapping[str, Array], body: str, frames: Array, exposure: float) -> Array:
    """Heights (m) of a body of a run (its waveforms, SI, by name) as frames at these times (s) with
    this exposure (s) show them. Where an exposure reaches beyond the run, it stands still there."""
    time = waveforms["time"]
    at = np.clip(instants(frames, exposure), time[0], time[-1])
    return shown(hermite(at, time, waveforms[f"z_{body}"], waveforms[f"v_{body}"]), exposure)


def velocities(time: Array, z: Array) -> Array:
    """Central differences of heights frame by frame; NaN in the first and the last frame."""
    v = np.full(len(z), np.nan)
    v[1:-1] = (z[2:] - z[:-2]) / (time[2:] - time[:-2])
    return v


def accelerations(z: Array) -> Array:
    """Five-point differences of heights (or rows of them) at FRAME_RATE, m/s² for m; NaN in the
    first two and the last two frames."""
    a = np.full(z.shape, np.nan)
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
