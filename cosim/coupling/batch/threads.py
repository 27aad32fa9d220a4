"""Many calls of compiled code at once, each in a thread of ``threads.c``; Python prepares them and
takes them back."""

from ctypes import Structure, addressof, byref, c_double, c_int, c_int64, c_void_p
from functools import cache
from typing import Any, Protocol

from cosim.errors import SimulationFailed
from cosim.toolchain.libraries import library

_PATIENCE = 0.1  # s until Ctrl-C is seen


class Task(Protocol):
    """A call that one of the threads is to make."""

    @property
    def run(self) -> int:
        """Where the function lies."""
        ...

    @property
    def arguments(self) -> Structure:
        """What its pointer points to."""
        ...

    def goes_on(self, outcome: int) -> bool:
        """Whether the call is to be made again, after one that gave this. Raises what failed."""
        ...


class Job(Structure):
    """``Job`` of ``threads.h``, which says what it holds."""

    _fields_ = (("run", c_void_p), ("task", c_void_p), ("outcome", c_int64), ("next", c_void_p))


@cache
def compiled() -> Any:
    """The functions of ``threads.c``."""
    found = library("loop")
    for name, result, arguments in (
        ("threads_start", c_void_p, (c_int64,)),
        ("threads_give", None, (c_void_p, c_void_p)),
        ("threads_take", c_void_p, (c_void_p, c_double)),
        ("threads_end", None, (c_void_p,)),
        ("threads_size", c_int64, (c_int,)),
    ):
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


class Threads:
    """``count`` threads; to be used in a ``with`` block, whose end stops what they still do."""

    def __init__(self, count: int) -> None:
        self._library = compiled()
        self._count = count
        self._threads = None
        self._under_way: dict[int, tuple[Job, Task]] = {}
        self._back: int | None = None  # the first of the jobs that are back

    def __enter__(self) -> "Threads":
        self._threads = self._library.threads_start(self._count)
        if not self._threads:
            raise SimulationFailed("The system gives this process no more threads.")
        return self

    def __exit__(self, *_: object) -> None:
        self._library.threads_end(self._threads)
        self._under_way.clear()

    def __len__(self) -> int:
        """Tasks that are under way."""
        return len(self._under_way)

    def give(self, task: Task) -> None:
        """Have a task done."""
        job = Job(run=task.run, task=addressof(task.arguments))
        self._under_way[addressof(job)] = job, task
        self._library.threads_give(self._threads, byref(job))

    def take(self) -> tuple[Task, BaseException | None]:
        """One of the tasks, whichever is done first, and why it could not be finished."""
        while True:
            place = self._back or self._library.threads_take(self._threads, _PATIENCE)
            if place is None:
                continue
            job, task = self._under_way[place]
            self._back = job.next
            failure = None
            try:
                if task.goes_on(job.outcome):
                    self._library.threads_give(self._threads, place)
                    continue
            except SimulationFailed as error:
                failure = error
            del self._under_way[place]
            return task, failure
