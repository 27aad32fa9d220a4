"""Moves the mechanics over an interval of time and writes down what was asked for.

Rows of the waveforms, frames of the camera and the end of settling are communication points of
their own: what stands in a row is a state of the mechanics, never an interpolation.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cosim.mechanics import SAMPLE_OUTPUTS, Mechanics
from cosim.published import FRAME_RATE
from cosim.scene import Scene

Array = npt.NDArray[np.float64]

_SAME_TIME = 1e-12  # s; communication points closer than this are one
Z_SURFACE = SAMPLE_OUTPUTS.index("z_surface")


class Recorder:
    """The waveforms of the mechanics, filled as ``advance`` is called.

    ``time`` are the times of the rows (s), ``rows`` their values (a column for each of the
    mechanics' ``columns``), ``frames`` the surface's height (m) at each frame of the camera after
    settling, ``extremes`` the largest and smallest acceleration (m/s²), velocity (m/s) and height
    (m) of the surface after it, and of the coil's current (A) where the mechanics have the source.
    """

    def __init__(
        self, scene: Scene, mechanics: Mechanics, progress: Callable[[float], None]
    ) -> None:
        run = scene.run
        self.mechanics = mechanics
        self._settle = run.settle
        self._progress = progress
        self.time = grid(run.output_step, run.duration)
        self.rows = np.empty((len(self.time) + 1, len(mechanics.columns)))[:-1]
        frame_times = grid(1.0 / FRAME_RATE, run.duration)
        frame_times = frame_times[frame_times >= run.settle]
        self.frames = np.empty(len(frame_times))
        self.n_rows = 0
        self._n_frames = 0
        grip = mechanics.normal_force
        corners = [t for t in grip.corners if 0.0 < t < run.duration] if grip else []
        self.agenda = _agenda(self.time, frame_times, run.settle, [*corners, run.duration])
        """Times (s) at which something is to be written down, and what; an endless one last."""
        self.extremes = [-np.inf, np.inf] * (4 if mechanics.has_source else 3)
        self.at_settle: dict[str, float] = {}
        """Totals of the mechanics when settling ends."""
        self._begin()

    def _begin(self) -> None:
        """Write down what the agenda has for time 0."""
        times, what = self.agenda
        self._times, self._what, self._next = times.tolist(), what.tolist(), 0
        self._visit()

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
        times = self._times
        while times[self._next] < time - _SAME_TIME:
            stop = times[self._next]
            self._step(stop, value + slope * (mechanics.time - start), slope)
            self._visit()
        self._step(time, value + slope * (mechanics.time - start), slope)
        if times[self._next] <= time + _SAME_TIME:
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
                self.rows[self.n_rows] = sample
                self.n_rows += 1
            if what & _FRAME:
                self.frames[self._n_frames] = sample[Z_SURFACE]
                self._n_frames += 1
        self._progress(self.mechanics.time)


_ROW, _FRAME, _SETTLED = 1, 2, 4


def grid(step: float, end: float) -> Array:
    """0, step, 2 step ... up to ``end``, which counts as reached within rounding."""
    return step * np.arange(int(end / step * (1 + 1e-12)) + 1, dtype=np.float64)


def _agenda(
    rows: Array, frames: Array, settle: float, stops: list[float]
) -> tuple[Array, npt.NDArray[np.int32]]:
    groups = ((rows, _ROW), (frames, _FRAME), ([settle], _SETTLED), (stops, 0))
    times = np.concatenate([group for group, _ in groups])
    what = np.repeat([kind for _, kind in groups], [len(group) for group, _ in groups])
    # Of times that are one the first is taken.
    _, first, place = np.unique(np.rint(times / _SAME_TIME), return_index=True, return_inverse=True)
    joined = np.zeros(len(first) + 1, np.int32)
    np.bitwise_or.at(joined, place, what.astype(np.int32))
    return np.append(times[first], np.inf), joined
