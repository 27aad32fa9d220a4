"""The pieces of a command that compiled code has at hand."""

import ctypes
from collections.abc import Callable
from typing import Any

from cosim.drive.pieces import Command, Piece

_MANY = 512
"""How many are prepared at a time."""


class Ahead:
    """Those of a command until ``duration`` (s) in ``drive``, the structure ``Pieces`` of
    ``command.h``; ``reached`` tells how far the run is, s."""

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
        every = kept + self._command.pieces(begin, self._duration, _MANY)
        self.pieces = (Piece * len(every))(*every)
        drive.pieces, drive.count, drive.now = ctypes.addressof(self.pieces), len(every), 0
