"""Commands as straight lines: what a participant takes whose inputs are linear over a step."""

from collections.abc import Iterator, Sequence

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import SINE, Command, Piece

_CHORDS = 1000
"""Straights a period of a sine: within 5e-6 of the amplitude."""

_TOGETHER = 4096
"""How many straights are prepared at a time."""


def straights(commands: Sequence[Command], duration: float) -> Iterator[tuple[Array, Array, Array]]:
    """Times (s), the first one where the last ones ended, and V1 (V, a column a command) at the
    start and the end of each interval between two of them, until ``duration``, block after block.
    """
    edges = [0.0]
    pieces = [command.piece(0.0) for command in commands]
    rows: list[tuple[list[float], list[float]]] = []
    while edges[-1] < duration:
        begin = edges[-1]
        stop = min(duration, *(end_of_straight(piece, begin) for piece in pieces))
        rows.append(([p.value(begin) for p in pieces], [p.before(stop) for p in pieces]))
        edges.append(stop)
        pieces = [
            piece if stop < piece.until else command.piece(stop)
            for piece, command in zip(pieces, commands, strict=True)
        ]
        if len(rows) == _TOGETHER or stop >= duration:
            start, end = np.array(rows).swapaxes(0, 1)
            yield np.array(edges), start, end
            edges, rows = edges[-1:], []


def end_of_straight(piece: Piece, begin: float) -> float:
    """Where the straight that starts at ``begin`` (s) ends, s."""
    if piece.kind == SINE:
        return min(piece.until, begin + 1.0 / _CHORDS / piece.rate)
    return piece.until
