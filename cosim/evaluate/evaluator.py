"""Runs many settings of a scene: each once, many in parallel, with outcomes kept in a file.

All studies of many runs use it. A point that crashes or hangs does not affect the others.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, nullcontext
from functools import partial
from itertools import groupby, islice
from pathlib import Path
from typing import Any, Self

from cosim.evaluate.many import Pool, cluster, each, threads
from cosim.evaluate.point import (
    Outcome,
    Settings,
    evaluate_all,
    failed,
    inputs,
    is_fast,
    outcome_of,
    point,
)
from cosim.evaluate.store import Store, hashed
from cosim.scene import Scene
from cosim.scene.messages import check_whole
from cosim.toolchain.threads import processors

TOGETHER = 64
"""Most points in one task of the fast solver, which fills its lanes with runs of like duration."""

AT_ONCE = 128 * TOGETHER
"""Points that are looked up before the first of them is run. All of these are run before the next
are looked up, so that few outcomes are in memory, whatever the number of points."""

_Keyed = tuple[str, Settings]
"""The hash of settings, their key in the store, and the settings."""


class Evaluator:
    """Runs settings on top of ``scene``; to be used in a ``with`` block.

    The outcomes are kept in the file ``path``, or in memory alone, with the inputs that they follow
    from: the scene, ``whole_periods`` and ``asked`` (what JSON can hold). Of their numbers only
    those that ``kept`` names are kept, if it names any. ``workers`` runs are parallel (default: one
    for each processor, and never more circuits than these), or as many as the Dask cluster at the
    address ``dask`` has threads.

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
        self._scene = point(scene, {}, False)  # changes common to all points
        self._whole_periods, self._kept = whole_periods, kept
        self._workers, self._dask = workers_asked(workers), dask
        self._far: Pool | None = None
        """The cluster, which stays connected."""
        self._store = Store(path, inputs(scene) if path else None, whole_periods, *asked)
        self.resumed = self._store.resumed
        """Outcomes that stood in the file."""

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            stack.enter_context(self._store)
            if self._dask is not None:
                self._far = stack.enter_context(cluster(self._scene, self._dask))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def run(self, points: Iterable[tuple[int, Settings]]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point (number, settings), in the order in which they are known. What
        the store has is not run again, but for failures that the machine may have caused."""
        rest = iter(points)
        while some := list(islice(rest, AT_ONCE)):
            asked: dict[str, Settings] = {}
            """Settings to be run, each once, by their keys in the store."""
            numbers: dict[str, list[int]] = {}
            """The numbers of the points with these settings."""
            keys = [hashed(settings) for _, settings in some]
            stored = self._store.some(keys)
            for key, (number, settings) in zip(keys, some, strict=True):
                if (known := outcome_of(stored.get(key))) is not None:
                    yield number, known
                else:
                    asked[key] = settings
                    numbers.setdefault(key, []).append(number)
            for key, outcome in self._run(asked.items()):
                if self._kept:
                    outcome = outcome.only(self._kept)
                self._store.add(key, vars(outcome))
                for number in numbers[key]:
                    yield number, outcome

    def forget(self) -> None:
        """The study is done: remove the file."""
        self._store.remove()

    def outcomes(self, every: Sequence[Settings]) -> list[Outcome]:
        """The outcome of each settings, in their order."""
        return next((found for _, found in self.groups([every])), [])

    def groups(self, groups: Sequence[Sequence[Settings]]) -> Iterator[tuple[int, list[Outcome]]]:
        """Each group's number and outcomes, once complete; all groups run in parallel."""
        places = [(n, k) for n, group in enumerate(groups) for k in range(len(group))]
        known: list[dict[int, Outcome]] = [{} for _ in groups]
        for number, outcome in self.run(enumerate(one for group in groups for one in group)):
            n, k = places[number]
            known[n][k] = outcome
            if len(known[n]) == len(groups[n]):
                yield n, [known[n][k] for k in range(len(groups[n]))]

    def _run(self, points: Iterable[_Keyed]) -> Iterator[tuple[str, Outcome]]:
        call = partial(evaluate_all, whole_periods=self._whole_periods)
        far = self._far
        with threads(self._scene, self._workers) if far is None else nullcontext(far) as pool:
            for task, found in each(pool, call, self._tasks(points)):
                if isinstance(found, Exception):
                    lost = failed(found)
                    if far is not None:
                        # Its workers died again and again, or raised what no scene explains.
                        words = f"The cluster gave it up: {lost.failure}"
                        lost = Outcome({}, words, machine=True)
                    found = [lost] * len(task)
                yield from zip((key for key, _ in task), found, strict=True)

    def _tasks(self, points: Iterable[_Keyed]) -> Iterator[list[_Keyed]]:
        """Tasks: consecutive points for the fast solver together, all other points one by one."""
        for fast, some in groupby(points, lambda one: is_fast(self._scene, one[1])):
            while task := list(islice(some, TOGETHER if fast else 1)):
                yield task


def workers_asked(workers: int | None) -> int:
    """The number of workers: those asked for, or one for each processor. Raises BadInput."""
    if workers is None:
        return processors()
    check_whole("--workers", workers, 1, 1024)
    return workers
