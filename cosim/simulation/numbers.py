"""From what a run's mechanics and its rung have gathered to the numbers of its summary."""

import time
from math import inf
from typing import Any

from cosim.coupling.loop.recorder import Recorder
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Motion
from cosim.simulation.summary import summarise
from cosim.toolchain.versions import versions


def motion(scene: Scene, recorder: Recorder) -> Motion:
    """What surface and part did, at the end of a run."""
    ram = None
    if scene.mechanics.actuator == "ram":
        last = dict(zip(recorder.mechanics.columns, recorder.rows[-1].tolist(), strict=True))
        ram = last["z_ram"] - last["z_surface"]
    return Motion(
        recorder.at_end, recorder.at_settle, _extremes(scene, recorder), recorder.frames, ram
    )


def _extremes(scene: Scene, recorder: Recorder) -> dict[str, float]:
    names = (f"{what}_surface_{end}" for what in "avz" for end in ("max", "min"))
    found = dict(zip(names, recorder.extremes, strict=False))  # the current's follow
    if scene.mechanics.contact == "rigid":  # an impact changes velocities in no time
        found |= {"a_surface_max": inf, "a_surface_min": -inf}
    return found


def numbers(
    scene: Scene, motion: Motion, driven: Driven, steps: int, began: float
) -> dict[str, Any]:
    """The summary but for its notes. ``steps`` are those of the FMU; the run began at ``began`` on
    the clock."""
    error = {"v_average_error": driven.v_average_error} if scene.rung.ngspice else {}
    return summarise(scene, motion, driven.electric) | {
        "circuit_steps": driven.circuit_steps,
        "circuit_rejected": driven.circuit_rejected,
        "fmu_steps": steps,
        "wall_time": time.perf_counter() - began,
        "method": driven.method,
        "versions": {**versions(), **driven.versions},
        **error,
    }
