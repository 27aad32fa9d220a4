"""Commands consist of pieces: V1 between two corners in closed form.

The formula of a piece's value is in ``command.c`` alone, which ngspice's callbacks call too.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from ctypes import addressof, byref
from math import floor
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.scene.firmware import GAIN
from cosim.toolchain.libraries import library, structures

LEVEL, RAMP, SINE = range(3)
"""Kinds of pieces."""

PREPARED = 512
"""Pieces that are prepared for compiled code at a time."""


class Piece(structures("loop")["Piece"]):
    """The command in [``begin``, ``until``), s; ``command.h`` says what the fields are.

    ``kind``, ``offset``, ``amplitude`` (V), ``origin`` (s), ``rate`` (Hz) and ``span`` make its
    value; ``end`` is V1's left limit at ``until``, ``jump`` the time of the first discontinuity of
    V1 or a pin after ``begin`` (inf: none), ``dac`` the DAC's voltage on levels, ``pin`` the pin's.
    """

    begin: float
    until: float
    kind: int
    offset: float
    amplitude: float
    origin: float
    rate: float
    span: float
    end: float
    jump: float
    dac: float
    pin: float

    def value(self, t: float) -> float:
        """V1 at ``t`` in the piece, V."""
        return library("loop").command_value(byref(self), t)

    def values(self, times: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """V1 at each of ``times`` in the piece, V."""
        at = np.ascontiguousarray(times)
        values = np.empty_like(at)
        library("loop").command_values(byref(self), at.size, at.ctypes.data, values.ctypes.data)
        return values

    def before(self, t: float) -> float:
        """Left limit of V1 at ``t``, V, after the begin of the piece."""
        return self.end if t >= self.until else self.value(t)


def level(until: float, value: float, pin: float, dac: float | None = None) -> Piece:
    """A constant piece that ends with a jump, if it ends."""
    dac = pin - value / GAIN if dac is None else dac
    return Piece(until=until, offset=value, end=value, jump=until, dac=dac, pin=pin)


class Command(ABC):
    """V1 in V over time in s; continued periodically to times before 0.

    Every command is periodic and right-continuous. The n-th edge stands at the float
    ``n / frequency`` (one rounding, whatever n is): nothing drifts, and a solver that lands on a
    time from ``next_jump`` sees the jump exactly there.
    """

    v_offset: float
    """Mean voltage of the offset pin, V."""
    period: float
    """The period, s."""

    @abstractmethod
    def piece(self, t: float) -> Piece:
        """The piece that holds at ``t``, without its ``begin``."""

    def value(self, t: float) -> float:
        """V1 at ``t``, V; at a jump the value after it."""
        return self.piece(t).value(t)

    def next_jump(self, t: float) -> float:
        """Time of the first discontinuity of V1 or of a pin strictly after ``t``, s, or inf."""
        return self.piece(t).jump

    def lines(self, begin: float, end: float, most: int) -> tuple[Array, Array, Array] | None:
        """The straight pieces from the corner ``begin`` until ``end`` (s) is reached, at most
        ``most``: their corners (one more than pieces), and V1 (V) at the start and at the end of
        each. None where :meth:`piece` must be called one by one."""
        return None

    def pieces(self, begin: float, end: float, most: int | None = None) -> list[Piece]:
        """The pieces from ``begin`` until ``end`` (s) is within the last; ``most`` at most."""
        found: list[Piece] = []
        while begin <= end and (most is None or len(found) < most):
            piece = self.piece(begin)
            piece.begin = begin
            found.append(piece)
            begin = piece.until
        return found

    def values(self, times: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """V1 at each of ``times``, which do not fall, V; at a jump the value after it."""
        return self._values(times, 0.0, library("loop").command_values)

    def values_before(self, times: npt.ArrayLike) -> Array:
        """Left limits of V1 at each of ``times``, which do not fall, V; a time up to 1e-12 s after
        a jump is on it."""
        return self._values(times, 2e-12, library("loop").command_values_before)

    def _values(self, times: npt.ArrayLike, earlier: float, formula: Any) -> Array:
        at = np.ascontiguousarray(times, np.float64)
        values = np.empty_like(at)
        if at.size:
            before = at[0] - earlier  # a left limit may lie in the piece before
            pieces = self.pieces(float(before), float(at[-1])) if earlier else self._at(at)
            row = (Piece * len(pieces))(*pieces)
            formula(row, at.size, at.ctypes.data, values.ctypes.data)
        return values

    def _at(self, times: Array) -> list[Piece]:
        """The pieces in which one of ``times`` lies."""
        pieces: list[Piece] = []
        done = 0
        while done < times.size:
            pieces.append(self.piece(float(times[done])))
            done = int(times.searchsorted(pieces[-1].until))
        return pieces


class Ahead:
    """Prepares a command's pieces until ``duration`` (s) for compiled code, in ``drive``, the
    structure ``Pieces`` of ``command.h``; ``reached`` gives the run's present time, s."""

    def __init__(
        self, drive: Any, command: Command, duration: float, reached: Callable[[], float]
    ) -> None:
        self._drive, self._command, self._duration = drive, command, duration
        self._reached = reached
        self.pieces = (Piece * 0)()

    def refill(self) -> None:
        """Keep the pieces that are still needed, and prepare those that follow them."""
        reached, drive = self._reached(), self._drive
        kept = [piece for piece in self.pieces if piece.until > reached]
        begin = self.pieces[-1].until if self.pieces else 0.0
        every = kept + self._command.pieces(begin, self._duration, PREPARED)
        self.pieces = (Piece * len(every))(*every)
        drive.pieces, drive.count, drive.now = addressof(self.pieces), len(every), 0


def edge_before(t: float, rate: float) -> int:
    """The n of the last edge ``n / rate`` (as a float) at or before ``t``."""
    n = floor(t * rate)  # which rounding may put off by one
    if (n + 1) / rate <= t:
        return n + 1
    return n - 1 if n / rate > t else n
