"""Ctrl-C, and what ends a command as it does: SIGTERM, and SIGHUP of a terminal that closes."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

Handler = Any
"""What the module signal takes and gives for one."""

SIGNALS = [each for each in signal.Signals if each.name in ("SIGINT", "SIGTERM", "SIGHUP")]


GRACE = 30
"""s; a command that has not ended so long after a signal is ended by the system."""

AGAIN = 0.02
"""s after which a signal is raised again that was lost."""


@contextmanager
def ended_alike() -> Iterator[None]:
    """Within this context all of SIGNALS raise KeyboardInterrupt, but for those that whoever
    started this process has had ignored, as nohup does.

    Python ignores what is raised where it frees an object, so a signal that strikes there is raised
    again. Where memory has run out it may lose one all the same, and what tidies up may hang: GRACE
    later the system ends the process.
    """
    alarm = getattr(signal, "alarm", lambda seconds: None)
    armed = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal armed
        armed = True
        alarm(GRACE)
        raise KeyboardInterrupt

    def ignored(what: "sys.UnraisableHookArgs") -> None:
        if isinstance(what.exc_value, KeyboardInterrupt):  # here it would be ignored once more
            threading.Timer(AGAIN, _strike).start()
        else:
            told(what)

    told, sys.unraisablehook = sys.unraisablehook, ignored
    known = (signal.SIG_DFL, signal.default_int_handler)
    try:
        with _handled(lambda before: interrupt if before in known else None):
            yield
    finally:
        sys.unraisablehook = told
        if armed:
            alarm(0)


def _strike() -> None:
    """Send SIGINT to the main thread, whatever it waits for; Windows has no such signal."""
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


@contextmanager
def caught_signals(fail: Callable[[BaseException], None]) -> Iterator[None]:
    """Hand what a signal raises to ``fail`` while compiled code runs that calls back into Python
    (raised outside a callback's try, C would swallow it), or where nothing may be left half done.
    """

    def caught(before: Handler) -> Handler | None:
        if not callable(before):
            return None

        def interrupted(number: int, frame: FrameType | None) -> None:
            try:
                before(number, frame)
            except BaseException as failure:
                fail(failure)

        return interrupted

    with _handled(caught):
        yield


@contextmanager
def deferred() -> Iterator[None]:
    """Let what a signal raises wait for the end of this context: a module of compiled code that was
    interrupted while it was loaded cannot be loaded again."""
    held: list[BaseException] = []
    with caught_signals(held.append):
        yield
    if held:
        raise held[0]


@contextmanager
def _handled(choose: Callable[[Handler], Handler | None]) -> Iterator[None]:
    """Have each signal handled as ``choose`` says, knowing how it is now; None leaves that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in SIGNALS}
    chosen = {number: choose(handler) for number, handler in before.items()}
    changed = {number: handler for number, handler in chosen.items() if handler is not None}
    for number, handler in changed.items():
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in reversed(changed):  # an interrupt that raises again finds the rest restored
            signal.signal(number, before[number])
