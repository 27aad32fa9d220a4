"""The structures and functions of ``loop.h``, which says what they hold."""

import ctypes
from collections.abc import Callable
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_void_p
from functools import cache
from typing import Any
from weakref import WeakMethod

from cosim.drive.pieces import Piece
from cosim.toolchain.libraries import library

CALLBACK = ctypes.CFUNCTYPE(None)
_DOUBLES, _INTEGERS, _PLACES = POINTER(c_double), POINTER(c_int32), POINTER(ctypes.c_uint32)


def of(kind: Any, *names: str) -> tuple[tuple[str, Any], ...]:
    """Fields of one kind."""
    return tuple((name, kind) for name in names)


class Fmu(Structure):
    """One instance of an FMU, bound to its version of FMI."""

    _fields_ = (
        *of(c_void_p, "instance", "set_reals", "do_step", "get_reals", "get_integers"),
        *of(c_void_p, "set", "step", "get", "get_whole"),
        *(("status", c_int32), ("failed", c_void_p), ("time", c_double), ("steps", c_int64)),
        ("goes_back", c_int64),
    )


class Schedule(Structure):
    """A quantity over time that is an input of its own."""

    _fields_ = (*of(c_void_p, "times", "values"), ("n", c_int64))


class RecorderState(Structure):
    """``Recorder``."""

    _fields_ = (
        ("fmu", POINTER(Fmu)),
        *(("input_places", _PLACES), ("ports", c_int64), ("schedule", POINTER(Schedule))),
        *(("step_places", _PLACES), ("step_outputs", c_int64)),
        *of(_PLACES, "real_places", "whole_places"),
        *of(c_int64, "reals", "wholes"),
        *of(_PLACES, "total_places", "counter_places"),
        *of(c_int64, "totals", "counters"),
        *of(_DOUBLES, "inputs", "outputs"),
        ("settle", c_double),
        *of(c_void_p, "times", "what"),
        *of(c_int64, "n_times", "next"),
        *of(c_void_p, "rows", "frames"),
        *of(c_int64, "n_rows", "n_frames", "z_surface"),
        *(("totals_at_settle", _DOUBLES), ("counters_at_settle", _INTEGERS)),
        ("extremes", _DOUBLES),
        *of(c_double, "began", "holds_until"),
        ("inside", c_int64),
        *(("plan", CALLBACK), ("stopped", c_int64)),
    )


class Segment(Structure):
    """What the circuit knows of the mechanics between two macro points."""

    _fields_ = (
        *(("origin", c_double), ("c", c_double * 3)),
        *of(c_double, "gain", "end", "start", "charge"),
    )


class LeadState(Structure):
    """``Lead``."""

    _fields_ = (
        *(("recorder", POINTER(RecorderState)), ("macro_point", c_void_p)),
        *(("segment", Segment), ("replay", c_void_p), ("pieces", POINTER(Piece))),
        *of(c_int64, "n_pieces", "piece"),
        *of(c_double, "gain", "v_offset", "count", "after_jump", "fineness"),
        *of(c_double, "time_constant", "range", "answer_step", "limited_step", "near_step"),
        *of(c_double, "restart_step", "max_step", "output_high", "output_low", "output"),
        *of(c_double, "emf_change", "answered"),
        *of(c_double, "time", "current", "carried", "emf", "given", "owed", "flux_at_start"),
        *of(c_double, "impact", "jump"),
        ("at_jump", c_int64),
        *of(c_double, "told", "sent"),
        ("places", POINTER(c_int64)),
        *of(c_int64, "n_saved", "swing", "motional"),
        ("log", c_void_p),
        *of(c_int64, "n_log", "log_rows", "logged", "attempts", "quiet", "status", "stopped"),
        *(("source", ctypes.c_char * 64), ("names", ctypes.c_char * 64 * 5)),
        *of(CALLBACK, "refill", "attend"),
    )


GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE, NO_AGREEMENT = range(5)
"""Values of ``LeadState.status`` and ``PortsState.status``."""

_FUNCTIONS = {
    "fmu_bind": (None, (c_void_p, ctypes.c_int)),
    "recorder_begin": (ctypes.c_int, (c_void_p,)),
    "recorder_follow": (c_int64, (c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_int64)),
    "recorder_exchange": (ctypes.c_int, (c_void_p, *[c_double] * 4)),
    "lead_begin": (None, (c_void_p,)),
    "macro_point_step_locked": (None, (c_void_p,)),
    "lead_finish": (None, (c_void_p,)),
    "ports_begin": (None, (c_void_p,)),
    "ports_finish": (None, (c_void_p,)),
    "loop_size": (c_int64, (ctypes.c_int,)),
}


def callback(act: Callable[[], None], fail: Callable[[BaseException], None]) -> Any:
    """The method ``act`` as C can call it; the method ``fail`` is told what it raises, since an
    exception cannot pass through C.

    Neither's object is kept alive: what holds the structure that holds this would hold itself, and
    its blocks, until Python looks for circles.
    """
    weak_act, weak_fail = WeakMethod(act), WeakMethod(fail)

    def called() -> None:
        try:
            weak_act()()  # pyright: ignore[reportOptionalCall]
        except BaseException as failure:
            weak_fail()(failure)  # pyright: ignore[reportOptionalCall]

    return CALLBACK(called)


@cache
def loop() -> ctypes.CDLL:
    """The compiled loop."""
    found = library("loop")
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def address(name: str) -> int:
    """Where a function of the compiled loop lies."""
    return ctypes.cast(getattr(loop(), name), c_void_p).value or 0
