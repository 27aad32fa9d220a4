"""The numbers of a comparison: scores beside those of references without a model, and numbers that
are measured and simulated alike, such as drift and kick."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from cosim.arrays import Array
from cosim.trials.camera import FRAME_RATE
from cosim.trials.periods import drift, one_period_later, whole_periods
from cosim.trials.recording import Recording

STICKS = 0.01
"""m/s; part and surface that differ by less between frames count as sticking, on both sides."""

LINES = {
    "": "",
    "_ceiling": "; of the measured motion's forecast of itself one period later",
    "_no_motion": "; of nothing that moves",
    "_straight_line": "; of the best straight line",
}
"""The run and the references for which a score is given: what each adds to the score's name and to
its meaning. No model need beat the ceiling; the last two are floors."""

Signals = dict[str, Array]
Distance = Callable[[Array, Array], float]


@dataclass(frozen=True)
class Number:
    """One number of a comparison, with its unit and meaning; None where it is not known."""

    name: str
    value: float | None
    unit: str
    meaning: str


def explained(found: Array, wanted: Array) -> float:
    """R²: the share of the variance of ``wanted`` that ``found`` explains; NaN if it has none."""
    known = np.isfinite(found) & np.isfinite(wanted)
    wanted, found = wanted[known], found[known]
    if not len(wanted) or np.ptp(wanted) == 0.0:
        return nan
    return 1.0 - float(np.sum((wanted - found) ** 2) / np.sum((wanted - wanted.mean()) ** 2))


def mean_distance(found: Array, wanted: Array) -> float:
    """Mean of |``found`` − ``wanted``| over the rows where both are known; NaN without any."""
    apart = (found - wanted)[np.isfinite(found - wanted)]
    return float(np.abs(apart).mean()) if len(apart) else nan


def centred_distance(found: Array, wanted: Array) -> float:
    """Mean of the differences' distances from their mean: ``mean_distance`` with means removed."""
    apart = (found - wanted)[np.isfinite(found - wanted)]
    return float(np.abs(apart - apart.mean()).mean()) if len(apart) else nan


SHARE = "share of the variance of the measured {} that the run explains"
R2 = {
    "v_surface": ("velocity_r2", "velocity of the surface"),
    "current": ("current_r2", "current of the coil"),
    "coil_voltage": ("voltage_r2", "voltage of the coil"),
    "command": ("command_r2", "command V1"),
    "v_part": ("part_velocity_r2", "velocity of the part"),
}


def scores(recording: Recording, simulated: Signals, period: float | None) -> list[Number]:
    """The scores of all signals, each for all ``LINES``; ``period`` is the measured one, s."""
    found, time = [], recording.time

    def lines(measured: Array, run: Array, gained: float, score: Distance) -> list[float | None]:
        # In the order of LINES. The forecast is the measured signal a period before plus its drift
        # ``gained`` in one; None where the motion does not repeat.
        known = np.isfinite(measured)
        line = np.polynomial.Polynomial.fit(time[known], measured[known], 1)
        later = one_period_later(time, measured, period, gained) if period else None
        predictions = run, later, np.zeros(len(time)), line(time)
        return [None if x is None else _known(score(x, measured)) for x in predictions]

    def add(name: str, unit: str, meaning: str, values: list[float | None]) -> None:
        for (end, words), value in zip(LINES.items(), values, strict=True):
            found.append(Number(f"{name}{end}", value, unit, f"{meaning}{words}"))

    if "z_part" in simulated:
        measured, run = (side["z_part"] for side in (recording.signals, simulated))
        first = int(np.argmax(np.isfinite(measured)))
        measured, run = measured - measured[first], run - run[first]
        gained = drift(time, measured, period) * period if period else 0.0
        largest = float(np.nanmax(np.abs(measured)))
        apart = "mean distance of the part's heights, both from their first: the paper's error"
        of_height = "the paper's error over the part's greatest measured height"
        centred = "mean distance of the part's heights, both from their means"
        for name, unit, scale, distance, words in (
            ("mean_error_mm", "mm", 1e3, mean_distance, apart),
            ("mean_error_percent", "%", 100.0 / largest, mean_distance, of_height),
            ("centred_error_mm", "mm", 1e3, centred_distance, centred),
        ):
            values = lines(measured, run, gained, distance)
            add(name, unit, words, [value and value * scale for value in values])
    for signal, (name, words) in R2.items():
        if signal in simulated:
            values = lines(recording.signals[signal], simulated[signal], 0.0, explained)
            add(name, "1", SHARE.format(words), values)
    return found


def _known(value: float) -> float | None:
    """The value, or None for NaN and infinity, for which there were no data."""
    return value if isfinite(value) else None


def both_sides(
    recording: Recording, simulated: Signals, periods: tuple[float | None, float | None]
) -> list[Number]:
    """Numbers of the measured and of the simulated signals; ``periods`` are those of both, s."""
    time, found = recording.time, []
    sides = (("measured", recording.signals), ("simulated", simulated))

    def pair(name: str, unit: str, meaning: str, values: list[float | None]) -> None:
        for (side, _), value in zip(sides, values, strict=True):
            found.append(Number(f"{name}_{side}", value, unit, meaning))

    frequencies = [1.0 / period if period else None for period in periods]
    pair("frequency", "Hz", "how often the motion repeats", frequencies)
    if "z_part" in simulated:
        counts = [whole_periods(time, period) if period else 0 for period in periods]
        each = " and ".join(map(str, dict.fromkeys(counts)))
        words = f"over {each} whole periods" if all(counts) else "from end to end"
        drifts = [
            drift(time, signals["z_part"], period if all(counts) else None)
            for (_, signals), period in zip(sides, periods, strict=True)
        ]
        pair("drift", "m/s", f"mean velocity of the part, {words}", [*drifts])
        error = drifts[1] - drifts[0]
        found.append(Number("drift_error", error, "m/s", "drift simulated less measured"))
    if {"v_surface", "v_part"} <= set(simulated):
        shares = [_slipping(signals) for _, signals in sides]
        words = "share of the rows in which part and surface differ by more than 10 mm/s"
        pair("slip_fraction", "1", words, [*shares])
    if "v_surface" in simulated:
        # Changes are taken over one frame of the trials' camera, since a change between two rows
        # would depend on the recording's rate.
        apart = max(1, round(1.0 / FRAME_RATE / float(np.median(np.diff(time)))))
        apart = min(apart, len(time) // 2)
        velocities = [signals["v_surface"] for _, signals in sides]
        changes = [np.abs(v[apart:] - v[:-apart]) for v in velocities]
        # fmax ignores NaN; where all are NaN, −inf remains, which becomes None.
        kicks = [_known(float(np.fmax.reduce(each, initial=-np.inf))) for each in changes]
        words = f"largest change of the surface's velocity in {time[apart] * 1e3:.3g} ms"
        pair("kick", "m/s", f"{words}: what impacts show", [*kicks])
    return found


def _slipping(signals: Signals) -> float | None:
    apart = np.abs(signals["v_part"] - signals["v_surface"])
    known = apart[np.isfinite(apart)]
    return float(np.mean(known > STICKS)) if len(known) else None
