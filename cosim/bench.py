"""Speed as ratios, each taken side by side in one run; an absolute time means nothing elsewhere."""

import json
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np

from cosim.compare import through_camera
from cosim.fit_cases import Case
from cosim.fit_timing import solvers
from cosim.scene import load
from cosim.simulate import simulate
from cosim.sweep.timing import throughput
from cosim.trials import Track, Trial, read_folder
from cosim.waveforms import whole

_OFFSETS = [-2.0 + 0.05 * k for k in range(40)]
"""V; of the points of a sweep that is timed."""

FRAMES = 312
"""Frames of a made-up trial: as many as the published ones have."""


def run(out: Path, trials: Path | None) -> dict[str, Any]:
    """Measure, write ``bench.json`` into ``out`` and print a table.

    The part's motion is timed on the trials of a folder or, without one, on the bench's own surface
    as the camera sees it.
    """
    found = read_folder(trials) if trials is not None else [_made_up(k) for k in range(10)]
    seconds = solvers([Case(trial) for trial in found])
    numbers: dict[str, Any] = {
        "part": {**seconds, "trials": len(found), "measured": trials is not None},
        "sweep_over_bare_loop": throughput(load("ideal-current", ["run.duration=1"]), _OFFSETS),
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
        },
    }
    with whole(out / "bench.json") as temporary:
        temporary.write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")
    print("The part on a given surface, both solvers compiled, medians:")
    for name, value in seconds.items():
        print(f"  {name:<22}{value:.4g}")
    share = numbers["sweep_over_bare_loop"]
    print("Points a second of a sweep's worker over those of a bare loop:")
    print(f"  {share['median']:.3f} ({share['low']:.3f} … {share['high']:.3f})")
    print(f"Written to {out}: bench.json")
    return numbers


def _made_up(number: int) -> Trial:
    scene = load("ideal-current", ["run.duration=0.8", "run.settle=0.4"])
    frames = through_camera(simulate(scene).waveforms, 0.4 + 0.003 * number, FRAMES)
    nothing = np.full(FRAMES, np.nan)
    surface = Track(frames.z_surface, frames.v_surface, nothing, nothing)
    part = Track(frames.z_part, frames.v_part, nothing, nothing)
    return Trial(f"made up {number}", None, frames.time, surface, part, None)
