"""Commands as straight lines: what a participant takes whose inputs are linear over a step.

A sine's straights end a little outside of it, so that each has the sine's own mean: with N of them
a period a chord's mean is too small by (π/N)²/3 of itself, and all that the machine makes of the
command would be. What is left is the shape within a straight, at most (π/N)²/3 of the amplitude.
"""

from collections.abc import Iterator, Sequence
from math import ceil, pi, tan

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import SINE, Command, Piece

_CHORDS = 4000
"""Straights a period of a sine: within 2.1e-7 of half its peak-to-peak voltage."""

_TOGETHER = 4096
"""How many straights are prepared at a time; of a sine those of a period."""


def straights(
    commands: Sequence[Command], duration: float, chords: int = _CHORDS
) -> Iterator[tuple[Array, Array, Array]]:
    """Times (s), the first one where the last ones ended, and V1 (V, a column a command) at the
    start and the end of each interval between two of them, until ``duration``, block after block.
    The commands are of one shape; of a sine there are ``chords`` a period."""
    if len(commands) == 1 and commands[0].lines(0.0, duration, 1):
        yield from _lines(commands[0], duration)
        return
    edges = [0.0]
    pieces = [command.piece(0.0) for command in commands]
    rows: list[tuple[list[float], list[float]]] = []
    while edges[-1] < duration:
        begin = edges[-1]
        stop = min(duration, *(piece.until for piece in pieces))
        if pieces[0].kind == SINE:
            times = _times(chords * pieces[0].rate, begin, stop)
            values = np.stack([_on_straights(piece, times, chords) for piece in pieces], axis=1)
            yield times, values[:-1], values[1:]
            edges = [stop]
        else:
            rows.append(([p.value(begin) for p in pieces], [p.before(stop) for p in pieces]))
            edges.append(stop)
        pieces = [
            piece if stop < piece.until else command.piece(stop)
            for piece, command in zip(pieces, commands, strict=True)
        ]
        if rows and (len(rows) == _TOGETHER or stop >= duration or pieces[0].kind == SINE):
            start, end = np.array(rows).swapaxes(0, 1)
            yield np.array(edges), start, end
            edges, rows = edges[-1:], []


def _lines(command: Command, duration: float) -> Iterator[tuple[Array, Array, Array]]:
    """The straights of a command that knows them at once."""
    begin = 0.0
    while begin < duration and (found := command.lines(begin, duration, _TOGETHER)):
        corners, start, end = found
        count = int(corners.searchsorted(duration))
        if count < len(corners):
            corners, start, end = corners[: count + 1], start[:count], end[:count]
            if corners[count] > duration:
                last = command.piece(float(corners[count - 1])).before(duration)
                corners, end = np.append(corners[:count], duration), np.append(end[:-1], last)
        yield corners, start[:, np.newaxis], end[:, np.newaxis]
        begin = float(corners[-1])


def straight(piece: Piece, begin: float) -> tuple[float, float, float]:
    """Where the straight that starts at ``begin`` (s) ends, s, and V1 at both its ends, V."""
    if piece.kind != SINE:
        return piece.until, piece.value(begin), piece.before(piece.until)
    stop = min(piece.until, begin + 1.0 / _CHORDS / piece.rate)
    first, last = _on_straights(piece, np.array([begin, stop]), _CHORDS).tolist()
    return stop, first, last


def _times(rate: float, begin: float, stop: float) -> Array:
    """Where straights, ``rate`` a second, meet from ``begin`` to ``stop``, s; the last differs."""
    step = 1.0 / rate
    count = max(1, ceil((stop - begin) / step - 1e-6))
    return np.append(begin + step * np.arange(count), stop)


def _on_straights(piece: Piece, times: Array, chords: int) -> Array:
    """V1 (V) on the straights of one piece, of a sine ``chords`` a period, where they meet, at
    ``times`` (s); at the last one the left limit."""
    values = np.append(piece.values(times[:-1]), piece.before(float(times[-1])))
    if piece.kind == SINE:
        # The straights' deviation from the mean of the sine where they meet, over the sine's own.
        outside = tan(pi / chords) / (pi / chords)
        values = piece.offset + outside * (values - piece.offset)
    return values
