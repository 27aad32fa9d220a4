"""The numbers of an identification: laws, rigs, and each trial's errors beside the measurement's
repeatability.

NRMSE is the rms error over the standard deviation of the measured signal; heights are compared
without their means, since the camera's zero is arbitrary. The part's mean velocity is the slope of
the straight line fitted to its height.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from cosim.arrays import Array, slope
from cosim.mechanics.stickslip import rests_of
from cosim.stepper.stepper import OWN
from cosim.studies.identify.chain.chain import simulate
from cosim.studies.identify.problem.space import SUSPENSION
from cosim.studies.identify.problem.targets import Measured, own_parameters
from cosim.studies.identify.report.scenes import exact, trial_settings
from cosim.studies.identify.report.verdicts import Verdict, at_bounds, forces
from cosim.studies.identify.search.plan import Searched
from cosim.studies.identify.search.search import Found
from cosim.studies.report import Row
from cosim.trials.camera import velocities

PLACES = np.linspace(-2e-3, 2e-3, 9)
"""Positions q (m) of the ram in the actuator at which the suspension's force is reported."""

KINDS = ("surface", "surface_and_part")
"""Whether a held-out trial's own parameters are fitted to its surface, or to the part, too."""

LATE = 5
"""Least number of whole cycles for the first one, the start, to be left out of ``floor_late``."""

BANDS = (0.0, 15.0, 30.0, 80.0, 150.0, 300.0, 480.0)
"""Ends of the frequency bands, Hz."""


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """A finished identification; ``numbers`` is the content of ``identify.json``."""

    trials: list[Measured]
    best: Found
    """The best solution of all suspension laws."""
    apart: list[Measured]
    """Trials that were not fitted."""
    apart_own: Array
    meant: list[Found]
    """The rigs that may be the true one, the best first: ``verdicts.rigs_meant``."""
    verdicts: list[Verdict]
    numbers: dict[str, Any]

    @property
    def rig(self) -> dict[str, Any]:
        """The identified rig by the keys of a scene, SI."""
        return self.best.settings


def shown(trial: Measured, rig: Array, own: Array) -> dict[str, Array]:
    """The simulated signals, processed like the measured ones: velocities differenced where the
    measured ones are, heights shifted to the measured mean."""
    out, found = simulate(trial.fine, rig[None], own[None])[0], {}
    for name, measured in trial.fine.signals.items():
        if name in trial.fine.differenced:
            found[name] = velocities(trial.fine.time, out[f"z{name[1:]}"][0])
        else:
            found[name] = out[name][0]
        if name.startswith("z"):
            found[name] = found[name] + np.nanmean(measured - found[name])
    return found


def errors(trial: Measured, rig: Array, own: Array) -> Row:
    """NRMSE of each signal, the part's errors (mm) and mean velocities (mm/s)."""
    simulated, signals, time = shown(trial, rig, own), trial.fine.signals, trial.fine.time
    row: Row = {"trial": trial.label}
    row |= {f"nrmse_{name}": nrmse(simulated[name], signals[name]) for name in signals}
    if trial.has_part:
        apart = (simulated["z_part"] - signals["z_part"]) * 1e3
        known = np.isfinite(apart)
        apart, time, z = apart[known], time[known], signals["z_part"][known]
        line = np.polynomial.Polynomial.fit(time, z * 1e3, 1)
        row["part_error_mm"] = float(np.abs(apart).mean())
        row["part_error_from_start_mm"] = float(np.abs(apart - apart[0]).mean())
        row["straight_line_error_mm"] = float(np.abs(line(time) - z * 1e3).mean())
        run, measured = (slope(time, heights) * 1e3 for heights in (simulated["z_part"][known], z))
        row |= {"v_average_mm_per_s": run, "v_average_measured_mm_per_s": measured}
        row["v_average_error_mm_per_s"] = abs(run - measured)
    return row


