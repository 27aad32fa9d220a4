"""Advances the mechanics and records what the agenda asks for; the loop is in ``recorder.c``."""

from collections.abc import Callable
from contextlib import nullcontext
from ctypes import addressof, byref, c_double, c_int32
from functools import cached_property, partial

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop import agenda
from cosim.coupling.loop.structures import Fmu, RecorderState, Schedule, callback, loop
from cosim.files.spill import BLOCK, Tape
from cosim.mechanics.pace import Pace
from cosim.mechanics.stickslip import COUNTERS, Mechanics
from cosim.scene import Scene
from cosim.toolchain.interrupts import caught_signals

STEPS = 1 << 15
"""Steps of the compiled loop between two returns to Python, about 10 ms; fewer at first, when the
time of a step is still unknown."""

_CALLS = ("set_reals", "do_step", "get_reals", "get_integers")


class Recorder:
    """The waveforms of the mechanics, filled by calls of ``follow`` or ``exchange``.

    ``progress`` is called now and then with the time (s) of the last record.
    """

    def __init__(
        self, scene: Scene, mechanics: Mechanics, progress: Callable[[float], None]
    ) -> None:
        run = scene.run
        self.mechanics = mechanics
        self._library = loop()
        self._progress = progress
        self.pace = Pace(scene, mechanics)
        self.at_once = 1
        """Steps of the next call of the compiled loop."""
        self._told = -1.0
        self._reached = 0.0
        self._fault: BaseException | None = None
        self._width = width = len(mechanics.columns)
        self._step_of_rows = run.output_step
        rows = agenda.count(run.output_step, run.duration)
        self._rows, self._time = Tape(width, rows), Tape(1, rows)
        self._frames, self._parts = Tape(1), Tape(1)
        # Buffers that the compiled loop fills, and that are then appended to the tapes.
        self._new_rows = np.empty((0, width))
        self._new_frames, self._new_parts = np.empty(0), np.empty(0)
        self._totals = (c_double * len(mechanics.total_names))()
        self._counters = (c_int32 * len(COUNTERS))()
        self._inputs = (c_double * len(mechanics.places["held_inputs"]))()
        extremes = len(mechanics.step_outputs) - 4
        self.extremes = (c_double * extremes)(*[-np.inf, np.inf] * (extremes // 2))
        """Largest and smallest values after settling, in pairs: acceleration (m/s²), velocity (m/s)
        and height (m) of the surface, and current of the coil (A) where the mechanics have the
        source."""
        self._fmu = Fmu(**mechanics.instance.addresses)
        self._library.fmu_bind(byref(self._fmu), mechanics.instance.version)
        grip = mechanics.normal_force
        corners = [t for t in grip.corners if 0.0 < t < run.duration] if grip else []
        self._agendas = agenda.kept(
            *(run.output_step, run.duration, run.settle, (*corners, run.duration), run.shutter),
            run.average == "slope",
        )
        self._corners = np.array([grip.corners, grip.forces] if grip else [])
        self._schedule = None
        if grip:
            ends = (row.ctypes.data for row in self._corners)
            self._schedule = Schedule(*ends, len(grip.corners))
        places = {role: addressof(of) for role, of in mechanics.places.items()}
        self.state = RecorderState(
            fmu=addressof(self._fmu),
            input_places=places["held_inputs"],
            ports=len(mechanics.ports),
            schedule=self._schedule and addressof(self._schedule),
            step_places=places["step_outputs"],
            step_outputs=len(mechanics.step_outputs),
            real_places=places["reals"],
            whole_places=places["wholes"],
            reals=len(mechanics.places["reals"]),
            wholes=len(mechanics.places["wholes"]),
            total_places=places["totals"],
            counter_places=places["counters"],
            totals=len(self._totals),
            counters=len(self._counters),
            inputs=addressof(self._inputs),
            outputs=addressof(mechanics.step_outputs),
            settle=run.settle,
            z_surface=mechanics.columns.index("z_surface"),
            z_part=mechanics.columns.index("z_part"),
            totals_at_settle=addressof(self._totals),
            counters_at_settle=addressof(self._counters),
            extremes=addressof(self.extremes),
            plan=callback(self._plan, self._stop),
        )
        self._state = addressof(self.state)
        self.exchange: Callable[[float, float, float, float], int] = partial(
            self._library.recorder_exchange, self._state
        )
        """Advance to a time (s), the one port's input (A or V) going linearly between two values,
        and then set the last argument, which the step need not have ended with; 0 where it failed:
        see ``failure``."""
        self._plan()
        # The loop calls Python, where a signal can interrupt it, only to plan a further part.
        with caught_signals(self._stop) if self.state.n_times == 1 else nullcontext():
            if not self._library.recorder_begin(self._state) or self._fault:
                raise self.failure()
        self._tell_time()

    def follow(self, edges: Array, start: Array, end: Array) -> None:
        """Advance through intervals that end at ``edges`` (n, s); in each the inputs (A or V) go
        linearly from ``start`` to ``end`` (both n × ports).

        Raises SimulationFailed with the FMU's sentence.
        """
        ports = len(self.mechanics.ports)
        edges, start, end = (np.ascontiguousarray(values) for values in (edges, start, end))
        at = [values.ctypes.data for values in (edges, start, end)]
        done = 0
        with caught_signals(self._stop):
            while done < len(edges):
                taken = self._library.recorder_follow(
                    self._state,
                    len(edges) - done,
                    at[0] + 8 * done,
                    at[1] + 8 * ports * done,
                    at[2] + 8 * ports * done,
                    self.at_once,
                )
                if taken < 0:
                    raise self.failure()
                done += taken
                self.at_once = min(8 * self.at_once, STEPS)
                self.tell()
                if self._fault:
                    raise self._fault

    def tell(self) -> None:
        """Report progress. Raises SimulationFailed where the run is too slow ever to end."""
        self.pace.judge(self._fmu.time, self.steps)
        self._tell_time()

    def _tell_time(self) -> None:
        done = self.state.next
        reached = float(self._agenda.times[done - 1]) if done else self._reached
        self._told = max(self._told, reached)
        self._progress(self._told)

    def failure(self) -> BaseException:
        """The exception to raise: that from Python, if any, else for the FMU's failed call."""
        if self._fault is not None:
            return self._fault
        fmu = self._fmu
        name = next((name for name in _CALLS if getattr(fmu, name) == fmu.failed), "?")
        error = RuntimeError(f"{name} failed with status {fmu.status}")
        return self.mechanics.failed(error, fmu.time)

    def _stop(self, fault: BaseException) -> None:
        self._fault = fault
        self.state.stopped = 1

    def _plan(self) -> None:
        """Append the buffers to the tapes, and take up the next part of the agenda."""
        self._take()
        state = self.state
        if state.next:
            self._reached = float(self._agenda.times[state.next - 1])
        self._agenda = next(self._agendas)
        entries = len(self._agenda.times)
        if len(self._new_rows) <= entries:  # a frame's sample goes behind the last row
            self._new_rows = np.empty((entries + 1, self._width))
            self._new_frames, self._new_parts = np.empty((2, entries + 1))
            state.rows = self._new_rows.ctypes.data
            state.frames, state.parts = self._new_frames.ctypes.data, self._new_parts.ctypes.data
        state.times, state.what = self._agenda.addresses
        state.n_times, state.next = entries, 0

    def _take(self) -> None:
        state = self.state
        self._rows.append(self._new_rows[: state.n_rows])
        self._frames.append(self._new_frames[: state.n_frames])
        self._parts.append(self._new_parts[: state.n_parts])
        state.n_rows = state.n_frames = state.n_parts = 0

    @property
    def steps(self) -> int:
        """Steps of the FMU so far."""
        return self._fmu.steps

    @property
    def at_settle(self) -> dict[str, float]:
        """Totals of the mechanics when settling ended."""
        names = (*self.mechanics.total_names, *COUNTERS)
        return dict(zip(names, (*self._totals, *self._counters), strict=True))

    @cached_property
    def at_end(self) -> dict[str, float]:
        """Totals of the mechanics at the first access, which must be the end of the run."""
        return self.mechanics.totals()

    @property
    def rows(self) -> Array:
        """A row for each time, a column for each of the mechanics' ``columns``, SI."""
        self._take()
        return self._rows.array()

    @property
    def frames(self) -> Array:
        """The surface's height (m) at the instants of each frame of the camera after settling."""
        self._take()
        return self._frames.column()

    @property
    def parts(self) -> Array:
        """The part's height (m) at the agenda's ``part_times``, where they are asked for."""
        self._take()
        return self._parts.column()

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
