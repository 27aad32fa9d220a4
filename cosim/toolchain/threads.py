"""Threads of this process, and how many are of use."""

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

Progress = Callable[[float], None]


def processors() -> int:
    """The number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class _Unwanted(Exception):
    """Raised in calls whose result is no longer wanted."""


@contextmanager
def threads(count: int) -> Iterator[tuple[ThreadPoolExecutor, Progress]]:
    """``count`` threads, and a progress for their calls, which ends these with the block."""
    ended = threading.Event()

    def progress(_: float) -> None:
        if ended.is_set():
            raise _Unwanted

    pool = ThreadPoolExecutor(count)
    try:
        yield pool, progress
    finally:
        ended.set()
        pool.shutdown(cancel_futures=True)
