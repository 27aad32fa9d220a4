"""The structures of ``loop.h`` for ports, with the same fields in the same order."""

from ctypes import POINTER, Structure, c_char, c_char_p, c_double, c_int64, c_void_p

from cosim.coupling.loop.structures import CALLBACK, Fmu, of
from cosim.drive.pieces import Piece

PROBE, OUTPUT, DRIVE = range(3)
"""Kinds of an Origin."""


class Group(Structure):
    """Variables of one type, set or read in one call."""

    _fields_ = (
        *of(c_void_p, "call", "places"),
        *of(c_int64, "n", "size", "kind"),
        *of(c_void_p, "values", "raw"),
    )


class Origin(Structure):
    """Where a port comes from."""

    _fields_ = (
        *of(c_int64, "kind", "place", "slope", "slope_place"),
        *of(c_double, "scale", "offset"),
    )


class Source(Structure):
    """A source of the netlist that a port feeds."""

    _fields_ = (
        ("name", c_char * 64),
        ("origin", Origin),
        *of(c_double, "value", "rate", "line", "through_rate", "plain", "correction", "owed"),
        *of(c_double, "guess", "off", "response", "largest"),
    )


class Feed(Structure):
    """An input of an FMU."""

    _fields_ = (("origin", Origin), ("feed", c_int64), *of(c_void_p, "input", "slope"))


class StrangerState(Structure):
    """``Stranger``."""

    _fields_ = (
        ("fmu", POINTER(Fmu)),
        *of(c_void_p, "inputs", "outputs"),
        *of(c_int64, "n_inputs", "n_outputs"),
        *(("feeds", c_void_p), ("n_feeds", c_int64)),
        *of(c_void_p, "set_slopes", "get_slopes", "input_slopes", "output_slopes"),
        *of(c_int64, "n_input_slopes", "n_output_slopes"),
        *of(c_void_p, "input_rates", "output_rates", "save", "restore", "state", "row"),
        *of(c_int64, "width", "moved"),
    )


class Pulse(Structure):
    """The edges of a PULSE."""

    _fields_ = (
        *of(c_double, "delay", "period"),
        *(("corners", c_double * 4), ("n", c_int64), ("cycle", c_double), ("corner", c_int64)),
        *of(c_double, "previous", "announced"),
    )


class Through(Structure):
    """What the circuit itself carries of an FMU's feedthrough."""

    _fields_ = (
        *of(c_int64, "source", "probe", "fmu", "output"),
        *(("input", c_void_p), *of(c_double, "scale", "gain")),
    )


class PortsState(Structure):
    """``Ports``."""

    _fields_ = (
        *(("fmus", POINTER(StrangerState)), ("n_fmus", c_int64)),
        *(("sources", c_void_p), ("n_sources", c_int64)),
        *(*of(c_void_p, "outputs", "before", "rates"), ("n_outputs", c_int64)),
        *of(c_void_p, "now", "last", "start", "charges", "places"),
        ("n_saved", c_int64),
        *(("pieces", POINTER(Piece)), *of(c_int64, "n_pieces", "piece")),
        *(("jump", c_double), ("driven", c_int64)),
        *(("pulses", c_void_p), ("n_pulses", c_int64)),
        *(("throughs", c_void_p), *of(c_int64, "n_throughs", "learn")),
        *of(c_double, "macro_step", "duration", "after_jump", "jumped", "time", "origin", "end"),
        *of(c_double, "told", "sent"),
        *of(c_int64, "repeats", "stepped", "tries", "met", "met_before"),
        *(("tolerance", c_double), ("asked", POINTER(c_char_p)), ("n_probed", c_int64)),
        *of(c_void_p, "command", "ask", "plot", "announce"),
        ("plot_name", c_char * 64),
        *of(c_void_p, "log", "points"),
        *of(c_int64, "n_log", "n_points", "log_rows"),
        *of(c_int64, "logged", "attempts", "redone", "exchanged", "quiet"),
        *of(c_int64, "status", "stopped", "failed"),
        ("source", c_char * 64),
        *of(CALLBACK, "refill", "attend"),
    )


STRUCTURES = (Group, Source, Feed, StrangerState, Pulse, Through, PortsState)
"""In the order of ``loop_size``, after those of the loop itself."""
