"""Ctrl-C while compiled code runs that calls back into Python."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def caught_signals(fail: Callable[[BaseException], None]) -> Iterator[None]:
    """Hand what Ctrl-C raises to ``fail``: raised outside a callback's try, C would swallow it."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def interrupted(number: int, frame: FrameType | None) -> None:
        try:
            before(number, frame)
        except BaseException as failure:
            fail(failure)

    signal.signal(signal.SIGINT, interrupted)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
