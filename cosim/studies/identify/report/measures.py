"""What is told of a solution, trial by trial: its errors beside the measurement's repeatability.

NRMSE is the rms error over the standard deviation of what was measured; heights without their
means, as the camera's zero is its own. The part's mean velocity is the slope of its height's line.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cosim.arrays import Array, slope
from cosim.stepper.stepper import OWN
from cosim.studies.identify.chain.chain import simulate
from cosim.studies.identify.problem.targets import Measured
from cosim.studies.identify.search.search import Found
from cosim.studies.report import Row
from cosim.trials.camera import velocities

LATE = 5
"""Whole cycles from which on the first ones, of the start, are left out of the repeatability."""

BANDS = (0.0, 15.0, 30.0, 80.0, 150.0, 300.0, 480.0)
"""Ends of the frequency bands, Hz."""


def shown(trial: Measured, rig: Array, own: Array) -> dict[str, Array]:
    """The simulated signals as the trial's instruments show them, heights at the measured mean."""
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
    """The effective number of the surface's measured velocities, for the likelihood: those whose
    residuals do not follow from others a moment or whole periods ago, by their autocorrelation."""
    rig, total = found.rig, 0.0
    for trial, own in zip(trials, found.own, strict=True):
        left = trial.fine.signals["v_surface"] - shown(trial, rig, own)["v_surface"]
        left = np.where(np.isfinite(left), left - np.nanmean(left), 0.0)
        n, known = len(left), int(np.isfinite(trial.fine.signals["v_surface"]).sum())
        # The residual's correlation with itself by the lag in samples, 1 at none. ``short`` adds it
        # up to its first zero, ``again`` at whole periods, where the next cycle errs alike.
        like = np.correlate(left, left, "full")[n - 1 :] / max(float(left @ left), 1e-300)
        short = like[1 : 1 + int(np.argmax(np.append(like, -1.0)[1:] <= 0.0))].sum()
        period = (n - 1) / float(trial.fine.time[-1]) / trial.frequency
        again = 0.0
        if np.isfinite(period):
            at = np.round(period * np.arange(1, int((n - 1) / period) + 1)).astype(int)
            again = np.maximum(like[np.minimum(at, n - 1)], 0.0).sum()
        total += known / (1.0 + 2.0 * short) / (1.0 + 2.0 * again)
    return max(total, 1.0)


def own_parameters(own: Array) -> Row:
    """A trial's own parameters by name, SI."""
    return dict(zip(OWN, own.tolist(), strict=True))


def repeatability(trial: Measured) -> Row:
    """How far the measured velocity's cycles are from their mean, as NRMSE: no periodic motion
    comes closer. Over the whole cycles, and without the first, in which the machine starts."""
    if not np.isfinite(trial.frequency):
        return {"floor": None, "floor_late": None}
    v, time = trial.fine.signals["v_surface"], trial.fine.time
    known = np.isfinite(v)
    period = 1.0 / trial.frequency
    count = int((time[known][-1] - time[known][0]) / period)
    within = np.arange(0.0, period, float(np.median(np.diff(time))))
    # A row for each whole cycle, at equal phases.
    at = time[known][0] + np.add.outer(period * np.arange(count), within)
    cycles, found = np.interp(at, time[known], v[known]), {}
    for name, some in (("floor", cycles), ("floor_late", cycles[int(count >= LATE) :])):
        spread = np.sqrt(some.var(axis=0, ddof=1).mean()) if len(some) > 1 else None
        found[name] = None if spread is None else float(spread / np.nanstd(v))
    return found


def nrmse(simulated: Array, measured: Array) -> float:
    """Rms difference over the standard deviation of what was measured, where both are known."""
    apart = simulated - measured
    return float(np.sqrt(np.nanmean(apart**2)) / np.nanstd(measured))


def bands(trial: Measured, rig: Array, own: Array) -> list[Row]:
    """Share of the measured velocity's power in each band, and the residual's beside it."""
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
