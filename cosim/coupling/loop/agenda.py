"""When something is to be written down: rows, frames of the camera, the end of settling, the part's
heights of which v_average is the slope."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.trials.camera import FRAME_RATE, frame_times, instants, instants_a_frame

ENTRIES = 1 << 14
"""Rows and frames of the camera that are planned, and taken, at a time."""

KEPT = 1 << 17
"""Rows of a run whose agenda is kept for others, such as those of a sweep: 2 MB."""

SAME_TIME = 1e-12  # s; communication points closer than this are one
_ROW, _FRAME, _SETTLED, _PART = 1, 2, 4, 8
_NEVER = 1 << 80  # multiples of SAME_TIME


def grid(step: float, end: float) -> Array:
    """0, step, 2 step ... up to ``end``, which counts as reached within rounding."""
    return step * np.arange(count(step, end), dtype=np.float64)


def count(step: float, end: float) -> int:
    """How many times :func:`grid` has."""
    return int(end / step * (1 + 1e-12)) + 1


class Agenda:
    """Times, s, and what is to be written down at each."""

    def __init__(self, times: Array, what: npt.NDArray[np.int32]) -> None:
        self.times, self.what = times, what
        times.flags.writeable = what.flags.writeable = False
        # Asked for once, since many runs have the same agenda.
        self.addresses = times.ctypes.data, what.ctypes.data
        """Where compiled code finds both arrays."""


@lru_cache(4)
def _all(*given: Any) -> tuple[Agenda, ...]:
    return tuple(agendas(*given))


def kept(row_step: float, duration: float, *more: Any) -> Iterator[Agenda]:
    """What :func:`agendas` gives; that of a run which is not long is kept, as others have it."""
    make = _all if count(row_step, duration) <= KEPT else agendas
    return iter(make(row_step, duration, *more))


def agendas(
    row_step: float,
    duration: float,
    settle: float,
    stops: tuple[float, ...],
    shutter: float,
    slope: bool = False,
) -> Iterator[Agenda]:
    """When something is to be written down, part after part; not more than ENTRIES rows and frames
    in one. The last time of all is endless.

    Of frames, which are exposed for a share ``shutter`` of their interval, the instants. With
    ``slope`` also the part's heights at :func:`part_times`.
    """
    frame_step = 1.0 / FRAME_RATE
    parts = part_times(duration, settle) if slope else np.empty(0)
    extra = np.concatenate([[settle, *stops], parts])
    kinds = np.repeat(np.array([_SETTLED, 0, _PART], np.int32), [1, len(stops), len(parts)])
    places = np.rint(extra / SAME_TIME)
    # Whole numbers of SAME_TIME, so that no part ends between times that are one.
    shortest = min(row_step, frame_step / instants_a_frame(shutter * frame_step))
    length = max(1, int(ENTRIES / 3 * shortest / SAME_TIME))
    last = int(np.rint(duration / SAME_TIME)) + 1
    for begin in range(0, last, length):
        # To the last one belongs what rounding puts behind the end.
        end = begin + length if begin + length < last else _NEVER
        rows = _within(row_step, duration, begin, end)
        frames = exposures(duration, settle, shutter, begin, end)
        here = (places >= begin) & (places < end)
        times = np.concatenate([rows, frames, extra[here]])
        what = np.concatenate(
            [np.repeat(np.array([_ROW, _FRAME], np.int32), [len(rows), len(frames)]), kinds[here]]
        )
        if not len(times):
            continue
        place = np.rint(times / SAME_TIME)
        order = place.argsort(kind="stable")
        place = place[order]
        # Of times that are one the first is taken.
        first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
        times, joined = times[order[first]], np.bitwise_or.reduceat(what[order], first)
        if end == _NEVER:
            yield Agenda(np.append(times, np.inf), np.append(joined, np.int32(0)))
        else:
            yield Agenda(times, joined)


def part_times(duration: float, settle: float) -> Array:
    """When the camera reads the part's heights for ``run.average = "slope"``, s. A record's length
    in a scene is rounded, to less than a hundredth of a frame: the last may be the run's end."""
    times = frame_times(settle, int((duration - settle) * FRAME_RATE + 0.01) + 1)
    return np.minimum(times, duration)


def exposures(
    duration: float, settle: float, shutter: float, begin: int = 0, end: int = _NEVER
) -> Array:
    """The instants (s), from ``begin`` until before ``end`` (multiples of SAME_TIME), of the
    frames that are exposed wholly after ``settle`` and before ``duration`` (s).
    """
    exposure = shutter / FRAME_RATE
    reach = int(exposure / SAME_TIME) + 1
    frames = _within(1.0 / FRAME_RATE, duration, begin - reach, end + reach)
    opened, closed = frames - exposure / 2, frames + exposure / 2
    frames = frames[(opened >= settle) & (closed <= duration * (1 + 1e-12))]
    times = instants(frames, exposure)
    place = np.rint(times / SAME_TIME)
    return times[(place >= begin) & (place < end)]


def _within(step: float, duration: float, begin: int, end: int) -> Array:
    """What :func:`grid` has from ``begin`` until before ``end``, multiples of SAME_TIME."""
    # One more at either side, and then those that rounding puts there.
    low = max(0, int(begin * SAME_TIME / step) - 1)
    high = min(count(step, duration), int(end * SAME_TIME / step) + 2)
    times = step * np.arange(low, high, dtype=np.float64)
    place = np.rint(times / SAME_TIME)
    return times[(place >= begin) & (place < end)]
