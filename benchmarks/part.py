"""The part on a given surface: speed of the exact solution against the published trials' scheme."""

from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from cosim.mechanics import part
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import ratios, take_turns
from cosim.toolchain.libraries import library
from cosim.trials import published
from cosim.trials.camera import frame_times, heights, velocities
from cosim.trials.tracked import Track, Trial, read_folder

FRAMES = 312
"""Frames of a simulated trial, as many as the published ones have."""
OTHER_FORCE = 14.0
"""Normal force of trials that are not published, in weights of the part."""


def solvers(folder: Path | None, rounds: int) -> dict[str, Any]:
    """CPU seconds (medians) of the exact solution and of the authors' scheme for all trials, and
    the spread of their ratio.

    Both compiled functions are called directly, with buffers made beforehand, on the trials of
    ``folder`` or, without one, on simulated trials. The exact solution gives heights at the tracked
    times, the published scheme at its own steps.
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
    """A call of a compiled solver on a trial, without its first three and its last two rows."""
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
        solve, asked = library("part").part_exact, (0.0, 0.0, len(time), None)
        found = (*found, None)
    else:
        solve = library("part").part_threshold
        asked = (part.PUBLISHED_STEP, part.PUBLISHED_V_MIN, steps)

    def call(_: object = (time, surface, law, motion)) -> int:  # keeps the buffers alive
        return solve(*given, *asked, *found)

    return call


def _made_up(number: int) -> Trial:
    """A trial as the camera sees a simulated run; each number starts 3 ms later."""
    scene = load("reference", ["circuit.model=ideal", "run.duration=0.8", "run.settle=0.4"])
    waves, time = simulate(scene).columns, frame_times(0.4 + 0.003 * number, FRAMES)
    seen = (heights(waves, body, time, 0.0) for body in ("surface", "part"))
    surface, moved = (Track(z, velocities(time, z)) for z in seen)
    return Trial(f"made up {number}", time - time[0], surface, moved, None)
