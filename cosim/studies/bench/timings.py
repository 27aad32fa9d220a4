"""Times of the part's two solvers beside each other, and of a sweep beside bare calls."""

from collections.abc import Callable, Sequence
from contextlib import closing
from ctypes import addressof
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import loop
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import point
from cosim.mechanics import part
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.rungs.rung import rungs
from cosim.studies.bench.measures import ratios, take_turns
from cosim.studies.fit.cases import Case, Solver
from cosim.trials import published

OTHER_FORCE = 14.0  # weights of the part, on a trial that is not among the published
SOLVERS: tuple[Solver, Solver] = ("exact", "published")


def solvers(cases: Sequence[Case], rounds: int) -> dict[str, float]:
    """CPU seconds that each compiled solver takes for all cases, medians, and ``ratio``, exact over
    published.

    Both are called straight, with buffers made beforehand. The exact solution is asked for the
    heights at the tracked times; the published scheme gives them at its steps.
    """
    calls = {solver: [_call(case, solver) for case in cases] for solver in SOLVERS}
    taken = take_turns(
        {name: lambda todo=todo: [call() for call in todo] for name, todo in calls.items()}, rounds
    )
    seconds = {solver: median(values) for solver, values in taken.items()}
    return {**seconds, "ratio": ratios(taken["exact"], taken["published"])["median"]}


def map_over_bare_calls(scene: Scene, offsets: Sequence[float], rounds: int) -> dict[str, float]:
    """CPU time of many runs, from their settings to the numbers in a file, over that of
    bare calls of the compiled loop, whose preparation does not count: median, ``low``, ``high``.

    The points are ``scene`` with each of the ``offsets`` (V). Both take turns.
    """
    points = [*enumerate({"drive.offset": offset} for offset in offsets)]
    bare, swept = [], []
    for _ in range(rounds + 1):
        bare.append(sum(_bare(point(scene, values, False)) for _, values in points))
        with (
            TemporaryDirectory() as folder,
            Evaluator(scene, Path(folder) / "store", workers=1) as bench,
        ):
            began = process_time()
            assert len(list(bench.run(points))) == len(points)
            swept.append(process_time() - began)
    return ratios(swept[1:], bare[1:])  # the first round warms up


def _bare(scene: Scene) -> float:
    """CPU seconds of the compiled loop alone for a scene whose inputs are known beforehand."""
    seconds = 0.0

    class Bare(Recorder):
        def follow(self, edges: Array, start: Array, end: Array) -> None:
            nonlocal seconds
            block = [np.ascontiguousarray(values) for values in (edges, start, end)]
            at = [values.ctypes.data for values in block]
            began = process_time()
            loop().recorder_follow(addressof(self.state), len(edges), *at, 1 << 40)
            seconds += process_time() - began

    with closing(Mechanics(scene)) as mechanics:
        rungs()[scene.circuit.model].drive(scene, Bare(scene, mechanics, lambda _: None))
    return seconds


def _call(case: Case, solver: Solver) -> Callable[[], int]:
    fitted = dict(zip(published.TRIALS, published.FORCES_FITTED, strict=True))
    force = fitted.get(case.trial.name, OTHER_FORCE) * published.GRAVITY
    law = part.friction_law(published.MU_S, published.MU_K_FITTED, force, published.GRAVITY, 0.0)
    rows = np.empty((3, len(case.time) if solver == "exact" else len(case.grid)))
    motion: tuple[int | None, ...] = tuple(row.ctypes.data for row in rows)
    given = (len(case.time), case.time.ctypes.data, case.v_surface.ctypes.data, 1)
    given = (*given, law.ctypes.data, 0.0, case.v0)
    if solver == "exact":
        function, asked = part.part_library().part_exact, (0.0, 0.0, len(case.time), None)
        motion = (*motion, None)
    else:
        steps = len(case.grid) - 1
        function = part.part_library().part_threshold
        asked = (part.PUBLISHED_STEP, part.PUBLISHED_V_MIN, steps)

    def call(_: object = (law, rows)) -> int:  # the buffers live as long as the call
        return function(*given, *asked, *motion)

    return call
