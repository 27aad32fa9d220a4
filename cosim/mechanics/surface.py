"""A surface whose velocity is a given function of time."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cosim.arrays import Array


@dataclass(frozen=True)
class Surface:
    """A velocity that is linear between knots: ``times`` (s, not falling; a time given twice is a
    jump) and ``velocities`` (m/s), repeated ``periods`` times. With ``turn`` (rad/s) not 0 it is
    ``half`` (m/s) times sin(``turn`` t), with knots at each quarter turn at least.
    """

    times: Array
    velocities: Array
    periods: int = 1
    half: float = 0.0
    turn: float = 0.0

    @classmethod
    def sine(cls, half: float, frequency: float, periods: int, bounds: Array) -> Self:
        """``half`` (m/s) sin(2π ``frequency`` t), with knots where its acceleration passes one of
        the ``bounds`` (m/s²), too."""
        turn = 2.0 * np.pi * frequency
        phases = np.arccos([bound / (half * turn) for bound in bounds if abs(bound) < half * turn])
        quarters = np.array([0.0, 0.25, 0.5, 0.75, 1.0]) / frequency
        between = np.concatenate([phases, 2.0 * np.pi - phases]) / turn
        times = np.concatenate([quarters, between])
        velocities = np.concatenate([[0.0, half, 0.0, -half, 0.0], half * np.sin(turn * between)])
        order = np.argsort(times, kind="stable")
        return cls(times[order], velocities[order], periods, half, turn)

    @property
    def period(self) -> float:
        """Time from the first knot to the last, s."""
        return float(self.times[-1] - self.times[0])

    def extremes(self, start: float, end: float) -> dict[str, float]:
        """Largest and smallest acceleration (m/s²; infinite where the velocity jumps), velocity
        (m/s) and height over that at ``start`` (m) from ``start`` to ``end`` (s).

        A surface that repeats itself returns to its height.
        """
        within = self._within(start, end)
        a, v, risen, rest = self._of_sine(*within[:3]) if self.turn else self._of_lines(*within[1:])
        # Heights at the ends of pieces, then at the turning points within them.
        z = np.concatenate([[0.0], np.cumsum(risen)])
        z = np.concatenate([z, z[:-1] + rest])
        ranges = {"a_surface": a, "v_surface": v, "z_surface": z}
        return {f"{name}_max": float(values.max()) for name, values in ranges.items()} | {
            f"{name}_min": float(values.min()) for name, values in ranges.items()
        }

    def _within(self, start: float, end: float) -> tuple[Array, ...]:
        """Pieces between knots that lie in part between ``start`` and ``end``, of one period or two
        after it: where each begins (s after the first knot); from when to when it lies there (s
        after its begin); its length (s), and its velocities at both ends."""
        first = np.floor((start - self.times[0]) / self.period)
        first = min(max(first, 0.0), self.periods - 1.0)
        end = min(end, start + self.period)
        shifts = (first + np.arange(2 if self.periods > 1 else 1)) * self.period
        begins = (shifts[:, None] + self.times[:-1]).ravel()
        local, lengths = (np.tile(t, len(shifts)) for t in (self.times[:-1], np.diff(self.times)))
        v0, v1 = (np.tile(v, len(shifts)) for v in (self.velocities[:-1], self.velocities[1:]))
        # A piece that only touches ``start`` or ``end`` does not count; of a periodic surface a
        # jump at ``end`` does, since the one at ``start``, a period earlier, does not.
        closed = (lengths == 0.0) & (self.periods > 1)
        before = np.where(closed, begins <= end * (1.0 + 1e-12), begins < end)
        counts = before & (begins + lengths > start)
        begins, local, lengths, v0, v1 = (x[counts] for x in (begins, local, lengths, v0, v1))
        low, high = (np.clip(time - begins, 0.0, lengths) for time in (start, end))
        return local, low, high, lengths, v0, v1

    def _of_sine(self, local: Array, low: Array, high: Array) -> tuple[Array, Array, Array, Array]:
        """Accelerations and velocities at both ends of the pieces of a sine (2 × pieces), the rise
        (m) in each, and 0: it turns at its knots alone."""
        phases = self.turn * np.stack([local + low, local + high])
        v = self.half * np.sin(phases)
        a = self.half * self.turn * np.cos(phases)
        risen = -np.diff(np.cos(phases), axis=0)[0] * self.half / self.turn
        return a, v, risen, np.zeros_like(risen)

    @staticmethod
    def _of_lines(
        low: Array, high: Array, lengths: Array, v0: Array, v1: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The same of straight pieces and jumps, with one acceleration each, and the rise (m) from
        ``low`` to the turning point, where the velocity is 0, within a piece."""
        jump = lengths == 0.0
        slopes = np.divide(v1 - v0, lengths, out=np.zeros_like(v0), where=~jump)
        v = np.stack([v0 + slopes * low, np.where(high < lengths, v0 + slopes * high, v1)])
        a = np.where(jump, np.copysign(np.inf, v1 - v0), slopes)
        risen = 0.5 * (v[0] + v[1]) * (high - low)
        turns = (v[0] * v[1] < 0.0) & ~jump
        rest = np.divide(-0.5 * v[0] ** 2, slopes, out=np.zeros_like(risen), where=turns)
        return a, v, risen, rest