def samples(trials: Sequence[Measured], found: Found) -> float:
    """The effective number of independent samples of the surface's measured velocity, for the
    likelihood: the known ones over 1 + 2 Σ of the residual's autocorrelation, for short lags and
    again for lags of whole periods."""
    rig, total = found.rig, 0.0
    for trial, own in zip(trials, found.own, strict=True):
        error = trial.fine.signals["v_surface"] - shown(trial, rig, own)["v_surface"]
        error = np.where(np.isfinite(error), error - np.nanmean(error), 0.0)
        n, known = len(error), int(np.isfinite(trial.fine.signals["v_surface"]).sum())
        # The autocorrelation by the lag in samples, 1 at lag 0. ``short`` sums it over lags up to
        # its first zero, ``again`` over whole periods, after which the model errs alike.
        like = np.correlate(error, error, "full")[n - 1 :] / max(float(error @ error), 1e-300)
        short = like[1 : 1 + int(np.argmax(np.append(like, -1.0)[1:] <= 0.0))].sum()
        period = (n - 1) / float(trial.fine.time[-1]) / trial.frequency
        again = 0.0
        if np.isfinite(period):
            at = np.round(period * np.arange(1, int((n - 1) / period) + 1)).astype(int)
            again = np.maximum(like[np.minimum(at, n - 1)], 0.0).sum()
        total += known / (1.0 + 2.0 * short) / (1.0 + 2.0 * again)
    return max(total, 1.0)


def repeatability(trial: Measured) -> Row:
    """The measured velocity's scatter from cycle to cycle, as NRMSE: no periodic motion can fit
    better. ``floor`` is over all whole cycles, ``floor_late`` without the first, the start."""
    if not np.isfinite(trial.frequency):
        return {"floor": None, "floor_late": None}
    v, time = trial.fine.signals["v_surface"], trial.fine.time
    known = np.isfinite(v)
    period = 1.0 / trial.frequency
    count = int((time[known][-1] - time[known][0]) / period)
    within = np.arange(0.0, period, float(np.median(np.diff(time))))
    # ``cycles`` is cycles × phases: the velocity of each whole cycle at equal phases.
    at = time[known][0] + np.add.outer(period * np.arange(count), within)
    cycles, found = np.interp(at, time[known], v[known]), {}
    for name, some in (("floor", cycles), ("floor_late", cycles[int(count >= LATE) :])):
        spread = np.sqrt(some.var(axis=0, ddof=1).mean()) if len(some) > 1 else None
        found[name] = None if spread is None else float(spread / np.nanstd(v))
    return found


def nrmse(simulated: Array, measured: Array) -> float:
    """Rms difference over the standard deviation of the measured signal, where both are known."""
    apart = simulated - measured
    return float(np.sqrt(np.nanmean(apart**2)) / np.nanstd(measured))


def bands(trial: Measured, rig: Array, own: Array) -> list[Row]:
    """Power of the measured velocity and of the residual in each band, as shares of the whole power
    of the measured velocity."""
    v, time = trial.fine.signals["v_surface"], trial.fine.time
    residual = v - shown(trial, rig, own)["v_surface"]
    known = np.isfinite(v) & np.isfinite(residual)
    step = float(np.median(np.diff(time)))
    even = np.arange(time[known][0], time[known][-1] + 0.5 * step, step)
    # The window keeps a strong line from leaking into the other bands.
    window = np.hanning(len(even))
    f = np.fft.rfftfreq(len(window), step)
    both = (np.interp(even, time[known], values[known]) for values in (v, residual))
    powers = [np.abs(np.fft.rfft(values * window)) ** 2 for values in both]
    whole = powers[0].sum()
    rows = []
    for low, high in pairwise(BANDS):
        chosen = (f >= low) & (f < high)
        measured, left = (float(power[chosen].sum() / whole) for power in powers)
        told = {"measured": measured, "residual": left}
        rows.append({"trial": trial.label, "from_hz": low, "to_hz": high} | told)
    return rows


