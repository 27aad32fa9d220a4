"""What one side of a coupling is told of the other: polynomials in time over a macro step.

A polynomial is a tuple of coefficients about the start of the step: ``c[k]``, a number or an array
of the signal's own shape, belongs to (t - t_n)^k. Plain arithmetic serves both: the compiled loop
asks for a polynomial at each of its macro points, where arrays would cost more than the step.
"""

from typing import Any

import numpy as np

from cosim.arrays import Array

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

    __slots__ = (
        "_most",
        "_number",
        "_slopes",
        "_t1",
        "_t2",
        "_v1",
        "_v2",
        "slope",
        "time",
        "value",
    )

    def __init__(self, degree: int, slopes: bool) -> None:
        """Polynomials up to ``degree``; with ``slopes`` the newest slope counts as a known value.

        Without it older values are used instead, and the slope only fills in while there are not
        yet enough of them, so that a method begins with its own order.
        """
        self._most = max(degree, 1) + 1
        self._slopes = slopes
        self._number = 0
        self.time = self._t1 = self._t2 = 0.0
        """Of the newest point, s."""
        self.value: Any = None
        """The newest value; older ones stay apart from it, for speed."""
        self._v1 = self._v2 = self.value
        self.slope: Any = None
        """The newest slope, per second; None where it is not known."""

    def add(self, time: float, value: Any, slope: Any) -> None:
        """A new communication point at ``time`` (s)."""
        self._t2, self._t1, self.time = self._t1, self.time, time
        self._v2, self._v1, self.value = self._v1, self.value, value
        self.slope = slope
        if self._number < self._most:
            self._number += 1

    def restart(self) -> None:
        """Forget all but the newest point: what is older lies before an event."""
        self._number = 1

    def polynomial(self, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through the newest points, about the newest; of a
        lower degree while there are too few."""
        newest, slope = self.value, self.slope
        if degree == 0:
            return (newest,)
        slopes = slope is not None and (self._slopes or self._number <= degree)
        points = min(degree + 1 - slopes, self._number)
        if points == 1:
            return (newest, slope) if slopes else (newest,)
        back = self._t1 - self.time
        rise = (self._v1 - newest) / back
        if points == 2:
            return (newest, slope, (rise - slope) / back) if slopes else (newest, rise)
        further = self._t2 - self.time
        bend = ((self._v2 - newest) / further - rise) / (further - back)
        return (newest, rise - bend * back, bend)

    def polynomial_to(self, h: float, end: Any, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through ``end``, ``h`` (s) after the newest point,
        and the newest points, about the newest."""
        if degree == 0:
            return (end,)
        newest = self.value
        rise = (end - newest) / h
        if degree == 1 or self._number == 1:
            return (newest, rise)
        back = self._t1 - self.time
        bend = (rise - (self._v1 - newest) / back) / (h - back)
        return (newest, rise - bend * h, bend)

    def save(self) -> tuple[Any, ...]:
        times, values = (self.time, self._t1, self._t2), (self.value, self._v1, self._v2)
        return (self._number, times, values[: self._number], self.slope)

    def restore(self, saved: tuple[Any, ...]) -> None:
        self._number, times, values, self.slope = saved
        self.time, self._t1, self._t2 = times
        self.value, self._v1, self._v2 = (*values, None, None, None)[:3]
