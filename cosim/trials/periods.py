"""The period of a measured signal, its drift over whole periods, and its periodic forecast."""

import numpy as np

from cosim.arrays import Array

LONGEST = 2 / 3
"""Longest period that is sought, as a share of the recording: a third of it must repeat."""

ALIKE = 0.5
"""Least autocorrelation at a lag of one period; a signal with less has no period."""

NEARLY = 0.9
"""The period is the first peak of at least this share of the highest; later ones are multiples."""

FINEST = 1 << 18
"""Most points of the even grid on which the signal is correlated."""

FEW = 64
"""With fewer rows in a period, a peak of the correlation lies between rows, and the peak of a
multiple that lies on a row may be higher. Then the best Fourier series gives the period."""

HARMONICS = 12
"""Harmonics of the Fourier series; fewer where there are less than ROWS_A_HARMONIC rows for each.
Their number is the same for every period, so that the series of a multiple ends at a lower
frequency and explains less of a signal that is no sine."""

ROWS_A_HARMONIC = 6

FUNDAMENTAL = 0.1
"""Weight of the first harmonic's share of the variance, in addition to the whole: it distinguishes
the period of a sine from its multiples and from its aliases at the rate of the rows."""

MULTIPLES = 12
"""The correlation's peak may be that of a multiple of the period, up to this one."""

HINT = 0.25
"""Range, ± of the hint, of further guesses where a period has few rows or none was found."""


def period_of(time: Array, values: Array, hint: float | None = None) -> float | None:
    """The period (s) of a signal, by its correlation with itself; None where it does not repeat.

    NaN are left out; times (s) need not be even. ``hint`` is a likely period, s. With few rows in a
    period the correlation is only the first guess, and a Fourier series decides.
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
    time, values = time[:1024] - time[0], values[:1024]  # for the speed of the least squares
    best = max(guesses, key=lambda guess: _series(time, values, guess))
    if period and best == period and period > FEW * row / 4:
        return period
    # Refined within what shifts the end of the recording by half a period, best²/(2 span).
    near = best + np.linspace(-0.5, 0.5, 401) * best**2 / span
    best = max(near, key=lambda guess: _series(time, values, guess))
    return float(best) if _series(time, values, best) > ALIKE else None


def _series(time: Array, values: Array, period: float) -> float:
    """The share of the variance that a Fourier series of this period (s) explains, adjusted for the
    number of its terms, plus FUNDAMENTAL times the share of its first harmonic."""
    rows = (len(time) - 1) * period / (time[-1] - time[0])
    harmonics = max(1, min(HARMONICS, len(time) // ROWS_A_HARMONIC, max(3, int(rows) - 1)))
    angles = np.outer(time, 2 * np.pi / period * np.arange(1, harmonics + 1))
    # Columns: cosine and sine of the first harmonic, then those of the next ones.
    terms = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(time), -1)
    terms, values = terms - terms.mean(axis=0), values - values.mean()
    whole, count = max(float(values @ values), 1e-300), len(values) - 1
    left = values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]
    # The adjusted R²: as many terms as samples would explain any signal.
    free = count / max(count - 2 * harmonics, 1)
    first = np.sum((values @ terms[:, :2]) ** 2 / np.sum(terms[:, :2] ** 2, axis=0))
    return 1.0 - free * float(left @ left) / whole + FUNDAMENTAL * float(first) / whole


def _repeats(time: Array, values: Array) -> float | None:
    """The period (s) of a signal without NaN by its autocorrelation; None without a clear peak."""
    # An even grid with the median step; an even recording keeps its values.
    count = min(round((time[-1] - time[0]) / float(np.median(np.diff(time)))) + 1, FINEST)
    grid, step = np.linspace(time[0], time[-1], count, retstep=True)
    alike = _alike(np.interp(grid, time, values))
    fallen = np.flatnonzero(alike < ALIKE)  # lags beyond the peak at lag 0
    if not len(fallen):
        return None
    inner = alike[1:-1]
    peaks = 1 + np.flatnonzero((inner > alike[:-2]) & (inner >= alike[2:]))
    peaks = peaks[(peaks > fallen[0]) & (alike[peaks] >= ALIKE)]
    if not len(peaks):
        return None
    first = int(peaks[alike[peaks] >= NEARLY * alike[peaks].max()][0])
    # A peak at a multiple gives the period more finely: one multiple after another, while there are
    # peaks as high nearby.
    period, times = _top(alike, first), 2
    high = peaks[alike[peaks] >= NEARLY * alike[first]]
    while len(near := high[np.abs(high - times * period) < 0.1 * period]):
        period = _top(alike, int(near[np.argmax(alike[near])])) / times
        times += 1
    return period * float(step)


def _alike(values: Array) -> Array:
    """Autocorrelation at each lag: 2 Σ ab/Σ(a² + b²) of the two overlapping parts, 1 if equal."""
    values = values - values.mean()
    count = len(values)
    lags = np.arange(max(3, int(count * LONGEST)))
    # By the power spectrum, of so many points that no lag meets another. SciPy's own correlation
    # takes a second to import.
    spectrum = np.fft.rfft(values, 1 << (2 * count - 1).bit_length())
    products = np.fft.irfft(np.abs(spectrum) ** 2)[lags]
    power = np.concatenate([[0.0], np.cumsum(values**2)])
    # Σ a² + Σ b² of the first and of the last count − lag values.
    both = power[count - lags] + power[count] - power[lags]
    return np.divide(2.0 * products, both, out=np.zeros(len(lags)), where=both > 0.0)


def _top(values: Array, k: int) -> float:
    """Position of the maximum of the parabola through the peak ``k`` and its neighbours."""
    left, peak, right = values[k - 1 : k + 2]
    return k + 0.5 * float((left - right) / (left - 2.0 * peak + right))


def whole_periods(time: Array, period: float) -> int:
    """How many whole periods (s) a recording has."""
    return int(float(time[-1] - time[0]) / period + 1e-6)


def drift(time: Array, heights: Array, period: float | None) -> float:
    """Mean velocity over the largest number of whole periods (s): the mean over all such spans in
    the recording; from end to end where it has no whole period. NaN are left out."""
    known = np.isfinite(heights)
    time, heights = time[known], heights[known]
    periods = whole_periods(time, period) if period else 0
    if not (period and periods):
        return float((heights[-1] - heights[0]) / (time[-1] - time[0]))
    span = periods * period
    # The first row begins one in any case: ``whole_periods`` rounds up by a millionth.
    starts = time[time <= max(time[0], time[-1] - span * (1 - 1e-9))]
    gained = np.interp(starts + span, time, heights) - heights[: len(starts)]
    return float(gained.mean() / span)


def one_period_later(time: Array, values: Array, period: float, gained: float = 0.0) -> Array:
    """A signal's forecast of itself: its value a period (s) before, plus what it ``gained`` in one;
    NaN in the first period."""
    known = np.isfinite(values)
    ago = np.interp(time - period, time[known], values[known], left=np.nan)
    return ago + gained
