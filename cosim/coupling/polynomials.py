"""What one side of a coupling is told of the other: polynomials in time over a macro step.

A polynomial is a tuple of coefficients about the start of the step: ``c[k]``, a number or an array
of the signal's own shape, belongs to (t - t_n)^k. Plain arithmetic serves both: the compiled loop
asks for a polynomial at each of its macro points, where arrays would cost more than the step.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

Polynomial = tuple[Any, ...]
"""Coefficients, the constant one first."""

Signal = tuple[Any, Any]
"""Value and time derivative of a signal at a communication point."""


def value(coefficients: Any, s: float) -> Any:
    """The polynomial at ``s`` seconds after its origin."""
    total = coefficients[-1]
    for k in range(len(coefficients) - 2, -1, -1):
        total = total * s + coefficients[k]
    return total


def slope(coefficients: Any, s: float) -> Any:
    """Its time derivative there, per second."""
    if len(coefficients) == 1:
        return 0.0 * coefficients[0]
    return value([k * c for k, c in enumerate(coefficients)][1:], s)


def shifted(coefficients: Array, s: float) -> Array:
    """The same polynomial about an origin ``s`` seconds later."""
    c = np.array(coefficients)
    for first in range(len(c) - 1):
        for k in range(len(c) - 2, first - 1, -1):
            c[k] = c[k] + s * c[k + 1]
    return c


def projected(coefficients: Any, h: float, degree: int) -> Polynomial:
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
        return (mean,)
    moment = sum(c[k] * (h**k / (k + 2)) for k in range(len(c)))
    rise = (12.0 * moment - 6.0 * mean) / h
    return (mean - 0.5 * h * rise, rise)


class History:
    """The last values of a signal at communication points, newest last, and the newest slope."""

    __slots__ = ("_keep", "_slopes", "_times", "_values", "slope")

    def __init__(self, degree: int, slopes: bool) -> None:
        """Polynomials up to ``degree``; with ``slopes`` the newest slope counts as a known value.

        Without it older values are used instead, and the slope only fills in while there are not
        yet enough of them, so that a method begins with its own order.
        """
        self._keep = max(degree, 1)
        self._slopes = slopes
        self._times: tuple[float, ...] = ()
        self._values: tuple[Any, ...] = ()
        self.slope: Any = None
        """The newest slope, per second; None where it is not known."""

    def add(self, time: float, value: Any, slope: Any) -> None:
        """A new communication point at ``time`` (s)."""
        keep = self._keep
        self._times = (*self._times[-keep:], time)
        self._values = (*self._values[-keep:], value)
        self.slope = slope

    def restart(self) -> None:
        """Forget all but the newest point: what is older lies before an event."""
        self._times, self._values = self._times[-1:], self._values[-1:]

    @property
    def value(self) -> Any:
        """The newest value."""
        return self._values[-1]

    def polynomial(self, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through the newest points, about the newest; of a
        lower degree while there are too few."""
        values, times = self._values, self._times
        newest = values[-1]
        if degree == 0:
            return (newest,)
        slopes = self.slope is not None and (self._slopes or len(times) <= degree)
        points = min(degree + 1 - slopes, len(times))
        if points == 1:
            return (newest, self.slope) if slopes else (newest,)
        back = times[-2] - times[-1]
        rise = (values[-2] - newest) / back
        if points == 2:
            return (newest, self.slope, (rise - self.slope) / back) if slopes else (newest, rise)
        further = times[-3] - times[-1]
        bend = ((values[-3] - newest) / further - rise) / (further - back)
        return (newest, rise - bend * back, bend)

    def polynomial_to(self, h: float, end: Any, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through ``end``, ``h`` (s) after the newest point,
        and the newest points, about the newest."""
        if degree == 0:
            return (end,)
        newest = self._values[-1]
        rise = (end - newest) / h
        if degree == 1 or len(self._times) == 1:
            return (newest, rise)
        back = self._times[-2] - self._times[-1]
        bend = (rise - (self._values[-2] - newest) / back) / (h - back)
        return (newest, rise - bend * h, bend)

    def save(self) -> tuple[Any, ...]:
        return (self._times, self._values, self.slope)

    def restore(self, saved: tuple[Any, ...]) -> None:
        self._times, self._values, self.slope = saved
