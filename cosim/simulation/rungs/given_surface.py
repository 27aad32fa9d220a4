"""Runs whose surface is given its velocity: only the part moves freely, and exactly.

The surface's velocity is linear between knots or a sine, so the part's motion is a closed form
between the knots and its own events (:mod:`cosim.mechanics.part`): there is no time stepping.
"""

import math
import warnings
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.agenda import exposures, grid, part_times
from cosim.errors import BadInput, Note, plain
from cosim.files.cells import read_timetable
from cosim.mechanics import part
from cosim.mechanics.surface import Surface
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Motion, average_slope

NO_GRAVITY = 1e-9  # m/s², in place of 0, since the theory divides by g

LONGEST_STEP = 1.7
"""Longest interval between frames of a tracked surface without a missing frame, over the median."""


def surface(scene: Scene) -> Surface:
    """The surface of a scene that gives its velocity, with as many periods as ``run.duration``
    needs. Raises BadInput for a file that cannot be used.
    """
    drive, friction = scene.drive, scene.friction
    if drive.waveform == "file":
        if drive.file is None:
            raise BadInput(
                "drive.file must name the tracked trial, or a CSV with time and velocity, that "
                "moves the surface: --set drive.file=TRIAL.csv."
            )
        return Surface(*read_surface(Path(drive.file)))
    periods = max(1, math.ceil(scene.run.duration * drive.frequency - 1e-9))
    if drive.waveform == "sine":
        law = (friction.mu_s, force_per_mass(scene), scene.mechanics.gravity, friction.mu_plate)
        return Surface.sine(drive.velocity_amplitude, drive.frequency, periods, part.bounds(*law))
    return Surface(*_cycle(scene), periods)


def _cycle(scene: Scene) -> tuple[Array, Array]:
    """Knots (times, s, and velocities, m/s) of a period of one of the theory's waveforms."""
    from cosim.drive.surface import waveforms as theory
    from cosim.drive.surface.formulas import Transport

    drive, friction = scene.drive, scene.friction
    period = 1.0 / drive.frequency
    gravity = max(scene.mechanics.gravity, NO_GRAVITY)
    ratio = force_per_mass(scene) / gravity
    direction = "down" if drive.optimum == "down" else "up"
    if drive.waveform == "quaid":
        # A little below the limit, so that rounding does not make the part slip.
        stick = theory.quaid_limit(friction.mu_s, ratio, direction, gravity) * (1 - 1e-9)
        return theory.quaid_cycle(stick, drive.acceleration_max, period, direction).knots()
    case = Transport(
        *(friction.mu_s, friction.mu_k, drive.acceleration_max, ratio, period),
        direction=direction,
        robust=drive.optimum == "robust",
        gravity=gravity,
    )
    return theory.optimal_cycle(case, theory.ROUNDING_MARGIN).knots()


def force_per_mass(scene: Scene) -> float:
    """Normal force of one surface over the mass that it carries, m/s²."""
    mechanics = scene.mechanics
    return scene.friction.normal_force / (mechanics.part_mass / mechanics.n_surfaces)


def read_surface(path: Path) -> tuple[Array, Array]:
    """Time from 0 (s) and velocity (m/s) of a surface: a tracked trial, or a CSV with both.

    The CSV has a header with ``time [s]`` and ``v_surface [m/s]`` (as ``waveforms.csv`` has); other
    columns do not matter. Other names with their units, and heights, are understood as
    :mod:`cosim.trials.table` has them.
    """
    table = read_timetable(path, ("time [s]",), ("v_surface [m/s]",))
    if table is None:
        return _trial(path)
    times, velocities = table.T
    return times - times[0], velocities


def _trial(path: Path) -> tuple[Array, Array]:
    """Time from 0 (s) and velocity (m/s) of a tracked surface; a Note where frames are missing."""
    from cosim.trials.tracked import read_platform

    times, platform = read_platform(path)
    known = np.isfinite(platform.v)
    times, velocities = times[known], platform.v[known]
    steps = np.diff(times)
    longest = int(steps.argmax())
    if steps[longest] > LONGEST_STEP * np.median(steps):
        first, last = times[[longest, longest + 1]]
        told = f"{plain(str(path))}: no velocity of the surface from {first:.6g} to {last:.6g} s"
        warnings.warn(f"{told}; a straight line is taken there.", Note, stacklevel=2)
    return times - times[0], velocities


def move_part(scene: Scene) -> tuple[dict[str, Array], Motion]:
    """Waveforms (SI, by name) and motion of a scene whose surface is given. Raises BadInput."""
    moved = surface(scene)
    file, run = scene.drive.file, scene.run
    if file is not None and run.duration > moved.times[-1] * (1 + 1e-12):
        raise BadInput(
            f"run.duration = {run.duration:g} s must be at most {moved.times[-1]:.6g} s, where "
            f"{plain(file)} ends."
        )
    rows = grid(run.output_step, run.duration)
    frames = exposures(run.duration, run.settle, run.shutter)
    parts = part_times(run.duration, run.settle) if run.average == "slope" else rows[:0]
    # All times at which the motion is needed; rows, frames and parts are then looked up in them.
    wanted = np.unique(np.concatenate([rows, frames, parts, [run.settle, run.duration]]))
    friction, gravity = scene.friction, scene.mechanics.gravity
    found = part.account(
        moved,
        wanted,
        mu_s=friction.mu_s,
        mu_k=friction.mu_k,
        mu_plate=friction.mu_plate,
        force_per_mass=force_per_mass(scene),
        gravity=gravity,
    )
    mass = scene.mechanics.part_mass / scene.mechanics.n_surfaces
    at = np.searchsorted(wanted, rows)
    columns = {"time": wanted} | {name: found[name] for name in found if name.endswith("_surface")}
    columns |= {
        "z_part": found["z"],
        "v_part": found["v"],
        "friction_force": mass * found["friction"],
        "sticking": found["sticks"],
    }
    # Kinetic and potential energy of the part; it starts with the surface's velocity, at height 0.
    held = mass * (0.5 * found["v"] ** 2 + gravity * found["z"])
    start = 0.5 * mass * float(moved.velocities[0]) ** 2
    totals = {
        "z_part": found["z"],
        "stick_time": found["stuck"],
        "stick_slip_events": found["events"],
        "energy_in": mass * found["work"],
        "energy_friction": mass * found["heat"],
        "energy_stored": held - start,
    }
    none = dict.fromkeys(("impacts", "energy_impact", "energy_damping"), 0)
    settled = int(np.searchsorted(wanted, run.settle))
    motion = Motion(
        totals={name: values[-1].item() for name, values in totals.items()} | none,
        at_settle={name: values[settled].item() for name, values in totals.items()} | none,
        extremes=moved.extremes(run.settle, run.duration),
        frames=found["z_surface"][np.searchsorted(wanted, frames)],
        slope=average_slope(run, found["z"][np.searchsorted(wanted, parts)]),
    )
    return {name: values[at] for name, values in columns.items()}, motion
