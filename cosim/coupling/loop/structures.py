"""The structures and functions of ``loop.h``, which says what they hold."""

from collections.abc import Callable, Sequence
from ctypes import CDLL, c_void_p, cast
from typing import Any
from weakref import WeakMethod

from cosim.toolchain.libraries import CALLBACK as CALLBACK
from cosim.toolchain.libraries import library, structures

Fmu, Schedule, RecorderState, LeadState = (
    structures("loop")[name] for name in ("Fmu", "Schedule", "Recorder", "Lead")
)
Group, Origin, Source, Feed, StrangerState, Pulse, Through, Back, Slope, PortsState = map(
    structures("loop").__getitem__,
    ("Group", "Origin", "Source", "Feed", "Stranger", "Pulse", "Through", "Back", "Slope", "Ports"),
)

PROBE, OUTPUT, DRIVE = range(3)
"""Kinds of an Origin."""

GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE, NO_AGREEMENT = range(5)
"""Values of ``LeadState.status`` and ``PortsState.status``."""


def callback(act: Callable[[], None], fail: Callable[[BaseException], None]) -> Any:
    """The bound method ``act`` as a C callback. Its exceptions go to the bound method ``fail``,
    since they cannot pass through C.

    References to both are weak: an object that holds the structure with this callback would else
    be in a reference cycle, and keep its memory until Python's collector runs.
    """
    weak_act, weak_fail = WeakMethod(act), WeakMethod(fail)

    def called() -> None:
        try:
            weak_act()()  # pyright: ignore[reportOptionalCall]
        except BaseException as failure:
            weak_fail()(failure)  # pyright: ignore[reportOptionalCall]

    return CALLBACK(called)


def loop() -> CDLL:
    """The compiled loop."""
    return library("loop")


def address(name: str) -> int:
    """Where a function of the compiled loop lies."""
    return cast(getattr(loop(), name), c_void_p).value or 0


def array(kind: Any, values: Sequence[Any] = (), length: int = 0) -> Any:
    """A C array of values, or of zeros; it has one element at least, as C knows no empty array."""
    return (kind * max(len(values), length, 1))(*values)
