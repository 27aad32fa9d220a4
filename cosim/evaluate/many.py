"""Many runs at once, a thread for each.

The compiled loop leaves Python to the other threads while it runs, and so does a thread that waits
for its worker; so the numbers are those of single runs, to the last bit.
"""

import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TypeVar

from cosim.toolchain.processes import Progress

AHEAD = 2
"""Tasks at hand for each thread: the one that runs, and the next."""

_Task = TypeVar("_Task")
_Found = TypeVar("_Found")


class _Ended(Exception):
    """Nobody wants to know any more."""


def each(
    call: Callable[[_Task, Progress], _Found], tasks: Iterable[tuple[int, _Task]], count: int
) -> Generator[tuple[int, _Found | Exception], None, None]:
    """What ``call(task, progress)`` gives for each numbered task, or what it raises, in the order
    in which ``count`` threads finish them. Tasks are drawn as threads become free.

    ``progress`` ends what runs when nobody waits for it any more.
    """
    waiting, ended = iter(tasks), threading.Event()
    todo: SimpleQueue[tuple[int, _Task] | None] = SimpleQueue()
    found: SimpleQueue[tuple[int, _Found | Exception]] = SimpleQueue()
    threads: list[threading.Thread] = []

    def progress(time: float) -> None:
        if ended.is_set():
            raise _Ended

    def work() -> None:
        while (task := todo.get()) is not None:
            try:
                found.put((task[0], call(task[1], progress)))
            except Exception as error:
                found.put((task[0], error))

    at_hand = 0
    try:
        while True:
            while at_hand < AHEAD * count and (task := next(waiting, None)) is not None:
                todo.put(task)
                at_hand += 1
                if len(threads) < min(count, at_hand):
                    threads.append(threading.Thread(target=work, daemon=True))
                    threads[-1].start()
            if not at_hand:
                return
            one = found.get()
            at_hand -= 1
            yield one
    finally:
        ended.set()
        with suppress(Empty):
            while True:
                todo.get_nowait()
        for _ in threads:
            todo.put(None)
        for thread in threads:
            thread.join()
