"""Settings of a scene and what becomes of them: each once, many at once, kept in a file.

What all studies of many runs stand on. A point that crashes or hangs costs only itself.
"""

import itertools
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self, TypeVar

from cosim.errors import BadInput
from cosim.evaluate.many import each
from cosim.evaluate.point import Number, Outcome, evaluate, evaluate_many, failed, outcome_of, point
from cosim.evaluate.store import Store, hashed
from cosim.scene import Scene
from cosim.toolchain.processes import Progress, processors

Settings = Mapping[str, Number | str]
"""``table.key`` and value, SI."""

TOGETHER = 64
"""Points that are solved side by side, at most: some lanes full of runs of like duration."""

_Task = list[tuple[int, Settings]]
_Given = TypeVar("_Given")
_Made = TypeVar("_Made")


class Evaluator:
    """Runs settings on top of ``scene``; to be used in a ``with`` block.

    The outcomes are kept in the file ``path``, or in memory alone, with what they follow from:
    the scene, ``whole_periods`` and ``asked`` (what JSON can hold). Only the numbers that ``kept``
    names, if it does. ``workers`` runs at once (default: one for each processor, and never more
    circuits than these), or as many as the Dask cluster at the address ``dask`` has threads.

    Raises BadInput where the file cannot be used or there is no such cluster.
    """

    def __init__(
        self,
        scene: Scene,
        path: Path | None = None,
        *asked: Any,
        whole_periods: bool = False,
        kept: Collection[str] = (),
        workers: int | None = None,
        dask: str | None = None,
    ) -> None:
        self._scene = point(scene, {}, False)  # what all points have in common is changed once
        self._whole_periods, self._kept = whole_periods, kept
        self._workers, self._dask = workers_asked(workers), dask
        self._stack = ExitStack()
        self._store = Store(path, scene.as_dict(), whole_periods, *asked)
        self.resumed = self._store.resumed
        """Outcomes that stood in the file."""
        self._cluster: Any = None

    def __enter__(self) -> Self:
        self._stack.enter_context(self._store)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def known(self, settings: Settings) -> Outcome | None:
        """What has become of settings; None where they are still to be run, or to be run again
        because the machine was the reason of their failure."""
        return outcome_of(self._store.get(hashed(settings)))

    def run(self, points: Iterable[tuple[int, Settings]]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point (number, settings), in the order in which they are known."""
        waiting: dict[str, list[int]] = {}
        """The points that wait for the same settings, by their key."""
        known: deque[tuple[int, Outcome]] = deque()
        keys: dict[int, str] = {}

        def new() -> Iterator[tuple[int, Settings]]:
            for number, settings in points:
                key = hashed(settings)
                found = outcome_of(self._store.get(key))
                if found is not None:
                    known.append((number, found))
                elif key in waiting:
                    waiting[key].append(number)
                else:
                    waiting[key], keys[number] = [number], key
                    yield number, settings

        for number, outcome in self._run(new()):
            key = keys.pop(number)
            if self._kept:
                outcome = outcome.only(self._kept)
            self._store.add(key, vars(outcome))
            known.extend((other, outcome) for other in waiting.pop(key))
            while known:
                yield known.popleft()
        yield from known

    def apply(
        self, call: Callable[[_Given, Progress], _Made], tasks: Iterable[tuple[int, _Given]]
    ) -> Iterator[tuple[int, _Made | Exception]]:
        """What ``call`` gives for each numbered task, or what it raises, as many at once as runs
        are, here; of what no store holds, as waveforms."""
        return each(call, tasks, self._workers)

    def forget(self) -> None:
        """The study is done: remove the file."""
        self._store.remove()

    def _run(self, points: Iterator[tuple[int, Settings]]) -> Iterator[tuple[int, Outcome]]:
        if self._dask is not None:
            from cosim.evaluate.cluster import Cluster

            if self._cluster is None:
                cluster = Cluster(self._dask, self._scene, self._whole_periods)
                self._cluster = self._stack.enter_context(cluster)
            yield from self._cluster.run(points)
            return
        tasks: dict[int, _Task] = {}
        for number, found in each(self._evaluate, self._tasks(points, tasks), self._workers):
            task = tasks.pop(number)
            if isinstance(found, Exception):
                found = [failed(found)] * len(task)
            yield from zip((number for number, _ in task), found, strict=True)

    def _tasks(
        self, points: Iterator[tuple[int, Settings]], known: dict[int, _Task]
    ) -> Iterator[tuple[int, _Task]]:
        """The points as tasks with numbers, which are ``known`` from then on: those that are solved
        side by side together, all others one by one."""
        together: _Task = []

        def task(of: _Task) -> tuple[int, _Task]:
            number = next(numbers)
            known[number] = of
            return number, of

        numbers = itertools.count()
        for one in points:
            if one[1].get("run.solver", self._scene.run.solver) != "fast":
                yield task([one])
                continue
            together.append(one)
            if len(together) == TOGETHER:
                yield task(together)
                together = []
        if together:
            yield task(together)

    def _evaluate(self, task: _Task, progress: Progress) -> list[Outcome]:
        settings = [settings for _, settings in task]
        if settings[0].get("run.solver", self._scene.run.solver) == "fast":
            return evaluate_many(self._scene, settings, self._whole_periods)
        return [evaluate(self._scene, settings[0], self._whole_periods, progress)]


def workers_asked(workers: int | None) -> int:
    """The number of workers: those asked for, or one for each processor. Raises BadInput."""
    if workers is None:
        return processors()
    if not 1 <= workers <= 1024:
        raise BadInput(f"--workers {workers}: must be a whole number from 1 to 1024.")
    return workers
