"""Commands with a shape of their own: sine, and straight lines between corners."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, inf

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import RAMP, SINE, Command, Piece, edge_before, level
from cosim.scene.firmware import offset_pin


class _Periodic(Command):
    """``frequency`` in Hz, ``amplitude`` (peak to peak) and ``offset`` in V."""

    def __init__(self, frequency: float, amplitude: float, offset: float) -> None:
        self.frequency, self.amplitude, self.offset = frequency, amplitude, offset
        self.v_offset = offset_pin(offset, amplitude)
        self.period = 1.0 / frequency


Corners = Sequence[Sequence[float]]
"""Pairs of phase, 0 to 1 and not falling, and level, as a share of the peak-to-peak voltage about
the offset."""


class Lines(_Periodic):
    """Straight lines between ``corners``, and from the last to the first of the next period.

    V1 = offset + amplitude level. It jumps where two corners have one phase, 0 and 1 being one.
    """

    def __init__(self, frequency: float, amplitude: float, offset: float, corners: Corners) -> None:
        super().__init__(frequency, amplitude, offset)
        (first, low), *_ = corners
        ends = pairwise([*corners, (1.0 + first, low)])
        # Lines of a period: phase at the start, length in phase, levels at start and end.
        lines = [(p, q - p, a, b) for (p, a), (q, b) in ends if q > p]
        self._phases = [phase for phase, *_ in lines]
        self._shape = [
            (span, offset + amplitude * (0.5 * (a + b)), amplitude * (b - a))
            for _, span, a, b in lines
        ]
        after = [a for _, _, a, _ in lines[1:] + lines[:1]]
        self._jumps = [amplitude * (b - a) != 0.0 for (*_, b), a in zip(lines, after, strict=True)]

    def piece(self, t: float) -> Piece:
        number, count = self._number(t), len(self._phases)
        place = number % count
        jumps = (n + 1 for n in range(number, number + count) if self._jumps[n % count])
        jump = self._corner(next(jumps)) if any(self._jumps) else inf
        span, middle, rise = self._shape[place]
        if not rise:
            found = level(self._corner(number + 1), middle, self.v_offset)
            found.jump = jump
            return found
        return Piece(
            until=self._corner(number + 1),
            kind=RAMP,
            offset=middle,
            amplitude=rise,
            origin=self._corner(number),
            rate=self.frequency,
            span=span,
            end=middle + 0.5 * rise,
            jump=jump,
            pin=self.v_offset,
        )

    def lines(self, begin: float, end: float, most: int) -> tuple[Array, Array, Array] | None:
        count = len(self._phases)
        most = min(most, (ceil((end - begin) * self.frequency) + 1) * count)
        periods, places = np.divmod(self._number(begin) + np.arange(most + 1), count)
        corners = (periods + np.array(self._phases)[places]) / self.frequency
        _, middle, rise = np.array(self._shape)[places[:-1]].T
        start = middle - 0.5 * rise
        # The first line may have begun before ``begin``.
        corners[0], start[0] = begin, self.piece(begin).value(begin)
        return corners, start, middle + 0.5 * rise

    def _corner(self, number: int) -> float:
        period, place = divmod(number, len(self._phases))
        return (period + self._phases[place]) / self.frequency

    def _number(self, t: float) -> int:
        """The number of the last corner at or before ``t``, counted from period 0's first one."""
        period = edge_before(t, self.frequency)
        place = bisect_right(self._phases, t * self.frequency - period) - 1
        number = period * len(self._phases) + place
        while self._corner(number + 1) <= t:
            number += 1
        while self._corner(number) > t:
            number -= 1
        return number


def held(corners: Corners) -> Corners:
    """Corners of steps: each level is held until the phase of the next corner."""
    ends = [*(phase for phase, _ in corners[1:]), 1.0 + corners[0][0]]
    return [
        corner
        for (phase, high), end in zip(corners, ends, strict=True)
        for corner in ((phase, high), (end, high))
    ]


class Sine(_Periodic):
    """V1 = offset + amplitude/2 sin(2 pi f t)."""

    def piece(self, t: float) -> Piece:
        f = self.frequency
        n = edge_before(t, f)
        return Piece(
            until=(n + 1) / f,
            kind=SINE,
            offset=self.offset,
            amplitude=self.amplitude,
            origin=n / f,
            rate=f,
            end=self.offset,
            jump=inf,
            pin=self.v_offset,
        )
