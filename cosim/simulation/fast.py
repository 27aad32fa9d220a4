"""``run.solver = "fast"``: scenes in fixed steps, LANES of them side by side (SIMD).

The stepper of ``cosim/stepper`` solves source, coil and mechanics in steps of ``run.step``, without
locating events as the FMU does. Forces and accelerations are means over a step: the peak of an
impact and the numbers of impacts and slips are unknown.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from ctypes import addressof, byref
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.heat import heats
from cosim.coupling.loop.agenda import count, exposures
from cosim.drive.command import command, shape
from cosim.drive.straights import straights
from cosim.errors import SimulationFailed
from cosim.files.spill import BLOCK, Tape
from cosim.mechanics.stickslip import parameters
from cosim.scene import Scene
from cosim.simulation.guards import remarks
from cosim.simulation.here import few_rows, simulate_here
from cosim.simulation.rungs.rung import commanded
from cosim.simulation.summary import slips
from cosim.stepper.stepper import LANES, OWN, RIG, numbers
from cosim.toolchain.libraries import library, structures
from cosim.toolchain.threads import Progress
from cosim.toolchain.versions import versions
from cosim.trials.camera import FRAME_RATE, accelerations, instants_a_frame, shown
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.result import Result

AT_ONCE = 1 << 16
"""Steps of the compiled loop between two returns to Python, some 10 ms."""

LOST = (
    "The motion left the numbers: run.step is too long for this machine; take a shorter one, or "
    'run.solver = "fmu".'
)
"""The failure of a scene whose v_average is not finite."""

UNLIMITED = 1e9
"""V and A, for a source without limits."""

_COLUMNS = tuple(name for name in COLUMNS if name not in ("time", "command"))[:12]
_SUMS = (
    *("x_settle", "x_end", "i_end", "sticking", "swing_high", "swing_low", "current_limit"),
    *("v_max", "v_min", "z_max", "z_min", "i_max", "i_min"),
    *("coil", "copper", "friction", "impact", "damping"),
)
"""Rows of ``Kept.sums``, in the order of ``Sums`` in ``lanes.h``."""


_Kept, _Stretch, _Drive = (structures("stepper")[name] for name in ("Kept", "Stretch", "Drive"))


def simulate_fast(scene: Scene, progress: Progress) -> Result:
    """The run of a scene, with its rows. Raises SimulationFailed.

    ``v_average_error`` is the difference of v_average to the FMU's. That costs about as much as a
    run with steps half as long, which may err alike, and less than one with steps short enough.
    """
    began = time.perf_counter()
    summary = summary_fast(scene, progress)
    with_events = few_rows(scene).having(run={"solver": "fmu"})
    exact = simulate_here(with_events, progress, alone=True).summary
    error = abs(summary["v_average"] - exact["v_average"])
    columns = _waveforms(scene, progress)
    summary |= {"v_average_error": error, "wall_time": time.perf_counter() - began}
    return Result(scene, columns, summary | remarks(scene, columns, summary))


def summary_fast(scene: Scene, progress: Progress = lambda _: None) -> dict[str, Any]:
    """The summary of a run alone. Raises SimulationFailed."""
    (found,) = summaries([scene], progress)
    if not math.isfinite(found["v_average"]):
        raise SimulationFailed(LOST)
    return found


def summaries(scenes: Sequence[Scene], progress: Progress = lambda _: None) -> list[dict[str, Any]]:
    """The summaries of scenes, without notes, LANES of them side by side; v_average is not finite
    where the motion overflowed."""
    found: list[dict[str, Any]] = [{}] * len(scenes)
    # Lanes share the step and the camera's instants; like durations keep all lanes busy.
    alike: dict[tuple[float, float], list[int]] = {}
    for place, scene in enumerate(scenes):
        alike.setdefault((scene.run.step, scene.run.shutter), []).append(place)
    for (step, _), all_places in alike.items():
        all_places.sort(key=lambda k: scenes[k].run.duration)
        for first in range(0, len(all_places), LANES):
            places = all_places[first : first + LANES]
            batch = _batch([scenes[k] for k in places], step, progress)
            for place, summary in zip(places, batch, strict=True):
                found[place] = summary
    return found


def _batch(scenes: Sequence[Scene], step: float, progress: Progress) -> list[dict[str, Any]]:
    """The summaries of at most LANES scenes with one step and one shutter."""
    began, runs = time.perf_counter(), _Runs(scenes, step)
    shutter, end = scenes[0].run.shutter, float(runs.until.max())
    camera = _Camera(shutter / FRAME_RATE, runs.settle, runs.until)
    instants = exposures(end, runs.settle.min(), shutter)
    for times, heights in runs.go(lambda low, high: instants[_between(instants, low, high)]):
        camera.see(times, heights)
        progress(min(runs.reached, end))
    wall_time = (time.perf_counter() - began) / len(scenes)
    sums = [dict(zip(_SUMS, lane, strict=True)) for lane in zip(*runs.sums, strict=True)]
    seen = camera.seen.T.tolist()
    return [_numbers(scene, sums[k], seen[k], wall_time) for k, scene in enumerate(scenes)]


class _Camera:
    """The largest accelerations that a camera reads of scenes side by side, whose surfaces' heights
    come piece by piece; ``_heights`` (instants × lanes) and ``_times`` (instants) keep those that
    the next frames' accelerations still need."""

    def __init__(self, exposure: float, settle: Array, until: Array) -> None:
        self._exposure, self._settle, self._until = exposure, settle, until
        self._heights, self._times = np.empty((0, LANES)), np.empty(0)
        self.seen = np.full((2, len(settle)), -np.inf)
        """Largest acceleration upwards, and downwards, of each scene, m/s²."""

    def see(self, times: Array, heights: Array) -> None:
        """Take the surfaces' next heights (m; times × lanes) at the instants ``times`` (s)."""
        self._heights = np.concatenate([self._heights, heights])
        self._times = np.concatenate([self._times, times])
        each = instants_a_frame(self._exposure)
        whole = len(self._times) // each * each
        frames = self._times[:whole].reshape(-1, each).mean(axis=1)[:, np.newaxis]
        # An acceleration is a five-point difference: the two frames before and after must lie after
        # settling and before the end, and within what is left here.
        lost = self._exposure / 2.0 + 2.0 / FRAME_RATE - 1e-9
        counts = (frames - lost >= self._settle) & (frames + lost <= self._until)
        shots = shown(self._heights[:whole, : len(self._settle)], self._exposure)
        read = accelerations(shots)[2:-2]
        for row, side in zip(self.seen, (read, -read), strict=True):
            most = np.where(counts[2:-2], side, -np.inf).max(axis=0, initial=-np.inf)
            np.maximum(row, most, out=row)
        first = max(0, whole - 4 * each)
        self._heights, self._times = self._heights[first:], self._times[first:]


