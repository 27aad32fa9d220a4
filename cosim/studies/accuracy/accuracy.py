"""Speed against accuracy of every method and setting on four scenes.

From the runs follow orders, errors at equal run time, the report and its figure.
"""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from itertools import accumulate
from math import ceil, exp, inf, isfinite, log, nan
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes

from cosim.evaluate.store import Store, reported
from cosim.files.picture import Picture
from cosim.studies.accuracy.cases import CASES, reference
from cosim.studies.accuracy.solvers import DEFAULT, SOLVERS, Run, Solver, measure
from cosim.studies.plots import (
    BLUE,
    FAINT,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    legend,
    panels,
)
from cosim.studies.report import Progress, Report, Row, brief, silent, span
from cosim.typed import typed

EQUAL_TIME, EQUAL_ERROR = 0.5, 1e-3
"""CPU seconds, and error over range, at which methods are compared."""
CHAOTIC = 1e4
"""Growth of a small difference above which a scene is chaotic: single paths are not compared."""
_HALVINGS = 4  # of the setting, over which an order is fitted

_ROUNDS = 3  # in which all runs are timed, for a median
_COLORS = VERMILION, SKY, BLUE, GREEN, ORANGE, "black", PURPLE
_STYLES = tuple(zip(_COLORS, "ovsD^PX", strict=True))
"""Colours and markers of the methods that stand out (``Comparison.strong``), in their order."""


def order(runs: Sequence[Run]) -> float:
    """Slope of log error over log step, fitted to the finest settings; nan if too few."""
    known = [run for run in runs if run.counts and run.error > 0.0]
    last = known[-_HALVINGS - 1 :]
    if len(last) <= _HALVINGS or not last[0].setting.endswith("[s]"):
        return nan
    x, y = [log(run.value) for run in last], [log(run.error) for run in last]
    return float(np.polyfit(x, y, 1)[0])


def _front(runs: Sequence[Run]) -> tuple[list[float], list[float]]:
    """The Pareto front: logarithms of CPU time, rising, and of the least error up to this time."""
    # A finer setting may be worse by chance; nobody would choose it: hence the least error so far.
    known = sorted((run.seconds, run.error) for run in runs if run.counts and run.error > 0.0)
    errors = accumulate((log(error) for _, error in known), min)
    return [log(seconds) for seconds, _ in known], list(errors)


def error_in(runs: Sequence[Run], seconds: float) -> float:
    """Least error within a CPU time (s), interpolated; nan where all runs take longer."""
    times, errors = _front(runs)
    return exp(np.interp(log(seconds), times, errors, left=nan)) if times else nan


def time_to(runs: Sequence[Run], error: float) -> float:
    """Least CPU time (s) for an error, interpolated; nan where no run reaches it."""
    times, errors = _front(runs)
    if not times or errors[-1] > log(error):
        return nan
    # Errors fall with time; np.interp needs rising abscissae, hence the signs.
    return exp(np.interp(-log(error), [-e for e in errors], times))


class Comparison:
    """The runs by scene and method. The strong methods stand out in the figure: the default, the
    best of each order among those with macro steps, and other programs."""

    def __init__(self, runs: Sequence[Run], solvers: Sequence[Solver]) -> None:
        self.runs, self.solvers = runs, solvers
        self.scenes = list(dict.fromkeys(run.scene for run in runs))
        self.strong = {"step-locked\n(default)": DEFAULT}
        """Names of the strong methods, by their labels."""
        self._stepping = [one for one in solvers if "macro" in one.setting and one.order]
        """Solvers whose setting is the length of a macro step."""
        for p in sorted({solver.order for solver in self._stepping if solver.order}):
            best = min((s for s in self._stepping if s.order == p), key=self._mean)
            self.strong[f"order {p}:\n{best.name}"] = best.name
        self.strong |= {fill(one.name, 14): one.name for one in solvers if one.peer}

    def of(self, scene: str, method: str) -> list[Run]:
        return [run for run in self.runs if run.scene == scene and run.method == method]

    def _error(self, scene: str, method: str) -> float:
        return error_in(self.of(scene, method), EQUAL_TIME)

    def _mean(self, solver: Solver) -> float:
        """Geometric mean over the scenes of the error at equal time; inf if one is unknown."""
        found = [self._error(scene, solver.name) for scene in self.scenes]
        return exp(sum(map(log, found)) / len(found)) if all(map(isfinite, found)) else inf

    def lead(self, scene: str) -> float:
        """The error of the best macro-step method over that of the default, in equal time."""
        others = (self._error(scene, solver.name) for solver in self._stepping)
        return min(filter(isfinite, others), default=nan) / self._error(scene, DEFAULT)

    @property
    def message(self) -> str:
        """The title of the figure."""
        rough = [self.lead(scene) for scene in self.scenes if not CASES[scene].smooth]
        smooth = [self.lead(scene) for scene in self.scenes if CASES[scene].smooth]
        said = (
            f"In equal time the default is {span(rough)} times as "
            "accurate as the best macro-step method where the part slips or strikes"
        )
        for lead in smooth:
            winner, times = ("the default", lead) if lead >= 1.0 else ("that method", 1.0 / lead)
            said += f"; where nothing jumps {winner} is {brief(times)} times as accurate"
        return said

    def compared(self) -> list[Row]:
        """The strong methods: error in equal time, and time for equal error."""
        rows: list[Row] = []
        for label, name in self.strong.items():
            errors = {f"{s}: error": brief(self._error(s, name)) for s in self.scenes}
            times = {
                f"{s}: time [s]": brief(time_to(self.of(s, name), EQUAL_ERROR)) for s in self.scenes
            }
            rows.append({"line": label.replace("\n", " ")} | errors | times)
        return rows

    def method(self, solver: Solver) -> Row:
        """A method: its order, that fitted on each scene, failures, and missing lines."""
        own = {scene: self.of(scene, solver.name) for scene in self.scenes}
        failures = Counter(run.failure for runs in own.values() for run in runs if run.failure)
        absent: dict[str, list[str]] = {}
        for scene, runs in own.items():
            if not any(run.counts for run in runs):
                absent.setdefault("every run failed" if runs else solver.limits, []).append(scene)
        return {
            **{"method": solver.name, "order if smooth": solver.order or "-"},
            **{scene: round(order(runs), 2) for scene, runs in own.items()},
            "marked runs": ", ".join(f"{n} {text}" for text, n in failures.items()),
            "not drawn": "; ".join(f"{', '.join(at)}: {why}" for why, at in absent.items()),
        }


