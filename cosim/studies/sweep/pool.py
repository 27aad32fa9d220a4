"""Worker processes for the points of a sweep: one that crashes or hangs costs only its own point.

ngspice is one library a process, leaks a little with every run, and can be spoilt for good. Workers
are therefore replaced after some points, after one that has spoilt the library, and after their
death. A worker notices the end of its parent at its next report, and ends too.
"""

import multiprocessing
import os
import signal
import time
from collections.abc import Iterable, Iterator, Mapping
from multiprocessing.connection import Connection, wait
from typing import Any

from cosim.errors import BadInput, SimulationFailed
from cosim.scene import Scene
from cosim.studies.sweep.point import Number, Outcome, evaluate
from cosim.toolchain.isolation import PATIENCE, how_it_ended

POINTS_A_WORKER = 250
"""Points after which a worker is replaced: what ngspice leaks stays below some MB."""

TRIES = 3
"""A worker may die of something else than its point, such as a kill from outside."""

_REPORT_EVERY = PATIENCE / 20.0  # s of wall time

Point = tuple[int, Mapping[str, Number]]


class _Worker:
    """A process and the point that it has at hand."""

    def __init__(self, base: Scene, whole_periods: bool) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, there = context.Pipe()
        self.process = context.Process(
            target=_work, args=(there, base, whole_periods), name="cosim-worker"
        )
        self.process.start()
        there.close()
        self.point: Point | None = None
        self.began = False
        """It has reported, so what ends it later is not its start."""
        self.heard = time.monotonic()

    def give(self, point: Point) -> None:
        self.pipe.send(point)
        self.point = point
        self.heard = time.monotonic()

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


class Pool:
    """Runs points of one scene in ``workers`` processes; to be used in a ``with`` block."""

    def __init__(self, base: Scene, workers: int, whole_periods: bool = False) -> None:
        self._base, self._whole_periods = base, whole_periods
        self._count = workers
        self._workers: list[_Worker] = []

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def run(self, points: Iterable[Point]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point (number, settings), in the order in which they finish.

        Points are drawn from ``points`` as workers become free, never more than there are workers.
        """
        waiting = iter(points)
        again: list[Point] = []
        deaths: dict[int, int] = {}
        while True:
            busy = [worker for worker in self._workers if worker.point is not None]
            while len(busy) < self._count:
                point = again.pop() if again else next(waiting, None)
                if point is None:
                    break
                busy.append(self._given(point))
            if not busy:
                return
            ready = wait([worker.pipe for worker in busy], timeout=1.0)
            for worker in busy:
                assert worker.point is not None
                number = worker.point[0]
                if worker.pipe in ready:
                    try:
                        answer = worker.pipe.recv()
                    except (EOFError, OSError):
                        self._drop(worker)
                        if not worker.began:
                            how = how_it_ended(worker.process.exitcode)
                            words = f"The worker processes cannot start ({how})."
                            raise SimulationFailed(words) from None
                        deaths[number] = deaths.get(number, 0) + 1
                        if deaths[number] < TRIES:
                            again.append(worker.point)
                        else:
                            how = how_it_ended(worker.process.exitcode)
                            yield number, Outcome({}, f"The worker process died ({how}).")
                        continue
                    worker.began = True
                    worker.heard = time.monotonic()
                    if answer is None:
                        continue
                    outcome, spent = answer
                    worker.point = None
                    if spent:
                        self._drop(worker)
                    yield number, outcome
                elif time.monotonic() - worker.heard > PATIENCE:
                    self._drop(worker)
                    words = f"The simulation hangs: no step was finished in {PATIENCE:g} s."
                    yield number, Outcome({}, words)

    def _given(self, point: Point) -> _Worker:
        """A worker, idle so far or new, that has been given the point."""
        for worker in list(self._workers):
            if worker.point is None:
                try:
                    worker.give(point)
                except OSError:  # it died while it waited
                    self._drop(worker)
                    continue
                return worker
        worker = _Worker(self._base, self._whole_periods)
        self._workers.append(worker)
        worker.give(point)
        return worker

    def _drop(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end()


def workers_asked(workers: int | None) -> int:
    """The number of workers: those asked for, or one for each processor. Raises BadInput."""
    if workers is None:
        return (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
    if not 1 <= workers <= 1024:
        raise BadInput(f"--workers {workers}: must be a whole number from 1 to 1024.")
    return workers


def _work(pipe: Connection, base: Scene, whole_periods: bool) -> None:
    # Ctrl-C reaches the whole group; the parent decides what becomes of this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _send(pipe, None)
    told = time.monotonic()

    def progress(_: float) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= _REPORT_EVERY:
            told = now
            _send(pipe, None)

    for done in range(1, POINTS_A_WORKER + 1):
        try:
            _, values = pipe.recv()
        except (EOFError, OSError):
            return
        outcome = evaluate(base, values, whole_periods, progress)
        spent = done == POINTS_A_WORKER or _library_spoilt(base)
        _send(pipe, (outcome, spent))
        if spent:
            return


def _send(pipe: Connection, message: Any) -> None:
    try:
        pipe.send(message)
    except OSError:  # the parent is gone, and with it all reason to go on
        os._exit(1)


def _library_spoilt(base: Scene) -> bool:
    if base.rung.own_netlist or not base.rung.ngspice:
        return False
    from cosim.circuit.ngspice import spoilt

    return spoilt()
