"""The points of a sweep in worker processes: one that crashes or hangs costs only its own point.

Workers are replaced after some points, after one that has spoilt ngspice, and after their death.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from multiprocessing.connection import wait
from typing import Any

from cosim.errors import BadInput
from cosim.scene import Scene
from cosim.simulation.elsewhere import bounds
from cosim.studies.sweep.point import Number, Outcome, evaluate, failed
from cosim.toolchain.processes import ENDING, PATIENCE, STALLED, TRIES, Worker, processors

Point = tuple[int, Mapping[str, Number | str]]


class _Worker(Worker):
    """A process and the point that it has at hand."""

    point: Point | None = None

    def give(self, argument: Point) -> None:
        self.point = argument
        super().give(argument[1])


class Pool:
    """Runs points of one scene in ``workers`` processes; to be used in a ``with`` block."""

    def __init__(self, base: Scene, workers: int, whole_periods: bool = False) -> None:
        self._function = partial(_evaluate, base, whole_periods)
        self._bounds = bounds(base)
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
        tries: dict[int, int] = {}
        while True:
            busy = [worker for worker in self._workers if worker.point is not None]
            while len(busy) < self._count:
                point = again.pop() if again else next(waiting, None)
                if point is None:
                    break
                idle = [worker for worker in self._workers if worker.point is None]
                if not idle:
                    idle = [_Worker(self._function, self._bounds)]
                    self._workers += idle
                idle[0].give(point)
                busy.append(idle[0])
            if not busy:
                return
            ready = wait([worker.pipe for worker in busy], timeout=1.0)
            for worker in busy:
                assert worker.point is not None
                number, lost = worker.point[0], ""
                answer: Any = None
                if worker.pipe in ready:
                    try:
                        kind, answer = worker.hear()
                    except EOFError:
                        how = self._drop(worker, ENDING)
                        kind, lost = "lost", f"The worker process died ({how})."
                    if kind in ("result", "failure"):
                        outcome = answer if kind == "result" else failed(answer)
                        worker.point = None
                        if kind == "failure" or not worker.reusable:
                            self._drop(worker)
                        yield number, outcome
                        continue
                if not lost and worker.hangs:
                    self._drop(worker)
                    words = f"no step was finished in {PATIENCE:g} s of CPU time"
                    yield number, Outcome({}, f"The simulation hangs: {words}.")
                elif not lost and worker.stalls():
                    self._drop(worker)
                    lost = f"The worker process did nothing for {STALLED:g} s."
                if lost:
                    tries[number] = tries.get(number, 0) + 1
                    if tries[number] < TRIES:
                        again.append(worker.point)
                    else:
                        yield number, Outcome({}, lost, machine=True)

    def _drop(self, worker: _Worker, patience: float = 0.0) -> str:
        """Replace the worker; how it ended."""
        self._workers.remove(worker)
        return worker.end(patience)


def workers_asked(workers: int | None) -> int:
    """The number of workers: those asked for, or one for each processor. Raises BadInput."""
    if workers is None:
        return processors()
    if not 1 <= workers <= 1024:
        raise BadInput(f"--workers {workers}: must be a whole number from 1 to 1024.")
    return workers


def _evaluate(
    base: Scene,
    whole_periods: bool,
    values: Mapping[str, Number | str],
    progress: Callable[[float], None],
) -> Outcome:
    """What becomes of a point."""
    try:
        return evaluate(base, values, whole_periods, progress)
    except Exception as error:
        return failed(error)
