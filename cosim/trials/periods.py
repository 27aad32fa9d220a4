"""The period of a measured signal, and what follows from it: drift, and a forecast."""

import numpy as np
from scipy.signal import correlate

from cosim.arrays import Array

LONGEST = 2 / 3
"""Of the recording, up to which a period is looked for: a third of it must repeat."""

ALIKE = 0.5
"""Correlation of a signal with itself a period later, below which it has no period."""

NEARLY = 0.9
"""Of the best correlation: the first lag that reaches this is the period, later ones its
multiples."""

FINEST = 1 << 18
"""Points of the even grid on which the signal is correlated, at most."""


def period_of(time: Array, values: Array) -> float | None:
    """The period (s) of a signal, by its correlation with itself; None where it does not repeat.

    NaN are left out; times (s) need not be even.
    """
    known = np.isfinite(values)
    time, values = time[known], values[known]
    # As fine as the median step: the values of an even recording stay what they are.
    count = min(round((time[-1] - time[0]) / float(np.median(np.diff(time)))) + 1, FINEST)
    grid, step = np.linspace(time[0], time[-1], count, retstep=True)
    alike = _alike(np.interp(grid, time, values))
    fallen = np.flatnonzero(alike < ALIKE)  # from 1 at no lag
    if not len(fallen):
        return None
    inner = alike[1:-1]
    peaks = 1 + np.flatnonzero((inner > alike[:-2]) & (inner >= alike[2:]))
    peaks = peaks[(peaks > fallen[0]) & (alike[peaks] >= ALIKE)]
    if not len(peaks):
        return None
    first = int(peaks[alike[peaks] >= NEARLY * alike[peaks].max()][0])
    # Where it repeats as well many periods later, that tells the period more finely.
    period, times = _top(alike, first), 2
    well = peaks[alike[peaks] >= NEARLY * alike[first]]
    while len(near := well[np.abs(well - times * period) < 0.1 * period]):
        period = _top(alike, int(near[np.argmax(alike[near])])) / times
        times += 1
    return period * float(step)


def _alike(values: Array) -> Array:
    """Correlation of a signal with itself at each lag, 1 where they are equal."""
    values = values - values.mean()
    count = len(values)
    lags = np.arange(max(3, int(count * LONGEST)))
    products = correlate(values, values, method="fft")[count - 1 :][lags]
    power = np.concatenate([[0.0], np.cumsum(values**2)])
    both = power[count - lags] + power[count] - power[lags]
    return np.divide(2.0 * products, both, out=np.zeros(len(lags)), where=both > 0.0)


def _top(values: Array, k: int) -> float:
    """Where the parabola through a peak and its neighbours is highest."""
    left, peak, right = values[k - 1 : k + 2]
    return k + 0.5 * float((left - right) / (left - 2.0 * peak + right))


def whole_periods(time: Array, period: float) -> int:
    """How many whole periods (s) a recording has."""
    return int(float(time[-1] - time[0]) / period + 1e-6)


def drift(time: Array, heights: Array, period: float | None) -> float:
    """Mean velocity over whole periods (s): the mean over all spans of that length in the
    recording; over the whole recording where it has no whole period.
    """
    periods = whole_periods(time, period) if period else 0
    if not (period and periods):
        return float((heights[-1] - heights[0]) / (time[-1] - time[0]))
    span = periods * period
    starts = time[time <= time[-1] - span * (1 - 1e-9)]
    gained = np.interp(starts + span, time, heights) - heights[: len(starts)]
    return float(gained.mean() / span)


def one_period_later(time: Array, values: Array, period: float, gained: float = 0.0) -> Array:
    """A signal's forecast of itself: what it was a period (s) ago, and what it gains in one; NaN
    in the first period.
    """
    known = np.isfinite(values)
    ago = np.interp(time - period, time[known], values[known], left=np.nan)
    return ago + gained
