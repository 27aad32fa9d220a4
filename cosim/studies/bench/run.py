"""Speed as ratios, each taken side by side in one run; an absolute time means nothing elsewhere."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from cosim.files.atomic import write_json
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.bench.bars import held, table
from cosim.studies.bench.instructions import compiler_version, per_period
from cosim.studies.bench.measures import BRIEF, BRIEF_FULL
from cosim.studies.bench.memory import growth
from cosim.studies.bench.parts import coupled_over_parts
from cosim.studies.bench.peers import compare
from cosim.studies.bench.rungs import cost_exponent, real_time
from cosim.studies.bench.timings import map_over_bare_calls, solvers
from cosim.studies.fit.cases import Case
from cosim.studies.tables import machine
from cosim.toolchain.processes import in_place
from cosim.trials.camera import film, frame_times
from cosim.trials.tracked import Track, Trial, read_folder

_OFFSETS = [-2.0 + 0.05 * k for k in range(40)]
"""V; ``drive.offset`` of the points of the sweep that is timed."""

FRAMES = 312
"""Of a made-up trial: as many as the published ones have."""


class Bench:
    """What was measured: ``numbers``, as ``bench.json`` holds them."""

    def __init__(self, numbers: dict[str, Any]) -> None:
        self.numbers = numbers

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``bench.json``."""
        write_json(Path(folder) / "bench.json", self.numbers)

    def __repr__(self) -> str:
        return table(self.numbers)


def bench(trials: str | os.PathLike[str] | None = None, *, quick: bool = False) -> Bench:
    """Speed ratios of this machine, each with its bar.

    The part's solvers are timed on the trials of a folder or, without one, on trials that the
    camera makes of a simulated run. A ``quick`` bench takes fewer rounds and shorter runs.
    """
    with in_place():  # CPU times are those of one process
        return Bench(measure(None if trials is None else Path(trials), quick))


def measure(trials: Path | None, quick: bool) -> dict[str, Any]:
    """All the numbers; ratios as median, ``low`` and ``high``, with their bars."""
    rounds, host = 3 if quick else 11, machine()
    circuits = {"amplifier": load("reference", BRIEF), "full": load("reference", BRIEF_FULL)}
    found = read_folder(trials) if trials is not None else [_made_up(k) for k in range(10)]
    seconds = solvers([Case(trial) for trial in found], 11 if quick else 51)
    numbers: dict[str, Any] = {
        "coupled_over_parts": {
            name: coupled_over_parts(scene, rounds) for name, scene in circuits.items()
        },
        **compare(rounds),
        "real_time": real_time(rounds),
        "cost_exponent": cost_exponent(
            2 if quick else 5, (20, 60, 200) if quick else (10, 100, 1000)
        ),
        "memory_growth": growth(1 if quick else 3, (20, 200) if quick else (100, 1000)),
        "instructions_per_period": per_period(),
        "part": {**seconds, "trials": len(found), "measured": trials is not None},
        "map_over_bare_calls": map_over_bare_calls(
            load("paper-limited", ["run.duration=1"]), _OFFSETS, 3 if quick else 7
        ),
        "quick": quick,
        "machine": {
            **{name: host[name] for name in ("processor", "cores", "python")},
            "compiler": compiler_version(),
        },
    }
    return held(numbers)


def _made_up(number: int) -> Trial:
    scene = load("reference", ["circuit.model=ideal", "run.duration=0.8", "run.settle=0.4"])
    frames = film(simulate(scene).columns, frame_times(0.4 + 0.003 * number, FRAMES), 0.0)
    nothing = np.full(FRAMES, np.nan)
    surface = Track(frames.z_surface, frames.v_surface, nothing, nothing)
    part = Track(frames.z_part, frames.v_part, nothing, nothing)
    return Trial(f"made up {number}", None, frames.time, surface, part, None)
