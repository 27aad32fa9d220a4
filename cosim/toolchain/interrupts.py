"""Handling of Ctrl-C, and of SIGTERM and SIGHUP (a terminal that closes), which act alike."""

import _thread
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

Handler = Any
"""A signal handler, as the module signal takes and returns it."""

SIGNALS = [each for each in signal.Signals if each.name in ("SIGINT", "SIGTERM", "SIGHUP")]


GRACE = 30
"""s after a signal until the system ends a command that is still there."""

AGAIN = 1.0
"""s after which a signal is raised again, unless its exception is on its way."""


@contextmanager
def ended_alike() -> Iterator[None]:
    """Within this context all of SIGNALS raise KeyboardInterrupt, except those that were set to be
    ignored when this process started, as nohup does.

    Libraries may swallow it: Python ignores exceptions raised while it frees an object, compiled
    code those in functions that cannot raise (Cython first prints them) and in questions such as
    hasattr. So it is raised again until some code handles it. Without free memory a signal may
    still be lost, or the cleanup hang: after GRACE the system ends the process.
    """
    alarm = getattr(signal, "alarm", lambda seconds: None)
    struck = over = ours = False
    striking = threading.Lock()

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal struck, ours
        repeated, ours = ours, False
        if repeated and (over or _on_its_way(sys.exc_info()[1])):
            return
        if not (struck or over):
            struck = True
            alarm(GRACE)
            with suppress(RuntimeError):  # no thread can be started
                # A Thread would wait for a lock that the code interrupted here may hold.
                _thread.start_new_thread(repeat, ())
        raise KeyboardInterrupt

    def repeat() -> None:
        nonlocal ours
        while not over:
            time.sleep(AGAIN)
            with striking:
                if not over:
                    ours = True
                    _strike()

    def ignored(what: "sys.UnraisableHookArgs") -> None:
        if not isinstance(what.exc_value, KeyboardInterrupt):
            hook(what)

    def printed(kind: type[BaseException], *rest: Any) -> None:
        if not issubclass(kind, KeyboardInterrupt):
            show(kind, *rest)

    hook, sys.unraisablehook = sys.unraisablehook, ignored
    show, sys.excepthook = sys.excepthook, printed
    known = (signal.SIG_DFL, signal.default_int_handler)
    try:
        with _handled(lambda before: interrupt if before in known else None):
            try:
                yield
            except BaseException as failure:
                # Some libraries turn it into another failure, of which the user need not hear.
                if struck and not isinstance(failure, KeyboardInterrupt):
                    raise KeyboardInterrupt from failure
                raise
            finally:
                over = True
                if struck:
                    alarm(0)
                with striking:  # from here on no signal comes that the former handlers would get
                    pass
    finally:
        sys.unraisablehook, sys.excepthook = hook, show


def _on_its_way(handled: BaseException | None) -> bool:
    """Whether KeyboardInterrupt is handled, be it that code in its handler handles another one."""
    while handled is not None and not isinstance(handled, KeyboardInterrupt):
        handled = handled.__context__
    return handled is not None


def _strike() -> None:
    """Send SIGINT to the main thread, to interrupt any wait; on Windows only set the interrupt."""
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


@contextmanager
def caught_signals(fail: Callable[[BaseException], None]) -> Iterator[None]:
    """Pass exceptions of signal handlers to ``fail`` instead of raising them: while compiled code
    calls back into Python, where C would swallow them, or where nothing may be left half done."""

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
    """Raise exceptions of signal handlers only at the end of this context: a compiled module whose
    loading was interrupted cannot be loaded again."""
    held: list[BaseException] = []
    with caught_signals(held.append):
        yield
    if held:
        raise held[0]


@contextmanager
def _handled(choose: Callable[[Handler], Handler | None]) -> Iterator[None]:
    """Replace each signal's handler by what ``choose`` makes of it; None leaves it."""
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