def _numbers(
    scene: Scene, sums: dict[str, float], seen: Sequence[float], wall_time: float
) -> dict[str, Any]:
    """The summary of a scene from its lane's ``sums`` and the camera's largest accelerations."""
    run, coils = scene.run, scene.coil.count
    span, length = run.duration - run.settle, scene.period
    whole = all(map(math.isfinite, sums.values()))
    v_average = (sums["x_end"] - sums["x_settle"]) / span if whole else math.nan
    limits = ("swing_high", "swing_low", "current_limit") if scene.rung.has_limits else ()
    # A limit that is only touched leaves a share of rounding errors, which becomes 0.
    share = {name: part if (part := sums[name] / span) > 1e-9 else 0.0 for name in limits}
    held = 0.5 * scene.coil.inductance * sums["i_end"] ** 2
    lost = {name: coils * sums[name] for name in ("copper", "friction", "impact", "damping")}
    high, low = (seen[0], -seen[1]) if math.isfinite(seen[0]) else (None, None)
    camera = {"a_camera_max": high, "a_camera_min": low}
    return {
        "v_average": v_average,
        "transport_per_cycle": v_average * length,
        "stick_fraction": min(1.0, sums["sticking"] / span),
        **camera,
        "v_surface_max": sums["v_max"],
        "v_surface_min": sums["v_min"],
        "z_surface_pp": sums["z_max"] - sums["z_min"],
        "current_max": sums["i_max"],
        "current_min": sums["i_min"],
        **{f"{name}_fraction": value for name, value in share.items()},
        "saturated_fraction": sum(share.values()),
        "energy_in": lost["copper"] + coils * (held + sums["coil"]),
        **{f"energy_{name}": value for name, value in lost.items()},
        **slips(scene, camera),
        **heats(scene, lost["copper"]),
        "wall_time": wall_time,
        "method": "fast",
        "versions": versions(),
    }


def _waveforms(scene: Scene, progress: Progress) -> dict[str, Array]:
    """The waveforms of a scene by a run of its own, in lane 0."""
    step, runs = scene.run.output_step, _Runs([scene], scene.run.step)
    total = count(step, scene.run.duration)
    rows, at = Tape(len(_COLUMNS), total), Tape(1, total)

    def times(low: float, high: float) -> Array:
        stop = min(total, len(at) + int((high - low) / step) + 2)
        known = step * np.arange(len(at), stop, dtype=np.float64)
        return known[known <= high]

    for taken, block in runs.go(times, rows=True):
        rows.append(block)
        at.append(taken)
        progress(min(runs.reached, scene.run.duration))
    waves = {"time": at.column(), "command": commanded(command(scene), at.column())}
    return waves | {name: rows.column(k) for k, name in enumerate(_COLUMNS)}


