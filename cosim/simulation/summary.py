"""The numbers of a run, for ``summary.json`` and the printed table."""

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.circuit.heat import heats
from cosim.coupling.loop.recorder import Recorder
from cosim.files.spill import blocks
from cosim.mechanics.part import slip_budget
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Electrics, Motion, average_slope
from cosim.toolchain.versions import versions
from cosim.trials.camera import FRAME_RATE, accelerations, instants_a_frame, shown

_RESOLVED = 1e-15
"""J: smaller energies of a rig at rest are errors within the solver's tolerances."""


def numbers(
    scene: Scene, motion: Motion, driven: Driven, steps: int, began: float
) -> dict[str, Any]:
    """The summary without notes: averages, extremes and counts after ``run.settle``; energies over
    the whole run. SI. ``steps`` are those of the FMU; the run began at ``began`` on the clock.

    Where two surfaces move independently, extremes and limits are those of the first, counts and
    energies those of both.

    Where the surface's velocity jumps, by a rigid impact or as it is given, ``a_surface_max`` and
    ``a_surface_min`` are None. The camera reads the true surface's height while each frame is
    exposed; accelerations are Tracker's five-point differences of these. ``at_wall`` is 1 if the
    ram touches a wall in the last row; without ``impacts`` it then rests there.
    """
    run, totals, before, extremes = scene.run, motion.totals, motion.at_settle, motion.extremes
    electric = driven.electric
    span = run.duration - run.settle
    ends = (totals["z_part"] - before["z_part"]) / span
    v_average = ends if motion.slope is None else motion.slope
    seen_max, seen_min = _seen(motion.frames, run.shutter / FRAME_RATE)
    a_max, a_min = extremes["a_surface_max"], extremes["a_surface_min"]
    bounded = math.isfinite(a_max) and math.isfinite(a_min)
    cycle = scene.period
    result: dict[str, Any] = {
        "v_average": v_average,
        "transport_per_cycle": v_average * cycle if math.isfinite(cycle) else None,
        "stick_fraction": min(1.0, (totals["stick_time"] - before["stick_time"]) / span),
        "a_surface_max": a_max if bounded else None,
        "a_surface_min": a_min if bounded else None,
        "a_camera_max": seen_max,
        "a_camera_min": seen_min,
        "v_surface_max": extremes["v_surface_max"],
        "v_surface_min": extremes["v_surface_min"],
        "z_surface_pp": extremes["z_surface_max"] - extremes["z_surface_min"],
    }
    if electric is not None:
        result["current_max"] = electric.current_max
        result["current_min"] = electric.current_min
        for name, share in electric.limited.items():
            result["saturated_fraction" if name == "output" else f"{name}_fraction"] = share
    if "stick_time_2" in totals:
        result["stick_fraction_2"] = (totals["stick_time_2"] - before["stick_time_2"]) / span
    for counter in ("impacts", "stick_slip_events"):
        result[counter] = round(totals[counter] - before[counter])
    if motion.ram is not None:
        # A rigid wall holds the ram within rounding.
        result["at_wall"] = int(abs(motion.ram) >= scene.mechanics.travel * (1.0 - 1e-12))
    result |= _energies(scene, totals, electric) | slips(scene, result)
    if electric is not None:
        result |= heats(scene, result["energy_copper"])
    return result | {
        "circuit_steps": driven.circuit_steps,
        "circuit_rejected": driven.circuit_rejected,
        "fmu_steps": steps,
        "wall_time": time.perf_counter() - began,
        "method": driven.method,
        "versions": {**versions(), **driven.versions},
    }


def budget(scene: Scene) -> dict[str, tuple[float, float]]:
    """:func:`slip_budget` of a scene with a constant normal force."""
    friction, mechanics = scene.friction, scene.mechanics
    force = friction.normal_force * mechanics.n_surfaces / mechanics.part_mass
    return slip_budget(friction.mu_s, force, mechanics.gravity, friction.mu_plate)


