"""The structures and functions of ``loop.h``, which says what they hold."""

from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Structure,
    c_char,
    c_double,
    c_int,
    c_int32,
    c_int64,
    c_uint32,
    c_void_p,
    cast,
)
from functools import cache

from cosim.drive.pieces import Piece
from cosim.toolchain.libraries import library

CALLBACK = CFUNCTYPE(None)


class Fmu(Structure):
    """One instance of an FMU, bound to its version of FMI."""

    _fields_ = (
        ("instance", c_void_p),
        *((name, c_void_p) for name in ("set_reals", "do_step", "get_reals", "get_integers")),
        *((name, c_void_p) for name in ("set", "step", "get", "get_whole")),
        ("status", c_int32),
        ("failed", c_void_p),
        ("time", c_double),
        ("steps", c_int64),
    )


class Schedule(Structure):
    """A quantity over time that is an input of its own."""

    _fields_ = (("times", c_void_p), ("values", c_void_p), ("n", c_int64))


class RecorderState(Structure):
    """``Recorder``."""

    _fields_ = (
        ("fmu", POINTER(Fmu)),
        ("input_places", POINTER(c_uint32)),
        ("ports", c_int64),
        ("schedule", POINTER(Schedule)),
        ("step_places", POINTER(c_uint32)),
        ("step_outputs", c_int64),
        ("real_places", POINTER(c_uint32)),
        ("whole_places", POINTER(c_uint32)),
        ("reals", c_int64),
        ("wholes", c_int64),
        ("total_places", POINTER(c_uint32)),
        ("counter_places", POINTER(c_uint32)),
        ("totals", c_int64),
        ("counters", c_int64),
        ("inputs", POINTER(c_double)),
        ("outputs", POINTER(c_double)),
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
        ("extremes", POINTER(c_double)),
        ("began", c_double),
        ("inside", c_int64),
        ("plan", CALLBACK),
        ("stopped", c_int64),
    )


class Segment(Structure):
    """What the circuit knows of the mechanics between two macro points."""

    _fields_ = (
        ("origin", c_double),
        ("c", c_double * 3),
        ("gain", c_double),
        ("end", c_double),
        ("start", c_double),
        ("charge", c_double),
    )


class LeadState(Structure):
    """``Lead``."""

    _fields_ = (
        ("recorder", POINTER(RecorderState)),
        ("macro_point", c_void_p),
        ("segment", Segment),
        ("replay", c_void_p),
        ("pieces", POINTER(Piece)),
        ("n_pieces", c_int64),
        ("piece", c_int64),
        ("gain", c_double),
        ("v_offset", c_double),
        ("count", c_double),
        ("after_jump", c_double),
        *((name, c_double) for name in ("time", "current", "carried", "jump")),
        ("at_jump", c_int64),
        ("told", c_double),
        ("sent", c_double),
        ("places", POINTER(c_int64)),
        ("n_saved", c_int64),
        ("motional", c_int64),
        ("log", c_void_p),
        *((name, c_int64) for name in ("n_log", "log_rows", "logged", "attempts", "quiet")),
        ("status", c_int64),
        ("stopped", c_int64),
        ("source", c_char * 64),
        ("refill", CALLBACK),
        ("attend", CALLBACK),
    )


GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE = range(4)
"""Values of ``LeadState.status``."""

_FUNCTIONS = {
    "fmu_bind": (None, (c_void_p, c_int)),
    "recorder_begin": (c_int, (c_void_p,)),
    "recorder_follow": (c_int64, (c_void_p, c_int64, c_void_p, c_void_p, c_void_p, c_int64)),
    "recorder_advance": (c_int, (c_void_p, c_double, c_double, c_double)),
    "recorder_refresh": (c_int, (c_void_p, c_double)),
    "lead_begin": (None, (c_void_p,)),
    "lead_finish": (None, (c_void_p,)),
    "loop_size": (c_int64, (c_int,)),
}


@cache
def loop() -> CDLL:
    """The compiled loop."""
    found = library("loop")
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def address(name: str) -> int:
    """Where a function of the compiled loop lies."""

    return cast(getattr(loop(), name), c_void_p).value or 0
