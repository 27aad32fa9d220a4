"""Commands with a shape of their own: constant, sawtooth, sine and square."""

from math import ceil, inf

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import FALL, RISE, SINE, Command, Piece, edge_before, level
from cosim.scene.firmware import GAIN, offset_pin


class Constant(Command):
    """A command that never changes: ``level`` in V."""

    def __init__(self, level: float = 0.0) -> None:
        self.level = level
        self.v_offset = level / GAIN
        self.period = inf

    def piece(self, t: float) -> Piece:
        return level(inf, self.level, self.v_offset)


class _Periodic(Command):
    """``frequency`` in Hz, ``amplitude`` (peak to peak) and ``offset`` in V."""

    def __init__(self, frequency: float, amplitude: float, offset: float) -> None:
        self.frequency, self.amplitude, self.offset = frequency, amplitude, offset
        self.v_offset = offset_pin(offset, amplitude)
        self.period = 1.0 / frequency


class Sawtooth(_Periodic):
    """V1 = offset + amplitude (t/T - 1/2) on [0, T), then a sharp fall.

    With ``reset_time`` the rise takes T - reset_time and a linear fall the rest of the period;
    the peak-to-peak voltage stays ``amplitude``.
    """

    def __init__(
        self, frequency: float, amplitude: float, offset: float, reset_time: float = 0.0
    ) -> None:
        super().__init__(frequency, amplitude, offset)
        self.reset_time = reset_time
        self._fall = reset_time * frequency
        self._rise = 1.0 - self._fall
        self._jumps = amplitude != 0.0 and reset_time == 0.0

    def piece(self, t: float) -> Piece:
        f = self.frequency
        n = edge_before(t, f)
        peak, edge = (n + self._rise) / f, (n + 1) / f
        falls = self._fall > 0.0 and t >= peak
        half = 0.5 * self.amplitude
        return Piece(
            until=peak if self._fall > 0.0 and not falls else edge,
            kind=FALL if falls else RISE,
            offset=self.offset,
            amplitude=self.amplitude,
            origin=n / f,
            rate=f,
            span=self._fall if falls else self._rise,
            end=self.offset - half if falls else self.offset + half,
            jump=edge if self._jumps else inf,
            pin=self.v_offset,
        )

    def lines(self, begin: float, end: float, most: int) -> tuple[Array, Array, Array] | None:
        if self._fall > 0.0:
            return None
        f, half = self.frequency, 0.5 * self.amplitude
        count = min(most, ceil((end - begin) * f) + 1)
        corners = (edge_before(begin, f) + np.arange(count + 1)) / f
        return corners, np.full(count, self.offset - half), np.full(count, self.offset + half)


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


class Square(_Periodic):
    """V1 = offset + amplitude/2 in the first half of each period, offset - amplitude/2 after."""

    def piece(self, t: float) -> Piece:
        rate = 2 * self.frequency
        half = edge_before(t, rate)
        until = (half + 1) / rate if self.amplitude else inf
        high = self.offset + self.amplitude * (-0.5 if half % 2 else 0.5)
        return level(until, high, self.v_offset)

    def lines(self, begin: float, end: float, most: int) -> tuple[Array, Array, Array] | None:
        if not self.amplitude:
            return None
        rate = 2 * self.frequency
        count = min(most, ceil((end - begin) * rate) + 1)
        halves = edge_before(begin, rate) + np.arange(count + 1)
        levels = self.offset + self.amplitude * np.where(halves[:-1] % 2, -0.5, 0.5)
        return halves / rate, levels, levels
