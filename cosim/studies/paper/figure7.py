"""The paper's figure 7, a part's measured and simulated height, with this project's simulation.

The authors' solver has the surface's *tracked* motion and a normal force fitted to the trial. The
model of the whole machine has neither: it takes a trial's drive and start, and the normal force of
the identified scenes, and simulates the surface's motion.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cosim.arrays import Array
from cosim.files.picture import Picture
from cosim.studies.compare.each import each
from cosim.studies.compare.run import Comparison
from cosim.studies.fit.fit import FIRST_ROW, fit
from cosim.studies.fit.results import Shown
from cosim.studies.paper.figures import DASHED
from cosim.studies.plots import headline
from cosim.studies.report import Progress, Report, Row, silent
from cosim.trials.periods import drift
from cosim.waveforms.figure import PART, SURFACE

TRIAL = 5
"""The trial that the paper shows."""

MEASURED, THEIRS, EXACT, MACHINE = "0.1", "#e9a03b", "#2a9d8f", PART
OWN = ("surface, measured", "surface, whole machine", "part, measured")
SIDES = (
    ("theirs", THEIRS, "s", "the paper's parameters and solver, tracked surface"),
    ("exact", EXACT, "D", "the same, solved exactly"),
    ("machine", MACHINE, "o", "whole machine, of the trial only drive, start, normal force"),
)


def paper(trials: Path, *, progress: Progress = silent) -> Report:
    """The published trials of a folder, simulated in three ways. Raises BadInput where they are not
    the published ones."""
    theirs = fit(trials, evaluate="published", solver="published").shown
    exact = fit(trials, evaluate="published", solver="exact").shown
    compared = [*zip(theirs, exact, each(trials, progress=progress), strict=True)]
    rows = [_row(number, *sides) for number, sides in enumerate(compared, start=1)]
    said = (
        "The ten published trials as they were measured, by the authors' solver and by the exact "
        "one on the tracked surface, and by the whole chain from the command to the part."
    )
    figures = {"": partial(_draw, rows, *compared[TRIAL - 1])}
    return Report("figure7", "The paper's figure 7", rows, [said], {"Trials": rows}, figures)


def _row(number: int, theirs: Shown, exact: Shown, machine: Comparison) -> Row:
    """A trial's mean velocities of the part over whole periods, mm/s, and mean errors of its
    height, mm. The machine's error includes a constant offset, since its simulation does not start
    at the measured height. ``theirs`` and ``exact`` begin FIRST_ROW rows after ``machine``."""
    numbers, solved = machine.numbers, {"theirs": theirs, "exact": exact}
    frequency = numbers["frequency_measured"]
    period = 1.0 / frequency if frequency else None
    velocities = {
        "measured": numbers["drift_measured"],
        **{side: drift(*shown.simulated, period) for side, shown in solved.items()},
        "machine": numbers["drift_simulated"],
    }
    return {
        "trial": number,
        **{f"v_{side} [mm/s]": (v or 0.0) * 1e3 for side, v in velocities.items()},
        **{f"error_{side} [mm]": shown.error * 1e3 for side, shown in solved.items()},
        "error_machine [mm]": numbers["mean_error_mm"],
    }


def _draw(rows: list[Row], *sides: Any) -> Picture:
    """The velocities of all trials, and the heights of TRIAL by each of the three ``sides``."""
    figure = Picture(13.0, 5.6, "constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    _paths(left, rows[TRIAL - 1], *sides)
    _velocities(right, rows)
    handles = [line for line in left.get_lines() if line.get_label() in OWN]
    handles += [
        Line2D([], [], color=c, marker=m, lw=1.3, label=f"part: {w}") for _, c, m, w in SIDES
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    theirs, machine = (
        np.mean([row[f"error_{side} [mm]"] for row in rows]) for side in ("theirs", "machine")
    )
    headline(
        figure,
        f"Given its drive, the whole machine is {machine:.2f} mm from the measured part, on "
        f"average over the trials; the paper's model, given the surface, {theirs:.2f} mm",
    )
    return figure


def _paths(axis: Axes, row: Row, theirs: Shown, exact: Shown, machine: Comparison) -> None:
    """Draw heights of TRIAL above, and times after, the first row that the authors use."""
    seen, made = machine.found.recording, machine.found.simulated
    time = (seen.time - seen.time[FIRST_ROW])[FIRST_ROW:]

    def rise(heights: Array) -> Array:
        return (heights - heights[FIRST_ROW])[FIRST_ROW:]

    for heights, label, style in (
        (seen.signals["z_surface"], OWN[0], {"color": SURFACE, "lw": 0.9}),
        (made["z_surface"], OWN[1], {"color": SURFACE, "lw": 0.9, "ls": DASHED}),
        (seen.signals["z_part"], OWN[2], {"color": MEASURED, "lw": 1.8}),
    ):
        axis.plot(time * 1e3, rise(heights) * 1e3, label=label, **style)
    simulated = (theirs.simulated, exact.simulated, (time, rise(made["z_part"])))
    for (at, height), (_, color, *_) in zip(simulated, SIDES, strict=True):
        axis.plot(at * 1e3, height * 1e3, color=color, lw=1.3)
    axis.grid(alpha=0.25)
    axis.set(xlabel="time [ms]", ylabel="height [mm]", xlim=(0.0, time[-1] * 1e3))
    errors = tuple(row[f"error_{side} [mm]"] for side, *_ in SIDES)
    words = "Trial {}: {:.2f} mm as published, {:.2f} mm solved exactly, {:.2f} mm the machine"
    axis.set_title(words.format(TRIAL, *errors), loc="left", fontsize=11)


def _velocities(axis: Axes, rows: list[Row]) -> None:
    numbers = np.array([row["trial"] for row in rows])
    measured = [row["v_measured [mm/s]"] for row in rows]
    axis.bar(numbers, measured, width=0.8, color="0.85", edgecolor=MEASURED, lw=0.8)
    for shift, (side, color, marker, _) in zip((-0.22, 0.0, 0.22), SIDES, strict=True):
        values = [row[f"v_{side} [mm/s]"] for row in rows]
        axis.plot(numbers + shift, values, color=color, marker=marker, ls="", ms=5.5)
    axis.axhline(0.0, color="0.4", lw=0.8)
    axis.grid(alpha=0.25, axis="y")
    axis.set(xlabel="trial", ylabel="mean velocity of the part [mm/s]", xticks=numbers)
    axis.set_title("All trials: measured (bars) and simulated", loc="left", fontsize=11)
