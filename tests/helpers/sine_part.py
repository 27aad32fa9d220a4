"""The part on a surface that moves as a sine, from event to event by SciPy's root finder.

Where a mode ends is looked for at many points and then found by Brent's method. Nothing is shared
with the code under test.
"""

from collections.abc import Callable
from math import copysign, cos, pi, sin

from scipy.optimize import root_scalar

LOOKS = 400  # a period
ROUNDING = 1e-13  # m/s

Margin = Callable[[float], float]
"""Of a time (s); a mode ends where it falls through zero."""


def sign(x: float) -> int:
    return (x > 0) - (x < 0)


class SinePart:
    """Forces are over the part's mass, m/s², ``half`` is the amplitude of the surface's velocity,
    m/s. The part starts with the surface at rest, both at the height 0.
    """

    def __init__(
        self,
        half: float,
        frequency: float,
        static: float,
        kinetic: float,
        plate: float,
        gravity: float = 9.81,
    ) -> None:
        self.half, self.turn = half, 2 * pi * frequency
        self.static, self.kinetic, self.plate, self.gravity = static, kinetic, plate, gravity
        self.t = self.z = self.v = 0.0
        self.heat = self.work = 0.0  # J/kg, so far
        self.events: list[float] = []
        """When it changed between sticking and slipping, s."""
        self._sticks: bool | None = None
        self._look = 1.0 / (LOOKS * frequency)

    def speed(self, t: float) -> float:
        return self.half * sin(self.turn * t)

    def height(self, t: float) -> float:
        return self.half / self.turn * (1 - cos(self.turn * t))

    def need(self, t: float, way: int) -> float:
        """Friction that it takes to stick while the part goes one way."""
        return self.half * self.turn * cos(self.turn * t) + self.gravity + way * self.plate

    def height_at(self, stop: float) -> float:
        """The part's height at a time after all those before, s."""
        while self.t < stop:
            relative = self.v - self.speed(self.t)
            relative = relative if abs(relative) > ROUNDING else 0.0
            self.v = self.v if abs(self.v) > ROUNDING else 0.0
            # Where all rest the surface is about to take the part along.
            way = sign(self.v) or sign(cos(self.turn * self.t))
            need = self.need(self.t + 1e-9, way)
            sticks = relative == 0.0 and abs(need) <= self.static
            if self._sticks is not None and sticks != self._sticks:
                self.events.append(self.t)
            self._sticks = sticks
            if sticks:
                self._stick(way, stop)
            else:
                self._slip(sign(relative) or -sign(need), stop)
        return self.z

    def _stick(self, way: int, stop: float) -> None:
        end = self._first(
            stop, lambda s: self.static - abs(self.need(s, way)), lambda s: way * self.speed(s)
        )
        risen, v = self.height(end) - self.height(self.t), self.speed(end)
        self.work += (v**2 - self.v**2) / 2 + (self.gravity + way * self.plate) * risen
        self.heat += self.plate * abs(risen)
        self.t, self.z, self.v = end, self.z + risen, v

    def _slip(self, side: int, stop: float) -> None:
        begin, v, pull = self.t, self.v, -side * self.kinetic - self.gravity
        if v:
            a = pull - copysign(self.plate, v)
        else:
            a = 0.0 if abs(pull) <= self.plate else pull - copysign(self.plate, pull)
        end = self._first(
            stop,
            lambda s: side * (v + a * (s - begin) - self.speed(s)),
            lambda s: sign(v) * (v + a * (s - begin)) if v else 1.0,
        )
        h, moved = end - begin, self.height(end) - self.height(begin)
        risen = v * h + a * h * h / 2
        self.heat += self.kinetic * abs(risen - moved) + self.plate * abs(risen)
        self.work -= side * self.kinetic * moved
        self.t, self.z, self.v = end, self.z + risen, v + a * h

    def _first(self, stop: float, *margins: Margin) -> float:
        """When the first margin is used up, s; at the latest ``stop``."""
        low = self.t
        # At the begin a margin may be zero and about to rise.
        first = low + 1e-6 * self._look
        while low < stop:
            high = min(low + self._look, stop)
            ends: list[float] = [
                root_scalar(margin, bracket=(first, high), xtol=1e-16, rtol=1e-15).root
                for margin in margins
                if margin(high) < 0 < margin(first)
            ]
            if ends:
                return min(ends)
            low = first = high
        return stop
