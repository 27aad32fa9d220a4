"""Runs many scenes at once for the numbers of their summaries: a thread for each, in compiled code.

Python only prepares a run and sums it up, with what a single run does that with; so the numbers are
those of single runs, to the last bit.
"""

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Any

from cosim.coupling.batch.threads import Threads
from cosim.coupling.loop.recorder import Recorder
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.numbers import motion, numbers
from cosim.simulation.rungs.rung import Led, rungs

AHEAD = 16
"""Runs at hand for each thread: the one that runs, and the next."""

Summary = dict[str, Any]


def led(scene: Scene) -> bool:
    """Whether :func:`summaries` can run a scene: ngspice has no part in it, and more moves than the
    part alone."""
    if scene.rung.automatic or scene.surface_is_given:
        return False
    return isinstance(rungs()[scene.circuit.model], Led)


class _Run:
    """A run at hand. Raises BadInput and SimulationFailed where it cannot begin."""

    def __init__(self, number: int, scene: Scene) -> None:
        self.number, self.scene, self.began = number, scene, time.perf_counter()
        rung = rungs()[scene.circuit.model]
        assert isinstance(rung, Led)
        self.mechanics = Mechanics(scene)
        try:
            self.recorder = Recorder(scene, self.mechanics, lambda _: None)
        except BaseException:
            self.mechanics.close()
            raise
        self._leading = rung.lead(scene, self.recorder)

    def go_on(self, threads: Threads) -> Summary | None:
        """Have the next block run; the summary where there is none."""
        try:
            threads.give(self.recorder, next(self._leading))
        except StopIteration as end:
            moved, steps = motion(self.scene, self.recorder), self.recorder.steps
            return numbers(self.scene, moved, end.value, steps, self.began)
        return None


def summaries(
    scenes: Iterable[tuple[int, Callable[[], Scene]]], count: int
) -> Generator[tuple[int, Summary | Exception], None, None]:
    """The summaries, without notes, of numbered scenes, in the order in which ``count`` threads
    finish them; or what the run of a scene, or the making of it, raised.

    Scenes are drawn and made as threads become free; all are :func:`led`.
    """
    waiting, runs = iter(scenes), dict[Recorder, _Run]()
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
                        runs[run.recorder] = run
                        yield from _gone_on(run, runs, threads)
                if not runs:
                    return
                recorder, failure = threads.take()
                yield from _gone_on(runs[recorder], runs, threads, failure)
    finally:
        for run in runs.values():
            run.mechanics.close()


def _gone_on(
    run: _Run, runs: dict[Recorder, _Run], threads: Threads, failure: BaseException | None = None
) -> Iterator[tuple[int, Summary | Exception]]:
    """What has become of a run, if it has ended."""
    found: Summary | Exception | None
    try:
        if failure is not None:
            raise failure
        found = run.go_on(threads)
    except Exception as error:
        found = error
    if found is not None:
        runs.pop(run.recorder).mechanics.close()
        yield run.number, found
