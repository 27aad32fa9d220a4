"""Runs whose surface is given its velocity: only the part moves freely, and exactly.

The surface's velocity is linear between knots, so the part's motion is a closed form between the
knots and its own events (:mod:`cosim.mechanics.part`): there is no time stepping at all.
"""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.agenda import exposures, grid
from cosim.errors import BadInput, plain
from cosim.files.columns import read_timetable
from cosim.mechanics import part
from cosim.scene import Scene
from cosim.trials.camera import FRAME_RATE, accelerations, shown

SINE_KNOTS = 2000
"""Knots a period of a sine: its chord error is 1.3e-6 of the amplitude."""

NO_GRAVITY = 1e-9  # m/s²; the theory divides by it


def knots(scene: Scene) -> tuple[Array, Array, int]:
    """Times (s) and velocities (m/s) between which the surface's velocity is linear, and how often
    they are run through to reach ``run.duration``.
    """
    drive = scene.drive
    if drive.waveform == "file":
        if drive.file is None:
            raise BadInput(
                "drive.file must name the tracked trial, or a CSV with time and velocity, that "
                "moves the surface: --set drive.file=TRIAL.csv."
            )
        return *read_surface(Path(drive.file)), 1
    times, velocities = _period(scene)
    return times, velocities, max(1, math.ceil(scene.run.duration * drive.frequency - 1e-9))


