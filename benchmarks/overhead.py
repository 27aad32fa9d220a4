"""What little work costs beside what does it: the part's two solvers, a sweep beside bare calls."""

from collections.abc import Callable, Sequence
from contextlib import closing
from ctypes import addressof
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import loop
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import point
from cosim.mechanics import part
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, load
from cosim.simulation.rungs.rung import rungs
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import ratios, take_turns
from cosim.trials import published
from cosim.trials.camera import film, frame_times
from cosim.trials.tracked import Track, Trial, read_folder

FRAMES = 312
"""Of a made-up trial: as many as the published ones have."""
OTHER_FORCE = 14.0
"""Weights of the part; its normal force on a trial that is not among the published."""
OFFSETS = [-2.0 + 0.05 * k for k in range(40)]
"""V; ``drive.offset`` of the points of the sweep."""


def solvers(folder: Path | None, rounds: int) -> dict[str, Any]:
    """CPU seconds (medians) of the exact solution and of the authors' scheme for all trials, and
    the spread of their ratio.

    Both are called straight, with buffers made beforehand, on the trials of ``folder`` or, without
    one, on trials that the camera makes of a simulated run. The exact solution is asked for the
    heights at the tracked times; the published scheme gives them at its steps.
    """
    trials = [_made_up(k) for k in range(10)] if folder is None else read_folder(folder)
    calls = {name: [_call(trial, name == "exact") for trial in trials] for name in _SOLVERS}
    taken = take_turns(
        {name: lambda todo=todo: [call() for call in todo] for name, todo in calls.items()}, rounds
    )
    return {
        "exact_over_published": ratios(taken["exact"], taken["published"]),
        **{name: median(seconds) for name, seconds in taken.items()},
        **{"trials": len(trials), "measured": folder is not None},
    }


_SOLVERS = ("exact", "published")


def _call(trial: Trial, exact: bool) -> Callable[[], int]:
    """A call of a compiled solver on a trial, whose first rows and last ones are left out."""
    rows = slice(3, len(trial.time) - 2)
    time = np.ascontiguousarray(trial.time[rows] - trial.time[3])
    surface = np.ascontiguousarray(trial.platform.v[rows])
    fitted = dict(zip(published.TRIALS, published.FORCES_FITTED, strict=True))
    force = fitted.get(trial.name, OTHER_FORCE) * published.GRAVITY
    law = part.friction_law(published.MU_S, published.MU_K_FITTED, force, published.GRAVITY, 0.0)
    steps = int(time[-1] / part.PUBLISHED_STEP + 1e-6)
    motion = np.empty((3, len(time) if exact else steps + 1))
    given = (len(time), time.ctypes.data, surface.ctypes.data, 1)
    given = (*given, law.ctypes.data, 0.0, float(trial.part.v[3]))
    found: tuple[int | None, ...] = tuple(row.ctypes.data for row in motion)
    if exact:
        solve, asked = part.part_library().part_exact, (0.0, 0.0, len(time), None)
        found = (*found, None)
    else:
        solve = part.part_library().part_threshold
        asked = (part.PUBLISHED_STEP, part.PUBLISHED_V_MIN, steps)

    def call(_: object = (time, surface, law, motion)) -> int:  # they live as long as the call
        return solve(*given, *asked, *found)

    return call


def _made_up(number: int) -> Trial:
    scene = load("reference", ["circuit.model=ideal", "run.duration=0.8", "run.settle=0.4"])
    frames = film(simulate(scene).columns, frame_times(0.4 + 0.003 * number, FRAMES), 0.0)
    nothing = np.full(FRAMES, np.nan)
    surface = Track(frames.z_surface, frames.v_surface, nothing, nothing)
    moved = Track(frames.z_part, frames.v_part, nothing, nothing)
    return Trial(f"made up {number}", None, frames.time, surface, moved, None)


def map_over_bare_calls(rounds: int, offsets: Sequence[float] = OFFSETS) -> dict[str, float]:
    """CPU time of many runs, from their settings to the numbers in a file, over that of
    bare calls of the compiled loop, whose preparation does not count: median, ``low``, ``high``.

    The points are a second of `paper-limited` with each of the ``offsets`` (V). Both take turns.
    """
    scene = load("paper-limited", ["run.duration=1"])
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
