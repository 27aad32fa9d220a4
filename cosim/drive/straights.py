"""Commands as straight lines ("straights"), for participants with inputs linear over a step.

The ends of a sine's straights lie slightly outside of the sine, so that each straight has the
sine's mean. With N per period the mean of a chord would be too small by a share (π/N)²/3, and so
would the machine's response. The error left within a straight is at most (π/N)²/3 of the amplitude.
"""

from collections.abc import Iterator, Sequence
from math import ceil, pi, tan

import numpy as np

from cosim.arrays import Array
from cosim.drive.pieces import SINE, Command, Piece

_CHORDS = 4000
"""Straights per period of a sine: within 2.1e-7 of half its peak-to-peak voltage."""

_TOGETHER = 4096
"""Straights that are prepared at a time; for a sine, those of one period."""


def straights(
    commands: Sequence[Command], duration: float, chords: int = _CHORDS
) -> Iterator[tuple[Array, Array, Array]]:
    """Blocks of straights until ``duration`` (s): times (s) at their ends, beginning with the last
    time of the block before, and V1 (V, a column per command) at the start and end of each. The
    commands have the same shape; a sine has ``chords`` straights per period."""
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
    """The straights of a command that lists them by ``Command.lines``."""
    begin = 0.0
    while begin < duration and (found := command.lines(begin, duration, _TOGETHER)):
        corners, start, end = found
        # The last straight is cut at ``duration``, before its own end.
        count = int(corners.searchsorted(duration))
        if count < len(corners):
            corners, start, end = corners[: count + 1], start[:count], end[:count]
            if corners[count] > duration:
                last = command.piece(float(corners[count - 1])).before(duration)
                corners, end = np.append(corners[:count], duration), np.append(end[:-1], last)
        yield corners, start[:, np.newaxis], end[:, np.newaxis]
        begin = float(corners[-1])


def straight(piece: Piece, begin: float) -> tuple[float, float, float]:
    """The end (s) of the straight that starts at ``begin`` (s), and V1 (V) at its start and end."""
    if piece.kind != SINE:
        return piece.until, piece.value(begin), piece.before(piece.until)
    stop = min(piece.until, begin + 1.0 / _CHORDS / piece.rate)
    first, last = _on_straights(piece, np.array([begin, stop]), _CHORDS).tolist()
    return stop, first, last


def _times(rate: float, begin: float, stop: float) -> Array:
    """Ends of straights, ``rate`` per second, from ``begin`` to ``stop`` (s), the last end."""
    step = 1.0 / rate
    count = max(1, ceil((stop - begin) / step - 1e-6))
    return np.append(begin + step * np.arange(count), stop)


def _on_straights(piece: Piece, times: Array, chords: int) -> Array:
    """V1 (V) at the ends ``times`` (s) of the straights of a piece, for a sine ``chords`` per
    period; at the last time the left limit."""
    values = np.append(piece.values(times[:-1]), piece.before(float(times[-1])))
    if piece.kind == SINE:
        # The factor on the sine's deviation from its offset by which straights keep its mean.
        outside = tan(pi / chords) / (pi / chords)
        values = piece.offset + outside * (values - piece.offset)
    return values
