"""The numbers of a run: what ``summary.json`` holds and the table that is printed."""

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop.recorder import Recorder
from cosim.files.spill import blocks
from cosim.scene import Scene
from cosim.simulation.rungs.electrics import Electrics
from cosim.trials.camera import FRAME_RATE, accelerations, instants_a_frame, shown

UNITS = {
    "v_average": "m/s",
    "v_average_error": "m/s",
    "transport_per_cycle": "m",
    "stick_fraction": "1",
    **dict.fromkeys(("a_surface_max", "a_surface_min", "a_camera_max", "a_camera_min"), "m/s2"),
    **dict.fromkeys(("v_surface_max", "v_surface_min"), "m/s"),
    "z_surface_pp": "m",
    **dict.fromkeys(("current_max", "current_min"), "A"),
    **dict.fromkeys(
        (f"energy_{k}" for k in ("in", "copper", "friction", "impact", "damping", "stored")), "J"
    ),
    "wall_time": "s",
}
"""Units of the numbers that have one; the others are counts, shares of time or ratios."""


def summarise(
    scene: Scene, recorder: Recorder, totals: dict[str, float], electric: Electrics | None
) -> dict[str, Any]:
    """Averages, extremes and counts after ``run.settle``; energies over the whole run. SI.

    Where two surfaces move by themselves, extremes and limits are those of the first, counts and
    energies those of both.

    A rigid impact changes velocities in no time: there ``a_surface_max`` and ``a_surface_min`` are
    None. The camera's reading is of the true surface while each frame is exposed, through Tracker's
    five-point differences.
    """
    run, before = scene.run, recorder.at_settle
    span = run.duration - run.settle
    v_average = (totals["z_part"] - before["z_part"]) / span
    seen_max, seen_min = _seen(recorder.frames, run.shutter / FRAME_RATE)
    rigid = scene.mechanics.contact == "rigid"
    a_max, a_min, v_max, v_min, z_max, z_min = recorder.extremes[:6]
    driven = scene.circuit.model != "none"
    result: dict[str, Any] = {
        "v_average": v_average,
        "transport_per_cycle": v_average / scene.drive.frequency if driven else None,
        "stick_fraction": (totals["stick_time"] - before["stick_time"]) / span,
        "a_surface_max": None if rigid else a_max,
        "a_surface_min": None if rigid else a_min,
        "a_camera_max": seen_max,
        "a_camera_min": seen_min,
        "v_surface_max": v_max,
        "v_surface_min": v_min,
        "z_surface_pp": z_max - z_min,
    }
    if electric is not None:
        result["current_max"] = electric.current_max
        result["current_min"] = electric.current_min
        for name, share in electric.limited.items():
            result["saturated_fraction" if name == "output" else f"{name}_fraction"] = share
    if "stick_time_2" in totals:
        result["stick_fraction_2"] = (totals["stick_time_2"] - before["stick_time_2"]) / span
    for counter in ("impacts", "stick_slip_events"):
        result[counter] = totals[counter] - before[counter]
    return result | _energies(scene, totals, electric)


def _seen(
    heights: npt.NDArray[np.float64], exposure: float
) -> tuple[float, float] | tuple[None, None]:
    """The largest and smallest acceleration (m/s²) that a camera reads from heights (m) at the
    instants of its frames.
    """
    n, most, least = instants_a_frame(exposure), -np.inf, np.inf
    frames = len(heights) // n
    for part in blocks(frames - 4):
        read = accelerations(shown(heights[n * part.start : n * (part.stop + 4)], exposure))[2:-2]
        most, least = max(most, float(read.max())), min(least, float(read.min()))
    return (most, least) if frames > 4 else (None, None)


def _energies(
    scene: Scene, totals: dict[str, float], electric: Electrics | None
) -> dict[str, float]:
    """The account of the whole run, J, of all ``coil.count`` actuators."""
    count = scene.coil.count
    lost = {
        f"energy_{kind}": count * totals[f"energy_{kind}"]
        for kind in ("friction", "impact", "damping")
    }
    stored = count * totals["energy_stored"]
    energy_in, copper = 0.0, 0.0
    if electric is not None:
        energy_in, copper = electric.energy_in, electric.energy_copper
        stored += electric.energy_magnetic
    missing = energy_in - copper - sum(lost.values()) - stored
    mechanics = scene.mechanics
    ram = 0.0 if mechanics.actuator == "direct" else mechanics.ram_mass
    mass = ram + mechanics.surface_mass + mechanics.part_mass / mechanics.n_surfaces
    # In the flexures from the start: what a scene without a drive is measured against.
    hanging = count * (mass * mechanics.gravity) ** 2 / (2.0 * mechanics.flexure_stiffness)
    scale = max(abs(energy_in), copper + sum(lost.values()), abs(stored), hanging)
    return {
        "energy_in": energy_in,
        "energy_copper": copper,
        **lost,
        "energy_stored": stored,
        "energy_residual": abs(missing) / scale if scale > 0.0 else 0.0,
    }
