"""The numbers of a comparison: scores beside those of references without a model, and numbers that
are measured and simulated alike, such as drift and kick."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from cosim.arrays import Array
from cosim.studies.report import Row
from cosim.trials.camera import FRAME_RATE
from cosim.trials.periods import drift, one_period_later, whole_periods
from cosim.trials.recording import GAP, Recording

STICKS = 0.01
"""m/s; part and surface that differ by less between frames count as sticking, on both sides."""

LINES = {
    "run": "",
    "ceiling": "; of the measured motion's forecast of itself one period later",
    "no motion": "; of nothing that moves",
    "straight line": "; of the best straight line",
}
"""The run and the references for which a score is given, and what each adds to its meaning. No
model need beat the ceiling; the last two are floors."""
SIDES = "measured", "simulated"

Signals = dict[str, Array]
Values = dict[str, float | None]
Distance = Callable[[Array, Array], float]


@dataclass(frozen=True)
class Number:
    """A number of a comparison by the columns of its table, which are LINES, SIDES, or one "value"
    alone; None where it is not known."""

    name: str
    unit: str
    meaning: str
    values: Values

    def rows(self) -> list[Row]:
        """A row for each value; its name has the column's behind it, if that is not the run's."""
        ends = ["" if of in ("run", "value") else f"_{of.replace(' ', '_')}" for of in self.values]
        return [
            {"name": self.name + end, "value": value, "unit": self.unit}
            | {"meaning": self.meaning + LINES.get(of, "")}
            for end, (of, value) in zip(ends, self.values.items(), strict=True)
        ]


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

    def lines(measured: Array, run: Array, gained: float, score: Distance) -> Values:
        # The forecast is the measured signal a period before plus its drift ``gained`` in one; None
        # where the motion does not repeat.
        known = np.isfinite(measured)
        line = np.polynomial.Polynomial.fit(time[known], measured[known], 1)
        later = one_period_later(time, measured, period, gained) if period else None
        predictions = run, later, np.zeros(len(time)), line(time)
        scored = (None if x is None else _known(score(x, measured)) for x in predictions)
        return dict(zip(LINES, scored, strict=True))

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
            values = {of: value and value * scale for of, value in values.items()}
            found.append(Number(name, unit, words, values))
    for signal, (name, words) in R2.items():
        if signal in simulated:
            values = lines(recording.signals[signal], simulated[signal], 0.0, explained)
            found.append(Number(name, "1", SHARE.format(words), values))
    return found


def _known(value: float) -> float | None:
    """The value, or None for NaN and infinity, for which there were no data."""
    return value if isfinite(value) else None


def both_sides(
    recording: Recording, simulated: Signals, periods: tuple[float | None, float | None]
) -> list[Number]:
    """Numbers of the measured and of the simulated signals; ``periods`` are those of both, s."""
    time, found = recording.time, []
    sides = recording.signals, simulated

    def pair(name: str, unit: str, meaning: str, values: Sequence[float | None]) -> None:
        found.append(Number(name, unit, meaning, dict(zip(SIDES, values, strict=True))))

    frequencies = [1.0 / period if period else None for period in periods]
    pair("frequency", "Hz", "how often the motion repeats", frequencies)
    if "z_part" in simulated:
        counts = [whole_periods(time, period) if period else 0 for period in periods]
        each = " and ".join(map(str, dict.fromkeys(counts)))
        words = f"over {each} whole periods" if all(counts) else "from end to end"
        drifts = [
            drift(time, signals["z_part"], period if all(counts) else None)
            for signals, period in zip(sides, periods, strict=True)
        ]
        pair("drift", "m/s", f"mean velocity of the part, {words}", drifts)
        error, words = drifts[1] - drifts[0], "drift simulated less measured"
        found.append(Number("drift_error", "m/s", words, {"value": error}))
    if {"v_surface", "v_part"} <= set(simulated):
        words = "share of the rows in which part and surface differ by more than 10 mm/s"
        pair("slip_fraction", "1", words, [_slipping(signals) for signals in sides])
    if "v_surface" in simulated:
        # Changes are taken over one frame of the trials' camera, since a change between two rows
        # would depend on the recording's rate; not over a gap, which smooth motion fills, too.
        row = float(np.median(np.diff(time)))
        apart = min(max(1, round(1.0 / FRAME_RATE / row)), len(time) // 2)
        near = time[apart:] - time[:-apart] < GAP * apart * row
        velocities = [signals["v_surface"] for signals in sides]
        changes = [np.abs(v[apart:] - v[:-apart])[near] for v in velocities]
        # fmax ignores NaN; where all are NaN, −inf remains, which becomes None.
        kicks = [_known(float(np.fmax.reduce(each, initial=-np.inf))) for each in changes]
        words = f"largest change of the surface's velocity in {apart * row * 1e3:.3g} ms"
        pair("kick", "m/s", f"{words}: what impacts show", kicks)
    return found


def _slipping(signals: Signals) -> float | None:
    apart = np.abs(signals["v_part"] - signals["v_surface"])
    known = apart[np.isfinite(apart)]
    return float(np.mean(known > STICKS)) if len(known) else None
