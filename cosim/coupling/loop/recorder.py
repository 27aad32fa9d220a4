"""Moves the mechanics over an interval of time and writes down what was asked for.

Rows of the waveforms, frames of the camera and the end of settling are communication points of
their own: what stands in a row is a state of the mechanics, never an interpolation.
"""

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from cosim.files.spill import BLOCK, Tape
from cosim.mechanics.stickslip import SAMPLE_OUTPUTS, Mechanics
from cosim.scene import Scene
from cosim.trials.camera import FRAME_RATE

Array = npt.NDArray[np.float64]

_SAME_TIME = 1e-12  # s; communication points closer than this are one
Z_SURFACE = SAMPLE_OUTPUTS.index("z_surface")


ENTRIES = 1 << 14
"""Rows and frames of the camera that are planned, and taken, at a time."""


class Recorder:
    """The waveforms of the mechanics, filled as ``advance`` is called.

    ``extremes`` are the largest and smallest acceleration (m/s²), velocity (m/s) and height (m) of
    the surface after settling, and of the coil's current (A) where the mechanics have the source.
    """

    def __init__(
        self, scene: Scene, mechanics: Mechanics, progress: Callable[[float], None]
    ) -> None:
        run = scene.run
        self.mechanics = mechanics
        self._settle = run.settle
        self._progress = progress
        width = len(mechanics.columns)
        self._step_of_rows = run.output_step
        self._rows, self._frames, self._time = Tape(width), Tape(1), Tape(1)
        # What is not on the tapes yet. The compiled twin puts a frame's sample behind the last row.
        self._new_rows = np.empty((ENTRIES + 1, width))
        self._new_frames = np.empty(ENTRIES + 1)
        self._n_rows = self._n_frames = 0
        grip = mechanics.normal_force
        corners = [t for t in grip.corners if 0.0 < t < run.duration] if grip else []
        self._agendas = _agendas(
            run.output_step, run.duration, run.settle, [*corners, run.duration]
        )
        self.extremes = [-np.inf, np.inf] * (4 if mechanics.has_source else 3)
        self.at_settle: dict[str, float] = {}
        """Totals of the mechanics when settling ends."""
        self._begin()

    def _begin(self) -> None:
        """Write down what the agenda has for time 0."""
        self._plan()
        self._visit()

    def _plan(self) -> None:
        """Take what was written down away, and look up what is next to be."""
        self._take()
        times, what = next(self._agendas)
        self._times, self._what, self._next = times.tolist(), what.tolist(), 0

    def _take(self) -> None:
        """Put what was written down on the tapes."""
        self._rows.append(self._new_rows[: self._n_rows])
        self._frames.append(self._new_frames[: self._n_frames])
        self._n_rows = self._n_frames = 0

    @property
    def rows(self) -> Array:
        """A row for each time, a column for each of the mechanics' ``columns``, SI."""
        self._take()
        return self._rows.array()

    @property
    def frames(self) -> Array:
        """The surface's height (m) at each frame of the camera after settling."""
        self._take()
        return self._frames.column()

    @property
    def time(self) -> Array:
        """Times of the rows, s."""
        self._take()
        for start in range(len(self._time), len(self._rows), BLOCK):
            stop = min(start + BLOCK, len(self._rows))
            self._time.append(self._step_of_rows * np.arange(start, stop, dtype=np.float64))
        return self._time.column()

    def column(self, name: str) -> Array:
        """The values of one of the mechanics' ``columns`` in the rows."""
        return self.rows[:, self.mechanics.columns.index(name)]

    def follow(self, edges: Array, start: Array, end: Array) -> None:
        """Advance through intervals that end at ``edges`` (s); in each the mechanics' input goes
        linearly from ``start`` to ``end``, A or V.
        """
        for time, value, value_end in zip(
            edges.tolist(), start.tolist(), end.tolist(), strict=True
        ):
            self.advance(time, value, value_end)

    def advance(self, time: float, value: float, value_end: float) -> None:
        """Advance to ``time`` (s); the mechanics' input goes linearly between the two, A or V."""
        mechanics = self.mechanics
        start = mechanics.time
        slope = (value_end - value) / (time - start)
        while self._times[self._next] < time - _SAME_TIME:
            stop = self._times[self._next]
            self._step(stop, value + slope * (mechanics.time - start), slope)
            self._visit()
        self._step(time, value + slope * (mechanics.time - start), slope)
        if self._times[self._next] <= time + _SAME_TIME:
            self._visit()

    def _step(self, time: float, value: float, slope: float) -> None:
        self.mechanics.step_to(time, value, slope)
        if time > self._settle:
            _, _, a_max, a_min, v_max, v_min, z_max, z_min, *source = self.mechanics.step_outputs
            most = self.extremes
            if a_max > most[0]:
                most[0] = a_max
            if a_min < most[1]:
                most[1] = a_min
            if v_max > most[2]:
                most[2] = v_max
            if v_min < most[3]:
                most[3] = v_min
            if z_max > most[4]:
                most[4] = z_max
            if z_min < most[5]:
                most[5] = z_min
            if source:
                i_max, i_min = source
                if i_max > most[6]:
                    most[6] = i_max
                if i_min < most[7]:
                    most[7] = i_min

    def _visit(self) -> None:
        """Write down what the agenda has for this time."""
        what = self._what[self._next]
        self._next += 1
        if what & _SETTLED:
            self.at_settle = self.mechanics.totals()
        if what & (_ROW | _FRAME):
            sample = self.mechanics.sample()
            if what & _ROW:
                self._new_rows[self._n_rows] = sample
                self._n_rows += 1
            if what & _FRAME:
                self._new_frames[self._n_frames] = sample[Z_SURFACE]
                self._n_frames += 1
        if self._next == len(self._times):
            self._plan()
        self._progress(self.mechanics.time)


