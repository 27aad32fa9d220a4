"""Runs functions in worker processes, which may hang, crash or be spoilt without harm.

A netlist can make ngspice loop for ever, end the process, or refuse all further work; and a process
has only one ngspice, usable by one thread. multiprocessing and pebble run the caller's program
again, which fails for standard input and for a script without a main guard; pebble limits a call's
total time; loky loses all calls with one process. Here workers of equal bounds are reused.
"""

import os
import threading
from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cosim.toolchain.interrupts import caught_signals
from cosim.toolchain.threads import Progress, processors
from cosim.toolchain.worker import REPORT_EVERY, Bounds, ProcessLost, Worker, living

ENDING = 30.0
"""s that a process has to end once its pipe is closed."""

TRIES = 3
"""Attempts to start a worker, which may be killed from outside before its call begins."""

_idle: defaultdict[Any, "deque[Worker]"] = defaultdict(deque)
"""Processes that wait for a call, by their function and bounds. A worker that is taken out of a
deque and then lost by an interrupt is ended when Python frees it."""

_places = threading.BoundedSemaphore(processors())
"""Permits for processes at work. Signals are held back while one is taken, so that none is lost."""

_here = threading.local()


def _forget() -> None:
    """In a child of a fork: let go of the workers, which are its parent's."""
    global _places
    for each in list(living.values()):
        with suppress(Exception):
            if (worker := each()) is not None:
                worker.let_go()
    _idle.clear()
    _places = threading.BoundedSemaphore(processors())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


@contextmanager
def in_place() -> Iterator[None]:
    """Within this context work for other processes is done in this one: because it is a worker
    itself, or so that the work can be profiled or patched."""
    before, _here.ours = in_a_worker(), True
    try:
        yield
    finally:
        _here.ours = before


def in_a_worker() -> bool:
    """Whether this thread does work itself instead of giving it to another process."""
    return getattr(_here, "ours", False)


def isolated(
    function: Callable[[Any, Progress], Any],
    argument: Any,
    progress: Progress,
    bounds: Bounds | None = None,
    lost: Callable[[str], None] = lambda _: None,
) -> Any:
    """The result of ``function(argument, progress)`` in another process: a fresh one, or, with
    ``bounds``, one that is reused, where the result must fit in JSON, :class:`Packed` columns
    aside. At most as many processes as processors work at once.

    Any thread may call it. Raises what the function raises, or SimulationFailed where the process
    hangs or dies; if that happens after its answer, ``lost`` is called with how it ended.
    """
    interrupts: list[BaseException] = []
    answer = None

    def heed() -> None:
        if interrupts:
            raise interrupts[0]

    with caught_signals(interrupts.append), _place(heed):
        for tried in range(TRIES):
            worker = _taken(function, bounds)
            try:
                answer = worker.call(argument, progress, heed)
                if worker.lost:
                    lost(worker.end())
                break
            except EOFError:
                how = worker.end(ENDING)
                if worker.began or tried == TRIES - 1:
                    what = f"died {worker.when}" if worker.began else "cannot start"
                    words = f"The simulation's process {what} ({how})."
                    raise ProcessLost(words) from None
            finally:
                if worker.usable and bounds is not None:
                    _idle[worker.kind].append(worker)
                    _thin_out()
                else:
                    worker.end()
    heed()
    return answer


@contextmanager
def _place(heed: Callable[[], None]) -> Iterator[None]:
    """Wait for a permit to have a process at work. A call from within ``progress`` uses the permit
    of the call that is in progress."""
    if getattr(_here, "at_work", False):
        yield
        return
    while not _places.acquire(timeout=REPORT_EVERY):
        heed()
    _here.at_work = True
    try:
        yield
    finally:
        _here.at_work = False
        _places.release()


def _taken(function: Callable[[Any, Progress], Any], bounds: Bounds | None) -> Worker:
    """An idle process that is still alive, or a new one."""
    with suppress(IndexError):
        while bounds is not None:
            worker = _idle[function, bounds].pop()
            if worker.alive:
                return worker
            worker.end()
    return Worker(function, bounds)


def _thin_out() -> None:
    """End the idle processes that have waited longest, until one remains for each processor."""
    most = processors()
    while len(waiting := [one for each in list(_idle.values()) for one in list(each)]) > most:
        longest = min(waiting, key=lambda worker: worker.rested)
        with suppress(ValueError):  # another thread has it
            _idle[longest.kind].remove(longest)
            longest.end()


def end_idle(inside: Path) -> None:
    """End the idle processes whose folders lie in ``inside``."""
    for (_, bounds), waiting in list(_idle.items()):
        while bounds.inside == inside and waiting:
            waiting.pop().end()
