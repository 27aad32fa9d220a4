"""Runs many scenes at once for the numbers of their summaries: a thread for each, in compiled code.

Python only prepares a run and sums it up, with what a single run does that with; so the numbers are
those of single runs, to the last bit.
"""

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Any

from cosim.coupling.batch.following import Following
from cosim.coupling.batch.threads import Task, Threads
from cosim.coupling.loop.recorder import Block, Recorder
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.numbers import motion, numbers
from cosim.simulation.rungs.given_surface import lead_part
from cosim.simulation.rungs.rung import Driven, Led, rungs

AHEAD = 16
"""Runs at hand for each thread: the one that runs, and the next."""

Summary = dict[str, Any]


def led(scene: Scene) -> bool:
    """Whether :func:`summaries` can run a scene: ngspice has no part in it."""
    if scene.rung.automatic:
        return False
    return scene.surface_is_given or isinstance(rungs()[scene.circuit.model], Led)


class _Run:
    """A run at hand. Raises BadInput and SimulationFailed where it cannot begin."""

    def __init__(self, number: int, scene: Scene) -> None:
        self.number, self._scene, self._began = number, scene, time.perf_counter()
        self._mechanics = None if scene.surface_is_given else Mechanics(scene)
        self._leading = self._part() if self._mechanics is None else self._led(self._mechanics)

    def _led(self, mechanics: Mechanics) -> Generator[Task, None, Summary]:
        scene = self._scene
        rung = rungs()[scene.circuit.model]
        assert isinstance(rung, Led)
        recorder = Recorder(scene, mechanics, lambda _: None)
        driven = yield from _followed(recorder, rung.lead(scene, recorder))
        return numbers(scene, motion(scene, recorder), driven, recorder.steps, self._began)

    def _part(self) -> Generator[Task, None, Summary]:
        _, moved = yield from lead_part(self._scene)
        return numbers(self._scene, moved, Driven(None, "exact"), 0, self._began)

    def go_on(self) -> Task | Summary:
        """What is to be done next; the summary where there is nothing."""
        try:
            return next(self._leading)
        except StopIteration as end:
            return end.value

    def close(self) -> None:
        """End the run, whose task is not under way any more."""
        if self._mechanics is not None:
            self._mechanics.close()


def _followed(
    recorder: Recorder, leading: Generator[Block, None, Driven]
) -> Generator[Task, None, Driven]:
    while True:
        try:
            block = next(leading)
        except StopIteration as end:
            return end.value
        yield Following(recorder, block)


def summaries(
    scenes: Iterable[tuple[int, Callable[[], Scene]]], count: int
) -> Generator[tuple[int, Summary | Exception], None, None]:
    """The summaries, without notes, of numbered scenes, in the order in which ``count`` threads
    finish them; or what the run of a scene, or the making of it, raised.

    Scenes are drawn and made as threads become free; all are :func:`led`.
    """
    waiting, runs = iter(scenes), dict[Task, _Run]()
    try:
        with Threads(count) as threads:
            while True:
                while len(runs) < AHEAD * count and (following := next(waiting, None)):
                    number, made = following
                    try:
                        run = _Run(number, made())
                    except Exception as error:
                        yield number, error
                    else:
                        yield from _gone_on(run, runs, threads)
                if not runs:
                    return
                task, failure = threads.take()
                yield from _gone_on(runs.pop(task), runs, threads, failure)
    finally:
        for run in runs.values():
            run.close()


def _gone_on(
    run: _Run, runs: dict[Task, _Run], threads: Threads, failure: BaseException | None = None
) -> Iterator[tuple[int, Summary | Exception]]:
    """What has become of a run, if it has ended; else it goes on."""
    found: Task | Summary | Exception
    try:
        if failure is not None:
            raise failure
        found = run.go_on()
    except Exception as error:
        found = error
    if isinstance(found, dict | Exception):
        run.close()
        yield run.number, found
        return
    runs[found] = run
    threads.give(found)