_ROW, _FRAME, _SETTLED = 1, 2, 4
_NEVER = 1 << 80  # multiples of _SAME_TIME


def grid(step: float, end: float) -> Array:
    """0, step, 2 step ... up to ``end``, which counts as reached within rounding."""
    return step * np.arange(int(end / step * (1 + 1e-12)) + 1, dtype=np.float64)


def _agendas(
    row_step: float, duration: float, settle: float, stops: list[float]
) -> Iterator[tuple[Array, npt.NDArray[np.int32]]]:
    """Times (s) at which something is to be written down, and what, part after part; not more than
    ENTRIES rows and frames in one. The last time of all is endless.
    """
    frame_step = 1.0 / FRAME_RATE
    extra, kinds = np.array([settle, *stops]), np.array([_SETTLED, *[0] * len(stops)], np.int32)
    # Whole numbers of _SAME_TIME, so that no part ends between times that are one.
    length = max(1, int(ENTRIES / 3 * min(row_step, frame_step) / _SAME_TIME))
    last = int(np.rint(duration / _SAME_TIME)) + 1
    for begin in range(0, last, length):
        # To the last one belongs what rounding puts behind the end.
        end = begin + length if begin + length < last else _NEVER
        rows = _within(row_step, duration, begin, end)
        frames = _within(frame_step, duration, begin, end)
        frames = frames[frames >= settle]
        here = (np.rint(extra / _SAME_TIME) >= begin) & (np.rint(extra / _SAME_TIME) < end)
        times = np.concatenate([rows, frames, extra[here]])
        what = np.concatenate(
            [np.repeat(np.array([_ROW, _FRAME], np.int32), [len(rows), len(frames)]), kinds[here]]
        )
        # Of times that are one the first is taken.
        _, first, place = np.unique(
            np.rint(times / _SAME_TIME), return_index=True, return_inverse=True
        )
        joined = np.zeros(len(first), np.int32)
        np.bitwise_or.at(joined, place, what)
        if end == _NEVER:
            yield np.append(times[first], np.inf), np.append(joined, np.int32(0))
        elif len(first):
            yield times[first], joined


def _within(step: float, duration: float, begin: int, end: int) -> Array:
    """What :func:`grid` has from ``begin`` until before ``end``, multiples of _SAME_TIME."""
    count = int(duration / step * (1 + 1e-12)) + 1
    # One more at either side, and then those that rounding puts there.
    low = max(0, int(begin * _SAME_TIME / step) - 1)
    high = min(count, int(end * _SAME_TIME / step) + 2)
    times = step * np.arange(low, high, dtype=np.float64)
    place = np.rint(times / _SAME_TIME)
    return times[(place >= begin) & (place < end)]
