"""The compiled twin of the recorder: the FMU stepped and sampled without Python in between.

`native/recorder.c` calls the FMU's own functions at their addresses and does the arithmetic of
:mod:`cosim.coupling.loop.recorder` in the same order, so the numbers are the same bits. The
structures here have the fields of `native/coupled.h`.
"""

import ctypes
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_double, c_int32, c_int64, c_uint, c_void_p
from functools import cache

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop.recorder import Z_SURFACE, Recorder
from cosim.mechanics.stickslip import COUNTERS, Mechanics
from cosim.scene import Scene
from cosim.toolchain import libraries
from cosim.toolchain.interrupts import caught_signals

Array = npt.NDArray[np.float64]

BLOCK = 4096
"""Steps between two looks at what Python has to do, about ten milliseconds."""


_CALLBACK = CFUNCTYPE(None)


class Fmu(ctypes.Structure):
    """``Fmu`` of coupled.h."""

    _fields_ = (
        ("version", c_int32),
        ("status", c_int32),
        *((name, c_void_p) for name in ("instance", "set_reals", "do_step", "get_reals")),
        *((name, c_void_p) for name in ("get_integers", "failed")),
        *((name, POINTER(c_uint)) for name in ("input_places", "step_places", "sample_places")),
        *((name, POINTER(c_uint)) for name in ("sticking_place", "total_places")),
        ("counter_places", POINTER(c_uint)),
        *((name, c_int64) for name in ("inputs", "step_outputs_count", "samples", "totals")),
        ("counters", c_int64),
        ("step_outputs", POINTER(c_double)),
        ("time", c_double),
        ("steps", c_int64),
    )


class State(ctypes.Structure):
    """``Recorder`` of coupled.h."""

    _fields_ = (
        ("fmu", POINTER(Fmu)),
        ("settle", c_double),
        ("times", c_void_p),
        ("what", c_void_p),
        ("n_times", c_int64),
        ("next", c_int64),
        ("rows", c_void_p),
        ("frames", c_void_p),
        ("n_rows", c_int64),
        ("n_frames", c_int64),
        ("z_surface", c_int64),
        ("totals_at_settle", POINTER(c_double)),
        ("counters_at_settle", POINTER(c_int32)),
        ("extremes", c_double * 8),
        ("began", c_double),
        ("inside", c_int64),
        ("plan", _CALLBACK),
        ("stopped", c_int64),
    )


_POINTER = c_void_p
_FUNCTIONS = {
    "recorder_begin": (ctypes.c_int, (_POINTER,)),
    "recorder_follow": (c_int64, (_POINTER, c_int64, _POINTER, _POINTER, _POINTER, c_int64)),
    "coupled_hand_on": (None, (_POINTER,)),
    "coupled_lead": (None, (_POINTER,)),
    "coupled_finish": (None, (_POINTER,)),
    "coupled_size": (c_int64, (ctypes.c_int,)),
}


@cache
def library() -> ctypes.CDLL:
    """The compiled library."""
    functions = libraries.library("loop")
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(functions, name)
        function.restype, function.argtypes = result, arguments
    return functions


class CompiledRecorder(Recorder):
    """A recorder whose steps are compiled; ``finish`` brings what it holds up to date."""

    def __init__(
        self, scene: Scene, mechanics: Mechanics, progress: Callable[[float], None]
    ) -> None:
        self._library = library()
        self._told = -1.0
        self._fault: BaseException | None = None
        self._totals = (c_double * len(mechanics.total_names))()
        self._counters = (c_int32 * len(COUNTERS))()
        super().__init__(scene, mechanics, progress)

    def _begin(self) -> None:
        self.fmu = Fmu(**self.mechanics.shared())
        self.state = State(
            fmu=ctypes.pointer(self.fmu),
            settle=self._settle,
            rows=self._new_rows.ctypes.data,
            frames=self._new_frames.ctypes.data,
            z_surface=Z_SURFACE,
            totals_at_settle=self._totals,
            counters_at_settle=self._counters,
            extremes=(c_double * 8)(*self.extremes),
            plan=_CALLBACK(self._planned),
        )
        self._reached = 0.0
        self._plan()
        with caught_signals(self._stop):
            if not self._library.recorder_begin(ctypes.byref(self.state)) or self._fault:
                raise self.failure()
        self.tell()

    def _plan(self) -> None:
        self._take()
        if self.state.next:
            self._reached = float(self._agenda[0][self.state.next - 1])
        self._agenda = next(self._agendas)
        times, what = self._agenda
        state = self.state
        state.times, state.what = times.ctypes.data, what.ctypes.data
        state.n_times, state.next = len(times), 0

    def _planned(self) -> None:
        # An exception cannot pass through C.
        try:
            self._plan()
        except BaseException as fault:
            self._stop(fault)

    def _stop(self, fault: BaseException) -> None:
        self._fault = fault
        self.state.stopped = 1

    def _take(self) -> None:
        self._n_rows, self._n_frames = self.state.n_rows, self.state.n_frames
        super()._take()
        self.state.n_rows = self.state.n_frames = 0

    def advance(self, time: float, value: float, value_end: float) -> None:
        self.follow(*(np.array([number]) for number in (time, value, value_end)))

    def follow(self, edges: Array, start: Array, end: Array) -> None:
        arrays = [np.ascontiguousarray(values) for values in (edges, start, end)]
        done = 0
        with caught_signals(self._stop):
            while done < len(edges):
                taken = self._library.recorder_follow(
                    ctypes.byref(self.state),
                    len(edges) - done,
                    *(values.ctypes.data + 8 * done for values in arrays),
                    BLOCK,
                )
                if taken < 0:
                    raise self.failure()
                done += taken
                self.tell()
                if self._fault:
                    raise self._fault
        self.finish()

    def tell(self) -> None:
        """Tell how far the agenda has been worked off, where that is news."""
        done = self.state.next
        reached = float(self._agenda[0][done - 1]) if done else self._reached
        if reached > self._told:
            self._told = reached
            self._progress(reached)

    def finish(self) -> None:
        """Put what the compiled steps have done where the plain recorder has it."""
        self.extremes = self.state.extremes[: len(self.extremes)]
        self.mechanics.time, self.mechanics.steps = self.fmu.time, self.fmu.steps
        totals = (*self._totals, *self._counters)
        self.at_settle = dict(zip((*self.mechanics.total_names, *COUNTERS), totals, strict=True))

    def failure(self) -> BaseException:
        """What to raise for the call of the FMU that has failed, or what failed in Python."""
        if self._fault is not None:
            return self._fault
        fmu = self.fmu
        self.mechanics.time = fmu.time
        calls = ("set_reals", "do_step", "get_reals", "get_integers")
        name = next((name for name in calls if getattr(fmu, name) == fmu.failed), "?")
        return self.mechanics.failed(RuntimeError(f"{name} failed with status {fmu.status}"))