def slips(scene: Scene, read: Mapping[str, Any]) -> dict[str, Any]:
    """The accelerations of the surface, m/s², beyond which a sticking part slips while it moves up
    or down, and which of them the run exceeded: by its instantaneous accelerations, if known, and
    by the camera's, which are means. Empty where the normal force changes in time."""
    if scene.friction.normal_force_file is not None:
        return {}
    # By way of the part: the surface's accelerations, downwards and upwards, at which it slips.
    ways = budget(scene)
    found: dict[str, Any] = {f"slip_{way}": [*ends] for way, ends in ways.items()}
    for by in ("a_surface", "a_camera"):
        low, high = read.get(f"{by}_min"), read.get(f"{by}_max")
        if low is None or high is None:
            continue
        found[f"slip_by_{by[2:]}"] = {
            way: [what for what, over in (("fall", low < fall), ("rise", high > rise)) if over]
            for way, (fall, rise) in ways.items()
        }
    return found


def _seen(
    heights: npt.NDArray[np.float64], exposure: float
) -> tuple[float, float] | tuple[None, None]:
    """The largest and smallest acceleration (m/s²) that a camera reads from ``heights`` (m) at the
    instants of its frames, n for each frame; None for fewer than five frames.
    """
    n, most, least = instants_a_frame(exposure), -np.inf, np.inf
    frames = len(heights) // n
    for part in blocks(frames - 4):
        read = accelerations(shown(heights[n * part.start : n * (part.stop + 4)], exposure))[2:-2]
        most, least = max(most, float(read.max())), min(least, float(read.min()))
    return (most, least) if frames > 4 else (None, None)


def _energies(
    scene: Scene, totals: Mapping[str, float], electric: Electrics | None
) -> dict[str, float]:
    """The energy balance of the run, J, of all actuators; residual over the largest energy."""
    count = scene.coil.count
    lost = {
        f"energy_{kind}": count * totals[f"energy_{kind}"]
        for kind in ("friction", "impact", "damping")
    }
    stored = count * totals["energy_stored"]
    energy_in, copper = count * totals["energy_in"], 0.0
    if electric is not None:
        energy_in, copper = electric.energy_in, electric.energy_copper
        stored += electric.energy_magnetic
    missing = energy_in - copper - sum(lost.values()) - stored
    # A falling part turns height into speed: their sum is a small difference of large numbers.
    fallen = count * scene.mechanics.part_mass * scene.mechanics.gravity * abs(totals["z_part"])
    moved = max(abs(energy_in), copper + sum(lost.values()), abs(stored), fallen)
    scale = max(moved, _hanging(scene), _RESOLVED)
    return {
        "energy_in": energy_in,
        "energy_copper": copper,
        **lost,
        "energy_stored": stored,
        "energy_residual": abs(missing) / scale,
    }


def _hanging(scene: Scene) -> float:
    """Energy in the flexures at the start, by the weight and by a lift, J: the scale of a balance
    without a drive."""
    if scene.surface_is_given:
        return 0.0
    mechanics = scene.mechanics
    ram = mechanics.ram_mass if mechanics.free_ram else 0.0
    mass = ram + mechanics.surface_mass + mechanics.part_mass / mechanics.n_surfaces
    stiffness, lift = mechanics.flexure_stiffness, mechanics.initial_lift
    weight = mass * mechanics.gravity
    return 0.5 * scene.coil.count * (weight**2 / stiffness + stiffness * lift**2)


def motion(scene: Scene, recorder: Recorder) -> Motion:
    """The motion of surface and part, at the end of a run."""
    ram = None
    if scene.mechanics.free_ram:
        last = dict(zip(recorder.mechanics.columns, recorder.rows[-1].tolist(), strict=True))
        ram = last["z_ram"] - last["z_surface"]
    names = (f"{what}_surface_{end}" for what in "avz" for end in ("max", "min"))
    extremes = dict(zip(names, recorder.extremes, strict=False))  # the current's follow
    if scene.mechanics.contact == "rigid":  # an impact changes velocities in no time
        extremes |= {"a_surface_max": math.inf, "a_surface_min": -math.inf}
    slope = average_slope(scene.run, recorder.parts)
    return Motion(recorder.at_end, recorder.at_settle, extremes, recorder.frames, slope, ram)
