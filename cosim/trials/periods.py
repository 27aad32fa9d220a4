"""The period of a measured signal, and what follows from it: drift, and a forecast."""

import numpy as np
from scipy.signal import correlate

from cosim.arrays import Array

LONGEST = 2 / 3
"""Of the recording, up to which a period is looked for: a third of it must repeat."""

ALIKE = 0.5
"""Correlation of a signal with itself a period later, below which it has no period."""

NEARLY = 0.9
"""Of the best correlation: the first lag that reaches this is the period, later ones multiples."""

FINEST = 1 << 18
"""Points of the even grid on which the signal is correlated, at most."""


FEW = 64
"""Rows of a period, below which the correlation's peaks lie between rows: that of a multiple, which
lies on one, may be higher. Then the period is that of the series that explains most."""

HARMONICS = 12
"""Of that series, fewer where there are less than ROWS_A_HARMONIC rows for each. As many for every
period: so that of a multiple reaches less high, and explains less of what is no sine."""

ROWS_A_HARMONIC = 6

FUNDAMENTAL = 0.1
"""How much the first harmonic's share counts besides the whole: it tells a sine from its
multiples, and from its mirror images about the rate of the rows."""

MULTIPLES = 12
"""Of the period that the correlation may have found."""

HINT = 0.25
"""Of the hint, within which the period is looked for where rows are few or do not correlate."""


def period_of(time: Array, values: Array, hint: float | None = None) -> float | None:
    """The period (s) of a signal, by its correlation with itself; None where it does not repeat.

    NaN are left out; times (s) need not be even. ``hint`` is what it may be near, s. With few rows
    in a period the correlation is only the first guess, and a Fourier series decides.
    """
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < 3:
        return None
    period = _repeats(time, values)
    row = float(np.median(np.diff(time)))
    guesses = [period / k for k in range(1, MULTIPLES + 1)] if period else []
    span = float(time[-1] - time[0])
    if hint and hint < min(FEW * row / (4 if period else 1), span / 2):
        guesses += [*np.linspace((1 - HINT) * hint, (1 + HINT) * hint, 200)]
    guesses = [guess for guess in guesses if 2.2 * row < guess < FEW * row]
    if not guesses:
        return period
    if period and period not in guesses:
        guesses.append(period)
    time, values = time[:1024] - time[0], values[:1024]
    best = max(guesses, key=lambda guess: _series(time, values, guess))
    if period and best == period and period > FEW * row / 4:
        return period
    near = best + np.linspace(-0.5, 0.5, 401) * best**2 / span
    best = max(near, key=lambda guess: _series(time, values, guess))
    return float(best) if _series(time, values, best) > ALIKE else None


def _series(time: Array, values: Array, period: float) -> float:
    """The share of the variance that a Fourier series of this period (s) explains, for the number
    of its terms, and FUNDAMENTAL times that of its first harmonic."""
    rows = (len(time) - 1) * period / (time[-1] - time[0])
    harmonics = max(1, min(HARMONICS, len(time) // ROWS_A_HARMONIC, max(3, int(rows) - 1)))
    angles = np.outer(time, 2 * np.pi / period * np.arange(1, harmonics + 1))
    # Columns: cosine and sine of the first harmonic, then those of the next ones.
    terms = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(time), -1)
    terms, values = terms - terms.mean(axis=0), values - values.mean()
    whole, count = max(float(values @ values), 1e-300), len(values) - 1
    left = values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]
    # As many terms as samples would explain all of any signal.
    free = count / max(count - 2 * harmonics, 1)
    first = np.sum((values @ terms[:, :2]) ** 2 / np.sum(terms[:, :2] ** 2, axis=0))
    return 1.0 - free * float(left @ left) / whole + FUNDAMENTAL * float(first) / whole


def _repeats(time: Array, values: Array) -> float | None:
    """The period (s) at which a signal without gaps correlates with itself."""
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
    recording; over the whole recording where it has no whole period. NaN are left out."""
    known = np.isfinite(heights)
    time, heights = time[known], heights[known]
    periods = whole_periods(time, period) if period else 0
    if not (period and periods):
        return float((heights[-1] - heights[0]) / (time[-1] - time[0]))
    span = periods * period
    starts = time[time <= time[-1] - span * (1 - 1e-9)]
    gained = np.interp(starts + span, time, heights) - heights[: len(starts)]
    return float(gained.mean() / span)


def one_period_later(time: Array, values: Array, period: float, gained: float = 0.0) -> Array:
    """A signal's forecast of itself: what it was a period (s) ago, and what it gains in one; NaN
    in the first period."""
    known = np.isfinite(values)
    ago = np.interp(time - period, time[known], values[known], left=np.nan)
    return ago + gained
