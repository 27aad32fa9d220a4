"""A chaotic scene: statistics over an ensemble instead of single paths.

A scene is chaotic if a relative change of the normal force by 1e-9 changes the part's path by more
than ``CHAOTIC`` times as much, relative to its range. No method can follow such a path, whatever
its steps. An ensemble of runs with slightly different normal forces can be compared: each method
must give the same mean velocity, share of sticking and counts of events within standard errors.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from math import hypot, sqrt
from statistics import mean, stdev
from typing import Any

import numpy as np

from cosim.files.picture import Picture
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.accuracy import CHAOTIC
from cosim.studies.plots import BLUE, panels
from cosim.studies.report import Report, Row
from cosim.waveforms.result import Result

NUDGE, APART = 1e-9, 1e-6
"""Relative changes of the normal force: in the test for chaos, and between members of an
ensemble."""
MEMBERS, DURATION, SETTLE = 12, 1.0, 0.5  # runs of an ensemble; s; s
STATISTICS = ("v_average", "stick_fraction", "impacts", "stick_slip_events")
SCENE = ("drive.pot_max=0.508", "drive.pot_frequency=0.5452", "drive.pot_offset=0.5565")
"""Overrides of the scene ``reference``: three knobs of its signal generator."""
METHODS = {
    "step-locked, fine steps": ("circuit.reltol=1e-6", "circuit.max_step=2e-5"),
    "step-locked (default)": (),
    "Gauss-Seidel, 0.1 ms": ("coupling.method=gauss-seidel", "coupling.macro_step=1e-4"),
    "mean current, 0.2 ms": ("coupling.method=mean-current", "coupling.macro_step=2e-4"),
}
"""Methods and their settings; all are compared with the first."""


Ensemble = dict[str, list[float]]
"""The values of each statistic, one for each member."""


def average(values: Sequence[float]) -> tuple[float, float]:
    """The mean of values, and its standard error."""
    return mean(values), stdev(values) / sqrt(len(values))


def apart(one: Sequence[float], other: Sequence[float]) -> float:
    """Distance of two means in units of the standard error of their difference."""
    (a, ea), (b, eb) = average(one), average(other)
    return abs(a - b) / (hypot(ea, eb) or 1.0)


def solved(scene: Sequence[str], more: Sequence[str], change: float = 0.0) -> Result:
    """A run of ``reference`` with overrides, its normal force greater by the share ``change``."""
    force = load("reference", list(scene)).friction.normal_force * (1.0 + change)
    short = [f"run.duration={DURATION!r}", f"run.settle={SETTLE!r}", "run.output_step=1e-3"]
    return simulate(load("reference", [*scene, *short, f"friction.normal_force={force!r}", *more]))


def growth(scene: Sequence[str], more: Sequence[str] = ()) -> float:
    """Largest change of the path, over its range, per relative change of the normal force."""
    path, nudged = (solved(scene, more, c).columns["z_part"] for c in (0.0, NUDGE))
    return float(np.abs(nudged - path).max() / np.ptp(path)) / NUDGE


def ensemble(scene: Sequence[str], more: Sequence[str], members: int) -> Ensemble:
    """The statistics of runs whose normal forces differ by :data:`APART` from one to the next."""

    def member(k: int) -> dict[str, float]:
        summary: Any = solved(scene, more, APART * k).summary
        return {name: float(summary[name]) for name in STATISTICS}

    found = [member(k) for k in range(members)]
    return {name: [run[name] for run in found] for name in STATISTICS}


def report() -> Report:
    """The report on how far methods agree in the statistics of a chaotic scene."""
    grown = growth(SCENE)
    ensembles = {name: ensemble(SCENE, more, MEMBERS) for name, more in METHODS.items()}
    first = next(iter(ensembles.values()))
    most = max(apart(first[name], each[name]) for each in ensembles.values() for name in STATISTICS)
    message = (
        f"In a chaotic scene no two paths agree, but the methods' statistics do: {most:.1f} "
        "standard errors apart at most"
    )
    notes = [
        f"{message}.",
        f"The scene reference with {', '.join(SCENE)}. "
        f"A change of the normal force by {NUDGE:g} of "
        f"itself moves the path by {grown:.1e} times as much: chaotic (from {CHAOTIC:g}), so "
        f"statistics are compared and not paths. Means over {MEMBERS} runs of {DURATION:g} s whose "
        f"normal forces are apart by {APART:g}, ± their standard errors; in parentheses the "
        "distance from the first method's mean, in standard errors of the difference.",
    ]
    raw = [
        {"method": method, "run": k} | {name: values[k] for name, values in found.items()}
        for method, found in ensembles.items()
        for k in range(MEMBERS)
    ]
    table: list[Row] = [
        {"method": method} | {name: _cell(found[name], first[name]) for name in STATISTICS}
        for method, found in ensembles.items()
    ]
    return Report(
        "chaos", "A chaotic scene", raw, notes, {"Ensembles": table},
        {"": partial(draw, ensembles, message)}, message,
    )  # fmt: skip


def _cell(values: Sequence[float], first: Sequence[float]) -> str:
    middle, error = average(values)
    return f"{middle:.4g} ± {error:.2g} ({apart(values, first):.1f})"


_STATISTICS = {
    "v_average": ("mean velocity [mm/s]", 1e3),
    "stick_fraction": ("share of sticking [%]", 1e2),
    "impacts": ("impacts", 1.0),
    "stick_slip_events": ("changes of stick and slip", 1.0),
}
"""The figure's label of each statistic, and the factor to its unit."""


def draw(ensembles: Mapping[str, Ensemble], title: str) -> Picture:
    """Draw the values of each statistic by method: a tick for each run, and their mean."""
    note = "One tick a run; dot and bar: their mean with two standard errors."
    figure, axes = panels(title, note, (11.0, 3.4), len(_STATISTICS), sharey=True)
    for axis, (statistic, (label, scale)) in zip(axes, _STATISTICS.items(), strict=True):
        for place, found in enumerate(ensembles.values()):
            values = [scale * v for v in found[statistic]]
            middle, error = average(values)
            axis.plot(values, [place] * len(values), "|", color="0.55", ms=11)
            axis.errorbar(middle, place, xerr=2 * error, fmt="o", color=BLUE, capsize=4, lw=2)
        axis.locator_params(axis="x", nbins=4)
        axis.set(xlabel=label, ylim=(len(ensembles) - 0.4, -0.6))
    axes[0].set_yticks(range(len(ensembles)), list(ensembles))
    return figure