class _Runs:
    """Runs of at most LANES scenes, in steps of ``step`` (s), from rest at time 0. Arrays for
    compiled code have the lane as their last index; free lanes repeat the last scene."""

    def __init__(self, scenes: Sequence[Scene], step: float) -> None:
        filled = [*scenes, *[scenes[-1]] * (LANES - len(scenes))]
        self._step, self._kept = step, _Kept()
        self._parameters = np.array([_row(scene) for scene in filled]).T.copy()
        self._span = np.array([(scene.run.settle, scene.run.duration) for scene in filled]).T.copy()
        self.settle, self.until = self._span[:, : len(scenes)]
        """End of settling and of the run of each scene, s."""
        self._lines = [_lines(scene) for scene in filled]  # kept alive: the drives point into them
        self._drives = (_Drive * LANES)(
            *((lines.shape[1], *(row.ctypes.data for row in lines)) for lines in self._lines)
        )
        self._row_step = scenes[0].run.output_step
        self.reached = 0.0
        """Time that the runs have reached, s."""
        library("stepper").stepper_begin(
            self._parameters.ctypes.data, self._drives, step, byref(self._kept)
        )

    @property
    def sums(self) -> list[list[float]]:
        """The values of _SUMS (rows) in each lane (columns)."""
        return np.ctypeslib.as_array(self._kept.sums).tolist()

    def go(
        self, when: Callable[[float, float], Array], rows: bool = False
    ) -> Iterator[tuple[Array, Array]]:
        """Step all runs to their ends in pieces. For each piece yields the times (s) that ``when``
        gives between its begin and end (s), and the surface's heights at these times (times ×
        lanes), or with ``rows`` the rows of the first scene (times × _COLUMNS)."""
        steps = int(np.ceil(self._span[1].max() / self._step)) + 1
        at_once = AT_ONCE
        if rows:
            at_once = max(1, min(at_once, int(BLOCK * self._row_step / self._step)))
        for first in range(0, steps, at_once):
            last = min(steps, first + at_once)
            low, self.reached = self.reached, last * self._step
            times = np.ascontiguousarray(when(low, self.reached))
            out = np.empty((len(times), len(_COLUMNS) if rows else LANES))
            piece = _Stretch(
                *(self._step, first, last, len(times), times.ctypes.data, int(rows)),
                addressof(self._drives),
            )
            library("stepper").stepper_run(
                *(byref(piece), self._parameters.ctypes.data, self._span.ctypes.data),
                *(byref(self._kept), out.ctypes.data),
            )
            yield times, out


def _between(times: Array, low: float, high: float) -> slice:
    """The times after ``low`` up to ``high``; with ``low`` = 0 also a time of 0."""
    ends = times.searchsorted((low, high), "right")
    return slice(ends[0] if low else 0, ends[1])


def known_numbers(scene: Scene) -> dict[str, float]:
    """The FMU's variables of a scene; UNLIMITED for the limits of a source without any."""
    reals, integers = parameters(scene)
    return {"output_high": UNLIMITED, "output_low": -UNLIMITED} | reals | integers


def _row(scene: Scene) -> list[float]:
    """The stepper's numbers of a scene, RIG and OWN."""
    known = known_numbers(scene)
    drive, coils = scene.drive, scene.coil.count
    found = numbers(known)
    found["part_mass"] /= scene.mechanics.n_surfaces
    found["sense_resistance"] *= coils  # it carries the current of all coils
    found["current_limit"] = found["current_limit"] / coils if scene.rung.has_limits else UNLIMITED
    # The stepper's phase is that at time 0, a scene's that at the drive's start.
    phase = drive.start_phase - drive.frequency * drive.start_time
    found |= {"frequency": drive.frequency, "phase": phase, "start": drive.start_time}
    if lift := scene.mechanics.initial_lift:
        held = found["mu_plate"] * found["normal_force"]
        found["lift"] = lift * found["flexure_stiffness"] / held
    return [found.get(name, 0.0) for name in (*RIG, *OWN)]


_LINES_OF_SINE = 1024
"""Most straight lines for a period of a sine; each lasts two steps at least."""


def _lines(scene: Scene) -> Array:
    """A period of the scene's command as straight lines (3 × lines): the begin of each as a share
    of the period, and V1 (V) at its begin and end. Lines shorter than half a step become jumps."""
    made, step = shape(scene), scene.run.step
    chords = max(8, min(_LINES_OF_SINE, int(made.period / step / 2.0)))
    times, first, last = next(straights([made], made.period, chords))
    long = np.diff(times) >= 0.5 * step
    lines = np.array([times[:-1] / made.period, first[:, 0], last[:, 0]])
    return np.ascontiguousarray(lines[:, long] if long.any() else lines)
