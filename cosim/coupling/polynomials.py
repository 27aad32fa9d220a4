"""What one side of a coupling is told of the other: polynomials in time over a macro step.

A polynomial is an array of coefficients about the start of the step: ``c[k]``, of the signal's own
shape, belongs to (t - t_n)^k.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def value(coefficients: Array, s: float) -> Array:
    """The polynomial at ``s`` seconds after its origin."""
    total = coefficients[-1]
    for k in range(len(coefficients) - 2, -1, -1):
        total = total * s + coefficients[k]
    return total


def slope(coefficients: Array, s: float) -> Array:
    """Its time derivative there, per second."""
    if len(coefficients) == 1:
        return np.zeros_like(coefficients[0])
    return value(np.array([k * c for k, c in enumerate(coefficients)][1:]), s)


def shifted(coefficients: Array, s: float) -> Array:
    """The same polynomial about an origin ``s`` seconds later."""
    c = np.array(coefficients)
    for first in range(len(c) - 1):
        for k in range(len(c) - 2, first - 1, -1):
            c[k] = c[k] + s * c[k + 1]
    return c


def projected(coefficients: Array, h: float, degree: int) -> Array:
    """The polynomial of at most ``degree`` 0 or 1 that is nearest in the mean square over [0, h].

    Its integral, and for degree 1 its first moment, are those of the original: what a force or a
    voltage does to an integrator is kept. So a participant that takes linear inputs only loses
    nothing up to the order of H^4.
    """
    c = coefficients
    if len(c) <= degree + 1:
        return c
    mean = sum(c[k] * (h**k / (k + 1)) for k in range(len(c)))
    if degree == 0:
        return np.array([mean])
    moment = sum(c[k] * (h**k / (k + 2)) for k in range(len(c)))
    rise = (12.0 * moment - 6.0 * mean) / h
    return np.array([mean - 0.5 * h * rise, rise])


def interpolated(
    offsets: Sequence[float], values: Sequence[Any], slope_at_last: Any | None = None
) -> Array:
    """The polynomial through ``values`` at times ``offsets`` (s, against the origin).

    With ``slope_at_last`` it also has that slope at the last of them.
    """
    n = len(offsets) + (slope_at_last is not None)
    right = [*values] if slope_at_last is None else [*values, slope_at_last]
    if n == 1:
        return np.array(right)
    # In units of the widest distance, so that the equations are well scaled.
    unit = max(abs(s) for s in offsets) or 1.0
    rows = [[(s / unit) ** k for k in range(n)] for s in offsets]
    if slope_at_last is not None:
        last = offsets[-1] / unit
        rows.append([k * last ** (k - 1) / unit if k else 0.0 for k in range(n)])
    stacked = np.array(right)
    found = np.linalg.solve(np.array(rows), stacked.reshape(n, -1)).reshape(stacked.shape)
    return np.array([c / unit**k for k, c in enumerate(found)])


class History:
    """The last values and slopes of a signal at communication points, newest last."""

    def __init__(self, order: int, slopes: bool) -> None:
        """Polynomials up to ``order``; with ``slopes`` the newest slope counts as a known value.

        Without it older values are used instead, and the slope only fills in while there are not
        yet enough of them, so that a method begins with its own order.
        """
        self.order = order
        self._slopes = slopes
        self._times: tuple[float, ...] = ()
        self._values: tuple[Array, ...] = ()
        self._slope: Array = np.zeros(0)

    def add(self, time: float, value: Array, slope: Array) -> None:
        """A new communication point at ``time`` (s)."""
        keep = max(self.order, 1)
        self._times = (*self._times[-keep:], time)
        self._values = (*self._values[-keep:], value)
        self._slope = slope

    def restart(self) -> None:
        """Forget all but the newest point: what is older lies before an event."""
        self._times, self._values = self._times[-1:], self._values[-1:]

    @property
    def value(self) -> Array:
        """The newest value."""
        return self._values[-1]

    @property
    def slope(self) -> Array:
        """The newest slope, per second."""
        return self._slope

    def polynomial(self, origin: float, order: int | None = None) -> Array:
        """The polynomial of ``order`` through the newest points, about ``origin`` (s)."""
        order = self.order if order is None else order
        slopes = order > 0 and (self._slopes or len(self._times) <= order)
        points = min(order + 1 - slopes, len(self._times))
        offsets = [time - origin for time in self._times[-points:]]
        return interpolated(offsets, self._values[-points:], self._slope if slopes else None)

    def save(self) -> tuple[Any, ...]:
        return (self._times, self._values, self._slope)

    def restore(self, saved: tuple[Any, ...]) -> None:
        self._times, self._values, self._slope = saved