def _period(scene: Scene) -> tuple[Array, Array]:
    from cosim.drive.surface import waveforms as theory
    from cosim.drive.surface.formulas import Transport

    drive, friction = scene.drive, scene.friction
    period = 1.0 / drive.frequency
    if drive.waveform == "sine":
        times = np.linspace(0.0, period, SINE_KNOTS + 1)
        return times, drive.velocity_amplitude * np.sin(2 * np.pi * times / period)
    gravity = max(scene.mechanics.gravity, NO_GRAVITY)
    ratio = force_per_mass(scene) / gravity
    direction = "down" if drive.optimum == "down" else "up"
    if drive.waveform == "quaid":
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

    The CSV has a header with ``time [s]`` and ``v_surface [m/s]`` (as ``waveforms.csv`` has), or
    ``time`` and ``velocity``; other columns do not matter. Other units and heights are understood
    as :mod:`cosim.trials.table` has them.
    """
    table = read_timetable(path, ("time [s]", "time"), ("v_surface [m/s]", "velocity"))
    if table is None:
        return _trial(path)
    times, velocities = table.T
    return times - times[0], velocities


def _trial(path: Path) -> tuple[Array, Array]:
    from cosim.trials.tracked import read_platform

    times, platform = read_platform(path)
    known = np.isfinite(platform.v)
    times, velocities = times[known], platform.v[known]
    return times - times[0], velocities


def simulate_part(scene: Scene, progress: Callable[[float], None]) -> tuple[dict[str, Any], Any]:
    """Waveforms (SI, by name) and summary of a scene whose surface is given."""
    began = time.perf_counter()
    times, velocities, periods = knots(scene)
    file = scene.drive.file
    if file is not None and scene.run.duration > times[-1] * (1 + 1e-12):
        raise BadInput(
            f"run.duration = {scene.run.duration:g} s must be at most {times[-1]:.6g} s, where "
            f"{plain(file)} ends."
        )
    run, friction, mechanics = scene.run, scene.friction, scene.mechanics
    rows = grid(run.output_step, run.duration)
    frames = exposures(run.duration, run.settle, run.shutter)
    wanted = np.unique(np.concatenate([rows, frames, [run.settle, run.duration]]))
    motion = part.exact(
        times,
        velocities,
        mu_s=friction.mu_s,
        mu_k=friction.mu_k,
        force_per_mass=force_per_mass(scene),
        gravity=mechanics.gravity,
        mu_plate=friction.mu_plate,
        periods=periods,
        output=wanted,
    )
    progress(run.duration)
    surface = _Surface(times, velocities, periods)
    z, v, a = surface.at(wanted)
    sticking = np.append(motion.sticking, motion.sticking[-1:]) > 0.5
    mass = mechanics.part_mass / mechanics.n_surfaces
    pull = np.where(
        sticking,
        mass * (a + mechanics.gravity),
        friction.mu_k * friction.normal_force * np.sign(v - motion.v),
    )
    at = np.searchsorted(wanted, rows)
    columns = {
        "time": wanted,
        "z_surface": z,
        "v_surface": v,
        "a_surface": a,
        "z_part": motion.z,
        "v_part": motion.v,
        "friction_force": pull,
        "sticking": sticking.astype(float),
    }
    waveforms = {name: values[at] for name, values in columns.items()}
    after = wanted >= run.settle
    span = run.duration - run.settle
    v_average = float(motion.z[-1] - motion.z[after][0]) / span
    peaks = surface.extremes(run.settle, run.duration)
    seen = shown(z[np.searchsorted(wanted, frames)], run.shutter / FRAME_RATE)
    camera = accelerations(seen)[2:-2]
    shares = motion.sticking[after[:-1]]
    periodic = scene.drive.file is None
    summary = {
        "v_average": v_average,
        "transport_per_cycle": v_average / scene.drive.frequency if periodic else None,
        "stick_fraction": float(np.dot(shares, np.diff(wanted[after])) / span),
        **peaks,
        "a_camera_max": float(camera.max()) if camera.size else None,
        "a_camera_min": float(camera.min()) if camera.size else None,
        "v_surface_max": float(v[after].max()),
        "v_surface_min": float(v[after].min()),
        "z_surface_pp": float(np.ptp(z[after])),
        "impacts": 0,
        "stick_slip_events": motion.stick_slip_events,
        **_energies(scene, mass, z, v, motion),
        "circuit_steps": 0,
        "circuit_rejected": 0,
        "fmu_steps": 0,
        "wall_time": time.perf_counter() - began,
        "method": "exact",
    }
    return waveforms, summary


class _Surface:
    """Height (0 at the start), velocity and acceleration of a given surface at any time."""

    def __init__(self, times: Array, velocities: Array, periods: int) -> None:
        self._times, self._velocities = times, velocities
        h = np.diff(times)
        self._slopes = np.divide(np.diff(velocities), h, out=np.full(len(h), np.inf), where=h > 0)
        steps = 0.5 * (velocities[1:] + velocities[:-1]) * h
        self._heights = np.concatenate([[0.0], np.cumsum(steps)])
        self._period, self._periods = float(times[-1] - times[0]), periods

    def at(self, when: Array) -> tuple[Array, Array, Array]:
        cycle = np.minimum(np.floor(when / self._period), self._periods - 1)
        since = when - cycle * self._period
        k = np.clip(np.searchsorted(self._times, since, side="right") - 1, 0, len(self._slopes) - 1)
        tau = since - self._times[k]
        a = self._slopes[k]
        v = self._velocities[k] + a * tau
        z = self._heights[k] + 0.5 * (self._velocities[k] + v) * tau
        return z + cycle * self._heights[-1], v, a

    def extremes(self, start: float, end: float) -> dict[str, float | None]:
        """Largest and smallest acceleration; None where the velocity jumps."""
        slopes = self._slopes
        if self._periods == 1:
            slopes = slopes[(self._times[1:] > start) & (self._times[:-1] < end)]
        if not np.all(np.isfinite(slopes)):
            return {"a_surface_max": None, "a_surface_min": None}
        return {"a_surface_max": float(slopes.max()), "a_surface_min": float(slopes.min())}


def _energies(
    scene: Scene, mass: float, z: Array, v: Array, motion: part.PartMotion
) -> dict[str, float]:
    """The part's account, J: the surface's work on it, what friction took, what it holds.

    ``z`` and ``v`` are the surface's. Where the part slips one way for a whole interval the
    surface's work is a closed form; elsewhere it is taken from the rest of the account.
    """
    friction, gravity = scene.friction, scene.mechanics.gravity
    held = mass * (0.5 * motion.v**2 + gravity * motion.z)
    gained = np.diff(held)
    slipped = np.diff(motion.z - z)
    lost = friction.mu_k * friction.normal_force * np.abs(slipped)
    lost += friction.mu_plate * friction.normal_force * np.abs(np.diff(motion.z))
    work = gained + lost
    if friction.mu_plate == 0.0:
        relative = motion.v - v
        slipping = (motion.sticking == 0.0) & (relative[1:] * relative[:-1] > 0.0)
        pull = -friction.mu_k * friction.normal_force * np.sign(slipped)
        work = np.where(slipping, pull * np.diff(z), work)
    energy_in, energy_friction = float(work.sum()), float(lost.sum())
    stored = float(held[-1] - held[0])
    scale = max(np.abs(work).sum(), energy_friction, abs(stored), 1e-300)
    return {
        "energy_in": energy_in,
        "energy_copper": 0.0,
        "energy_friction": energy_friction,
        "energy_impact": 0.0,
        "energy_damping": 0.0,
        "energy_stored": stored,
        "energy_residual": abs(energy_in - energy_friction - stored) / scale,
    }
