"""Many runs at once, a thread for each.

The compiled loop leaves Python to the other threads while it runs, and so does a thread that waits
for its worker; so the numbers are those of single runs, to the last bit.
"""

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

AHEAD = 2
"""Tasks at hand for each thread: the one that runs, and the next."""

Progress = Callable[[float], None]

_Task = TypeVar("_Task")
_Found = TypeVar("_Found")


class _Ended(Exception):
    """Nobody wants to know any more."""


def each(
    call: Callable[[_Task, Progress], _Found], tasks: Iterable[tuple[int, _Task]], count: int
) -> Iterator[tuple[int, _Found | Exception]]:
    """What ``call(task, progress)`` gives for each numbered task, or what it raises, in the order
    in which ``count`` threads finish them. Tasks are drawn as threads become free.

    ``progress`` ends what runs when nobody waits for it any more.
    """
    waiting, running = iter(tasks), dict[Future[_Found], int]()
    ended = threading.Event()

    def progress(time: float) -> None:
        if ended.is_set():
            raise _Ended

    threads = ThreadPoolExecutor(count)
    try:
        while True:
            while len(running) < AHEAD * count and (task := next(waiting, None)) is not None:
                running[threads.submit(call, task[1], progress)] = task[0]
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                error = future.exception()
                if error is not None and not isinstance(error, Exception):
                    raise error
                yield running.pop(future), future.result() if error is None else error
    finally:
        ended.set()
        threads.shutdown(cancel_futures=True)
