"""The command as the firmware makes it: a staircase of DAC codes, and the offset pin's PWM."""

from bisect import bisect_right
from math import ceil, floor, inf

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import Command, Piece, edge_before, level
from cosim.scene.firmware import GAIN, PWM_FREQUENCY, STEPS_PER_SECOND, V_REFERENCE, volts


class Staircase(Command):
    """The firmware's sawtooth: ``rate`` DAC codes a second, and a 10-bit code at the offset pin.

    ``codes`` is one period of DAC codes, ``v_offset`` the offset pin in V; see
    :mod:`cosim.scene.firmware` for where they come from.
    """

    def __init__(
        self, codes: tuple[int, ...], v_offset: float, rate: float = STEPS_PER_SECOND
    ) -> None:
        self.codes = codes
        self.v_offset = v_offset
        self._rate = rate
        self.period = len(codes) / rate
        self._edges = [k for k in range(len(codes)) if codes[k] != codes[k - 1]]  # periodic

    def piece(self, t: float) -> Piece:
        count = len(self.codes)
        period, step = divmod(edge_before(t, self._rate), count)
        dac = volts(self.codes[step])
        return level(self._until(period, step), GAIN * (self.v_offset - dac), self.v_offset, dac)

    def lines(self, begin: float, end: float, most: int) -> tuple[Array, Array, Array] | None:
        if not self._edges:
            return None
        count, edges = len(self.codes), np.array(self._edges)
        most = min(most, ceil((end - begin) * self._rate) + 1)
        period, step = divmod(edge_before(begin, self._rate), count)
        # Edges are numbered on from period to period; the first one after ``begin`` comes first.
        first = period * len(edges) + bisect_right(self._edges, step)
        periods, places = np.divmod(first + np.arange(most), len(edges))
        corners = (periods * count + edges[places]) / self._rate
        levels = np.array([GAIN * (self.v_offset - volts(code)) for code in self.codes])
        held = levels[np.append(step, edges[places[:-1]])]
        return np.append(begin, corners), held, held

    def _until(self, period: int, step: int) -> float:
        if not self._edges:
            return inf
        after, place = divmod(bisect_right(self._edges, step), len(self._edges))
        return ((period + after) * len(self.codes) + self._edges[place]) / self._rate


class WithPwm(Command):
    """Another command, with the offset pin as a PWM: 0 or 3.3 V, with the duty that gives its mean.

    ``period`` is that of the command, although it holds no whole number of pulses. Time 0 is the
    middle of a pulse, where the settled filter behind the pin passes its mean; the real PWM's phase
    to the sawtooth is random. Before 0 the pin has its mean, so that a run begins settled. An edge
    within a nanosecond of a jump of the command is moved onto it.
    """

    _SAME = 1e-9  # s

    def __init__(self, command: Command) -> None:
        self._command = command
        self.v_offset = command.v_offset
        self.period = command.period
        duty = command.v_offset / V_REFERENCE
        self._half = 0.5 * duty
        self._still = not 1e-5 < duty < 1 - 1e-5  # pulses or gaps too short to matter, 20 ns

    def piece(self, t: float) -> Piece:
        piece = self._command.piece(t)
        if self._still:
            return piece
        edge = 0.0
        if t >= 0.0:
            k = self._last_edge(t)
            edge = self._edge(k + 1)
            piece.pin = V_REFERENCE if k % 2 else 0.0
        piece.jump = min(piece.jump, edge)
        if edge < piece.until:
            piece.until, piece.end = edge, piece.value(edge)
        return piece

    def _edge(self, k: int) -> float:
        """Time of the PWM's edge k >= 0, s: even ones fall, odd ones rise."""
        place = 1 - self._half if k % 2 else self._half
        time = (k // 2 + place) / PWM_FREQUENCY
        jump = self._command.next_jump(time - self._SAME)
        return jump if jump <= time + self._SAME else time

    def _last_edge(self, t: float) -> int:
        """The last edge at or before ``t`` >= 0; -1 if there is none."""
        k = 2 * floor(t * PWM_FREQUENCY) + 2
        while k >= 0 and self._edge(k) > t:
            k -= 1
        return k
