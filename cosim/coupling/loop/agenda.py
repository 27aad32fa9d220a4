"""The times of a run at which values are recorded: rows, frames of the camera, the end of settling,
and the part's heights of which v_average is the slope."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.trials.camera import FRAME_RATE, frame_times, instants, instants_a_frame

ENTRIES = 1 << 14
"""Rows and frames of the camera in one part of the agenda, at most."""

KEPT = 1 << 17
"""Most rows of a run (2 MB) whose agenda is cached for other runs, such as those of a sweep."""

SAME_TIME = 1e-12  # s; communication points closer than this are one
_ROW, _FRAME, _SETTLED, _PART = 1, 2, 4, 8  # bits: what is recorded at a time
_NEVER = 1 << 80  # in multiples of SAME_TIME, behind the end of any run


def grid(step: float, end: float) -> Array:
    """0, step, 2 step ... up to ``end``, which counts as reached within rounding."""
    return step * np.arange(count(step, end), dtype=np.float64)


def count(step: float, end: float) -> int:
    """The number of times in :func:`grid`."""
    return int(end / step * (1 + 1e-12)) + 1


class Agenda:
    """Times, s, and the kinds of values to be recorded at each, as bits."""

    def __init__(self, times: Array, what: npt.NDArray[np.int32]) -> None:
        self.times, self.what = times, what
        times.flags.writeable = what.flags.writeable = False
        # Calculated once, since many runs share an agenda.
        self.addresses = times.ctypes.data, what.ctypes.data
        """Where compiled code finds both arrays."""


@lru_cache(4)
def _all(*given: Any) -> tuple[Agenda, ...]:
    return tuple(agendas(*given))


def kept(row_step: float, duration: float, *more: Any) -> Iterator[Agenda]:
    """The parts of :func:`agendas`; those of a run with at most KEPT rows are cached."""
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
    """The agenda in parts, each with at most ENTRIES rows and frames; the very last time is inf.

    A frame is exposed for a share ``shutter`` of the frames' interval, and read at several instants
    of it. With ``slope`` the part's heights are recorded at :func:`part_times`, too; at ``stops``
    (s) steps end without a record.
    """
    frame_step = 1.0 / FRAME_RATE
    parts = part_times(duration, settle) if slope else np.empty(0)
    extra = np.concatenate([[settle, *stops], parts])
    kinds = np.repeat(np.array([_SETTLED, 0, _PART], np.int32), [1, len(stops), len(parts)])
    places = np.rint(extra / SAME_TIME)
    # Parts end at whole multiples of SAME_TIME, never between two times that count as one.
    shortest = min(row_step, frame_step / instants_a_frame(shutter * frame_step))
    length = max(1, int(ENTRIES / 3 * shortest / SAME_TIME))
    last = int(np.rint(duration / SAME_TIME)) + 1
    for begin in range(0, last, length):
        # The last part also takes times that rounding puts behind the run's end.
        end = begin + length if begin + length < last else _NEVER
        rows = _within(row_step, duration, begin, end)
        frames = exposures(duration, settle, shutter, begin, end)
        within = (places >= begin) & (places < end)
        times = np.concatenate([rows, frames, extra[within]])
        what = np.concatenate(
            [np.repeat(np.array([_ROW, _FRAME], np.int32), [len(rows), len(frames)]), kinds[within]]
        )
        if not len(times):
            continue
        place = np.rint(times / SAME_TIME)
        order = place.argsort(kind="stable")
        place = place[order]
        # Times that count as one are merged: the first of them, with the bits of all.
        first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
        times, joined = times[order[first]], np.bitwise_or.reduceat(what[order], first)
        if end == _NEVER:
            yield Agenda(np.append(times, np.inf), np.append(joined, np.int32(0)))
        else:
            yield Agenda(times, joined)


def part_times(duration: float, settle: float) -> Array:
    """Times (s) of the frames that show the part's heights for ``run.average = "slope"``. A scene
    holds a record's length rounded to less than 0.01 frames, so the last frame may lie just behind
    the run's end and is moved to it."""
    times = frame_times(settle, int((duration - settle) * FRAME_RATE + 0.01) + 1)
    return np.minimum(times, duration)


def exposures(
    duration: float, settle: float, shutter: float, begin: int = 0, end: int = _NEVER
) -> Array:
    """The instants (s), from ``begin`` until before ``end`` (in multiples of SAME_TIME), of all
    frames whose exposure lies wholly between ``settle`` and ``duration`` (s).
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
    """The times of :func:`grid` from ``begin`` until before ``end``, in multiples of SAME_TIME."""
    # One time more at either side, then those are selected that rounding puts inside.
    low = max(0, int(begin * SAME_TIME / step) - 1)
    high = min(count(step, duration), int(end * SAME_TIME / step) + 2)
    times = step * np.arange(low, high, dtype=np.float64)
    place = np.rint(times / SAME_TIME)
    return times[(place >= begin) & (place < end)]
