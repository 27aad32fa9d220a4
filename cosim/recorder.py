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

_SAME_TIME = 1e-12  # s; communication points closer than this are one
_Z_SURFACE = SAMPLE_OUTPUTS.index("z_surface")


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
        self.rows = np.empty((len(self.time), len(mechanics.columns)))
        frame_times = grid(1.0 / FRAME_RATE, run.duration)
        frame_times = frame_times[frame_times >= run.settle]
        self.frames = np.empty(len(frame_times))
        self.n_rows = 0
        self._n_frames = 0
        grip = mechanics.normal_force
        corners = [t for t in grip.corners if 0.0 < t < run.duration] if grip else []
        self._agenda = _agenda(self.time, frame_times, run.settle, [*corners, run.duration])
        self._next = 0
        self.extremes = [-np.inf, np.inf] * (4 if mechanics.has_source else 3)
        self.at_settle: dict[str, float] = {}
        """Totals of the mechanics when settling ends."""
        self._visit()

    def column(self, name: str) -> npt.NDArray[np.float64]:
        """The values of one of the mechanics' ``columns`` in the rows."""
        return self.rows[:, self.mechanics.columns.index(name)]

    def advance(self, time: float, value: float, value_end: float) -> None:
        """Advance to ``time`` (s); the mechanics' input goes linearly between the two, A or V."""
        mechanics = self.mechanics
        start = mechanics.time
        slope = (value_end - value) / (time - start)
        times, _ = self._agenda
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
        what = self._agenda[1][self._next]
        self._next += 1
        if what & _SETTLED:
            self.at_settle = self.mechanics.totals()
        if what & (_ROW | _FRAME):
            sample = self.mechanics.sample()
            if what & _ROW:
                self.rows[self.n_rows] = sample
                self.n_rows += 1
            if what & _FRAME:
                self.frames[self._n_frames] = sample[_Z_SURFACE]
                self._n_frames += 1
        self._progress(self.mechanics.time)


_ROW, _FRAME, _SETTLED = 1, 2, 4


def grid(step: float, end: float) -> npt.NDArray[np.float64]:
    """0, step, 2 step ... up to ``end``, which counts as reached within rounding."""
    return step * np.arange(int(end / step * (1 + 1e-12)) + 1, dtype=np.float64)


def _agenda(
    rows: npt.NDArray[np.float64],
    frames: npt.NDArray[np.float64],
    settle: float,
    stops: list[float],
) -> tuple[list[float], list[int]]:
    """Times at which to stop, and what is to be written down then; an endless one behind them."""
    wanted: dict[int, tuple[float, int]] = {}
    for times, what in ((rows, _ROW), (frames, _FRAME), ((settle,), _SETTLED), (stops, 0)):
        for time in times:
            key = round(float(time) / _SAME_TIME)
            known, before = wanted.get(key, (float(time), 0))
            wanted[key] = (known, before | what)
    ordered = sorted(wanted.values())
    return [time for time, _ in ordered] + [np.inf], [what for _, what in ordered] + [0]
