"""The camera of the published trials: its view of a run, and the differences that Tracker takes.

A frame shows a body's mean position while the shutter was open: Tracker's user, or its template
matching, marks the middle of the blurred image. The exposure is centred on the frame's time.

Tracker (physlets.org/tracker) takes velocities over three frames and accelerations over five:
v_i = (z_i+1 − z_i−1)/(2 Δt) and a_i = (2 z_i+2 − z_i+1 − 2 z_i − z_i−1 + 2 z_i−2)/(7 Δt²), the
parabola through five points by least squares. The columns of the trials hold these.
"""

from collections.abc import Mapping

import numpy as np

from cosim.arrays import Array
from cosim.scene.tables import FRAME_RATE

INSTANTS = 16
"""Instants of an exposure, the mean of whose heights is a frame's. With a jump of the velocity by
0.3 m/s within the longest exposure this mean is wrong by 0.2 µm at most."""

SHORTEST = 1e-6  # s; a shorter exposure is an instant


def frame_count(waveforms: Mapping[str, Array], start: float) -> int:
    """How many frames the camera takes from ``start`` (s) to the run's end."""
    return max(0, int((waveforms["time"][-1] - start) * FRAME_RATE + 1e-6) + 1)


def frame_times(start: float, count: int) -> Array:
    """Times (s) of ``count`` frames of the published trials' camera, the first at ``start``."""
    return start + np.arange(count) / FRAME_RATE


def instants_a_frame(exposure: float) -> int:
    """Number of instants by which an exposure (s) is represented."""
    return INSTANTS if exposure >= SHORTEST else 1


def instants(frames: Array, exposure: float) -> Array:
    """Times (s) evenly spread over the exposure (s) of each frame, flat (frames × instants)."""
    n = instants_a_frame(exposure)
    return np.add.outer(frames, exposure * ((np.arange(n) + 0.5) / n - 0.5)).ravel()


def shown(heights: Array, exposure: float) -> Array:
    """Heights in frames: means over each exposure (s) of heights at its instants (first axis)."""
    n = instants_a_frame(exposure)
    return heights.reshape(-1, n, *heights.shape[1:]).mean(axis=1) if n > 1 else heights


def heights(waveforms: Mapping[str, Array], body: str, frames: Array, exposure: float) -> Array:
    """Heights (m) of a body of a run (its waveforms, SI, by name) in ``frames`` (times, s) with an
    exposure (s). Before and after the run the body is taken to be at rest."""
    time = waveforms["time"]
    at = np.clip(instants(frames, exposure), time[0], time[-1])
    return shown(hermite(at, time, waveforms[f"z_{body}"], waveforms[f"v_{body}"]), exposure)


def velocities(time: Array, z: Array) -> Array:
    """Central differences of heights frame by frame; NaN in the first and the last frame."""
    v = np.full(len(z), np.nan)
    v[1:-1] = (z[2:] - z[:-2]) / (time[2:] - time[:-2])
    return v


def accelerations(z: Array) -> Array:
    """Five-point differences, m/s², of heights (m) whose rows are frames at FRAME_RATE; NaN in the
    first two and the last two frames."""
    a = np.full(z.shape, np.nan)
    a[2:-2] = (2 * z[4:] - z[3:-1] - 2 * z[2:-2] - z[1:-3] + 2 * z[:-4]) * FRAME_RATE**2 / 7.0
    return a


def hermite(at: Array, time: Array, z: Array, v: Array) -> Array:
    """Cubic Hermite interpolation at the times ``at`` of heights ``z`` with velocities ``v``."""
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[k + 1] - time[k]
    s = (at - time[k]) / h
    left = (1 + 2 * s) * (1 - s) ** 2 * z[k] + s * (1 - s) ** 2 * h * v[k]
    right = s**2 * (3 - 2 * s) * z[k + 1] + s**2 * (s - 1) * h * v[k + 1]
    return left + right
