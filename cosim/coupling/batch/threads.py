"""Many recorders led at once, each by a thread of ``threads.c``; Python prepares and takes back."""

from ctypes import Structure, addressof, byref, c_double, c_int64, c_void_p
from functools import cache
from typing import Any

import numpy as np

from cosim.coupling.loop.recorder import STEPS, Block, Recorder
from cosim.errors import SimulationFailed
from cosim.toolchain.libraries import library

_, FAILED, TO_JUDGE = range(3)
"""Values of ``Job.outcome``."""

_PATIENCE = 0.1  # s until Ctrl-C is seen


class Job(Structure):
    """``Job`` of ``threads.h``, which says what it holds."""

    _fields_ = (
        *((name, c_void_p) for name in ("recorder", "edges", "start", "end")),
        *((name, c_int64) for name in ("n", "done", "at_once", "most")),
        *(("internal", c_void_p), ("enough", c_double), ("outcome", c_int64), ("next", c_void_p)),
    )


@cache
def compiled() -> Any:
    """The functions of ``threads.c``."""
    found = library("loop")
    for name, result, arguments in (
        ("threads_start", c_void_p, (c_int64,)),
        ("threads_give", None, (c_void_p, c_void_p)),
        ("threads_take", c_void_p, (c_void_p, c_double)),
        ("threads_end", None, (c_void_p,)),
        ("threads_size", c_int64, ()),
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
        self._under_way: dict[int, tuple[Job, Recorder, Block]] = {}
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
        """Recorders that are being led."""
        return len(self._under_way)

    def give(self, recorder: Recorder, block: Block) -> None:
        """Have a recorder led through a block, as its ``follow`` would."""
        edges, start, end = (np.ascontiguousarray(values) for values in block)
        job = Job(
            recorder=addressof(recorder.state),
            **{"edges": edges.ctypes.data, "start": start.ctypes.data, "end": end.ctypes.data},
            **{"n": len(edges), "at_once": recorder.at_once, "most": STEPS},
            internal=addressof(recorder.mechanics.places["internal"]),
            enough=recorder.pace.enough,
        )
        self._under_way[addressof(job)] = job, recorder, (edges, start, end)
        self._library.threads_give(self._threads, byref(job))

    def take(self) -> tuple[Recorder, BaseException | None]:
        """One of the recorders, whichever is done first, and why its block could not be finished:
        what its ``follow`` would raise."""
        while True:
            place = self._back or self._library.threads_take(self._threads, _PATIENCE)
            if place is None:
                continue
            job, recorder, _ = self._under_way[place]
            self._back = job.next
            recorder.at_once = job.at_once
            failure = recorder.failure() if job.outcome == FAILED else None
            if job.outcome == TO_JUDGE:
                try:
                    recorder.tell()
                except SimulationFailed as error:
                    failure = error
                job.enough = recorder.pace.enough
                if failure is None and job.done < job.n:
                    self._library.threads_give(self._threads, place)
                    continue
            del self._under_way[place]
            return recorder, failure