def overall(rows: Sequence[Row]) -> Row:
    """Means over trials of what ``errors`` says of each, and the worst velocity."""
    names = dict.fromkeys(name for row in rows for name in row)
    known = {name: [row[name] for row in rows if row.get(name) is not None] for name in names}
    found: Row = {
        name: float(np.mean(values))
        for name, values in known.items()
        if values and name not in ("trial", "at_bounds", *OWN)
    }
    off = known.get("v_average_error_mm_per_s")
    found["nrmse_v_surface_worst"] = max(known.get("nrmse_v_surface", ()), default=None)
    found["v_average_error_mm_per_s_median"] = float(np.median(off)) if off else None
    return found


def errors_on(rig: Found, trials: Sequence[Measured]) -> list[Row]:
    """The errors of the trials of a solution."""
    return [errors(trial, rig.rig, own) for trial, own in zip(trials, rig.own, strict=True)]


def told_of_trials(trials: Sequence[Measured], best: Found) -> tuple[list[Row], list[Row]]:
    """A row for each fitted trial; and for each whose scene can run, the part's mean velocity
    (mm/s) by the compiled chain and by the circuits of ``scenes.CIRCUITS``. The row has that of
    the circuit limited."""
    rows, checks = [], []
    each = zip(trials, best.own, best.costs.tolist(), errors_on(best, trials), strict=True)
    for trial, own, cost, row in each:
        ends = at_bounds(trial.fine.low, trial.fine.high, trial.fine.scale, own)
        row |= repeatability(trial) | {"cost": cost, "at_bounds": ", ".join(ends)}
        if trial.target.current is None and trial.has_part:
            settings, first = trial_settings(best.settings, trial, own)
            check = exact(best.settings | settings, first, trial.fine.time)
            checks.append({"trial": trial.label, "steps": row["v_average_mm_per_s"]} | check)
            # Other studies and the trial's scene have the FMU's number, not that of these steps.
            if (run := check.get("limited")) is not None:
                off = abs(run - row["v_average_measured_mm_per_s"])
                row |= {"v_average_mm_per_s": run, "v_average_error_mm_per_s": off}
        rows.append(row | own_parameters(own))
    return rows, checks


def told_of_law(trials: Sequence[Measured], found: Searched) -> Row:
    """The result with one law of the suspension."""
    best = found.best
    whole = overall(errors_on(best, trials))
    names = ("nrmse_v_surface", "nrmse_v_surface_worst", "v_average_error_mm_per_s")
    return {
        "law": best.space.law,
        "costs": [one.total for one in found.ends],
        "converged": found.converged,
        "rests_mm": [q * 1e3 for q in rests_of(best.numbers)],
        **{name: whole.get(name) for name in names},
        "rig": best.settings,
        "trials": [
            {"trial": trial.label} | own_parameters(own)
            for trial, own in zip(trials, best.own, strict=True)
        ],
    }


def told_of_force(meant: Sequence[Found]) -> list[Row]:
    """The range over the rigs ``meant`` of the suspension's force less that at the centre."""
    table = np.array([forces(rig, PLACES) for rig in meant])  # rigs × (N, A) × places
    # (N, A) × (least, most) × places, flattened to the order of ``names`` and turned: places × 4.
    ends = np.stack([table.min(axis=0), table.max(axis=0)], axis=1).reshape(4, -1).T
    names = ("low_N", "high_N", "low_A", "high_A")
    return [
        {"q_mm": q * 1e3} | dict(zip(names, row, strict=True))
        for q, row in zip(PLACES.tolist(), ends.tolist(), strict=True)
    ]


def told_of_rig(one: Found, best: Found | None = None) -> Row:
    """A rig by the keys of a scene; geometric mean of its normal forces over the best rig's."""
    found: Row = {"cost": one.total, SUSPENSION: one.space.law}
    if best is not None:
        k = OWN.index("normal_force")
        found["normal_force_ratio"] = float(np.exp(np.log(one.own[:, k] / best.own[:, k]).mean()))
    return found | {name: one.settings[name] for name in one.space.names}