@typed
def accuracy(
    *,
    quick: bool = False,
    out: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
    more: Sequence[Solver] = (),
) -> Report:
    """The error of every coupling method over its run time; ``quick``: on one scene; ``more``:
    other solvers that are to be lines besides.

    Each of the report's ``rows`` is a run: ``scene``, ``method``, ``setting`` (name and unit of
    what is varied), its ``value``, ``error`` (of the part's height, as a share of its range; nan
    where the run failed), ``seconds`` of CPU time, ``steps`` of the circuit and ``failure``.
    ``tables`` compare the methods at equal time and error, and tell each one's order.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an
    interrupted study has left there. Raises BadInput.
    """
    solvers = (*SOLVERS, *more)
    cases = [case for case in CASES.values() if not case.netlist][-1 if quick else 0 :]

    def made(store: Store) -> Report:
        runs: list[Run] = []
        for done, case in enumerate(cases, 1):
            runs += measure(case, solvers, 1 if quick else _ROUNDS, store)
            progress(done, len(cases), case.title)
        return report(runs, solvers)

    return reported(made, out, "accuracy.sqlite", quick)


def report(runs: Sequence[Run], solvers: Sequence[Solver] = SOLVERS) -> Report:
    study = Comparison(runs, solvers)
    trust = max(reference(name).other_method for name in study.scenes)
    growth = max(reference(name).growth for name in study.scenes)
    notes = [
        "Error: greatest over time of the part's height (on the smooth scene of the positions and "
        "velocity of ram and surface and the current too), in units of its range, against a "
        "monolithic solution by SUNDIALS restarted at each event, which differs from another "
        f"integration method by at most {trust:.1e}. Time: CPU seconds, median of interleaved "
        "runs where it is short. The default and the methods in ngspice share one compiled loop; "
        "the other methods run between participants in Python, so times are like for like within "
        "each of these groups only. Every run is in accuracy.csv.",
        "Scenes: " + "; ".join(CASES[name].title for name in study.scenes) + ". A change of the "
        f"normal force by 1e-9 of itself moves their paths by at most {growth:.2g} times as much: "
        f"none is chaotic. From {CHAOTIC:g} on only statistics can be compared.",
        f"{study.message}.",
    ]
    tables = {
        f"The strong lines: error in {EQUAL_TIME:g} s, time for an error of {EQUAL_ERROR:g} "
        "(interpolated between runs)": study.compared(),
        "Every method: order in its step, fitted over the last four halvings": [
            study.method(solver) for solver in solvers
        ],
    }
    figure = partial(draw, runs, study.strong, study.message)
    return Report(
        "accuracy", "Speed against accuracy", [asdict(run) for run in runs], notes, tables,
        {"": figure}, study.message,
    )  # fmt: skip


def draw(runs: Sequence[Run], strong: Mapping[str, str], title: str) -> Picture:
    """Draw error over CPU time, a panel for each scene; ``strong`` are methods' names by label."""
    scenes = list(dict.fromkeys(run.scene for run in runs))
    wide = min(len(scenes), 2)
    note = (
        "Dots: runs of the other methods. ×: diverged; at the top edge: failed or in a false limit "
        "cycle."
    )
    size = (5.5 * wide, 4.0 * ceil(len(scenes) / wide) + 0.5)
    figure, axes = panels(title, note, size, len(scenes), wide)
    for axis, scene in zip(axes, scenes, strict=True):
        _panel(axis, [run for run in runs if run.scene == scene], strong)
        axis.set_title(CASES[scene].title, fontsize=10.5, loc="left")
        axis.set(xlabel="CPU time [s]", ylabel="error / range")
    legend(figure, axes, loc="outside right center", fontsize=9)
    return figure


def _panel(axis: Axes, runs: Sequence[Run], strong: Mapping[str, str]) -> None:
    axis.set(xscale="log", yscale="log")
    styles = dict(zip(strong.values(), zip(strong, _STYLES, strict=False), strict=True))
    for method in dict.fromkeys(run.method for run in runs):
        own = [run for run in runs if run.method == method]
        label, (color, marker) = styles.get(method, ("", ("0.6", "")))
        known = [run for run in own if run.counts]
        x, y = [run.seconds for run in known], [run.error for run in known]
        if label and known:
            axis.plot(x, y, color=color, marker=marker, ms=4.5, lw=2.0, label=label)
        else:
            axis.plot(x, y, **FAINT)
        for run in own:
            if not run.counts:  # a failure without an error is marked at the top
                finite = isfinite(run.error)
                across = axis.transData if finite else axis.get_xaxis_transform()
                place = (run.seconds, run.error if finite else 0.97)
                axis.plot(*place, "x", color=color, ms=7, mew=1.8, transform=across)
