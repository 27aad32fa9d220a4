"""The inputs of each side of a coupling over a macro step: polynomials in time.

A polynomial is a tuple of coefficients about the start t_n of the step: ``c[k]``, a number or an
array of the signal's own shape, is the factor of (t - t_n)^k. Code for numbers and arrays is the
same plain arithmetic: the compiled loop asks for a polynomial at each macro point, where arrays
would cost more than the step.
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
    """The time derivative of the polynomial at ``s`` seconds after its origin."""
    if len(coefficients) == 1:
        return 0.0 * coefficients[0]
    return value([k * c for k, c in enumerate(coefficients)][1:], s)


def shifted(coefficients: Array, s: float) -> Array:
    """The coefficients of the polynomial about an origin ``s`` seconds later (Taylor shift)."""
    c = np.array(coefficients)
    for first in range(len(c) - 1):
        for k in range(len(c) - 2, first - 1, -1):
            c[k] = c[k] + s * c[k + 1]
    return c


def projected(coefficients: Any, h: float, degree: int) -> Polynomial:
    """The polynomial of at most ``degree`` 0 or 1 that is nearest in the mean square over [0, h].

    It keeps the integral, for degree 1 also the first moment: so an integrator driven by it ends at
    the same value. A participant that takes only linear inputs loses nothing up to order h^4.
    """
    c = coefficients
    if len(c) <= degree + 1:
        return c
    mean = sum(c[k] * (h**k / (k + 1)) for k in range(len(c)))
    if degree == 0:
        return (mean,)
    # mean = 1/h ∫ p dt, moment = 1/h² ∫ t p dt; of a line: mean = a + b h/2, moment = a/2 + b h/3.
    moment = sum(c[k] * (h**k / (k + 2)) for k in range(len(c)))
    rise = (12.0 * moment - 6.0 * mean) / h
    return (mean - 0.5 * h * rise, rise)


class History:
    """The last values of a signal at communication points, the newest first, and its slope."""

    def __init__(self, degree: int, slopes: bool) -> None:
        """For polynomials up to ``degree``, which with ``slopes`` use the newest slope.

        Without ``slopes`` they use one more old value instead, and the slope only while there are
        too few old values, so that a method starts with its full order.
        """
        self._points: tuple[tuple[float, Any], ...] = ()
        self._older = max(degree, 1)
        self._slopes = slopes
        self.slope: Any = None
        """The newest slope, per second; None where it is not known."""

    @property
    def value(self) -> Any:
        """The newest value."""
        return self._points[0][1]

    def add(self, time: float, value: Any, slope: Any) -> None:
        """A new communication point at ``time`` (s)."""
        self._points = ((time, value), *self._points[: self._older])
        self.slope = slope

    def restart(self) -> None:
        """Forget all but the newest point: older ones lie before an event."""
        self._points = self._points[:1]

    def polynomial(self, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through the newest points, with its origin at the
        newest; of a lower degree while there are too few points."""
        if degree == 0:
            return (self.value,)
        # Newton's divided differences; a known slope counts as a second point at the newest time.
        (time, newest), *older = self._points
        slope = self.slope
        slopes = slope is not None and (self._slopes or len(older) < degree)
        points = min(degree - slopes, len(older))
        if points == 0:
            return (newest, slope) if slopes else (newest,)
        back = older[0][0] - time
        rise = (older[0][1] - newest) / back
        if points == 1:
            return (newest, slope, (rise - slope) / back) if slopes else (newest, rise)
        # Newton's divided differences through three points.
        further = older[1][0] - time
        bend = ((older[1][1] - newest) / further - rise) / (further - back)
        return (newest, rise - bend * back, bend)

    def polynomial_to(self, h: float, end: Any, degree: int) -> Polynomial:
        """The polynomial of ``degree`` 0, 1 or 2 through the value ``end``, ``h`` (s) after the
        newest point, and the newest points, with its origin at the newest."""
        if degree == 0:
            return (end,)
        (time, newest), *older = self._points
        rise = (end - newest) / h
        if degree == 1 or not older:
            return (newest, rise)
        back = older[0][0] - time
        bend = (rise - (older[0][1] - newest) / back) / (h - back)
        return (newest, rise - bend * h, bend)

    def save(self) -> tuple[Any, ...]:
        return (self._points, self.slope)

    def restore(self, saved: tuple[Any, ...]) -> None:
        self._points, self.slope = saved
