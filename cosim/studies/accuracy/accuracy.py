"""Speed against accuracy: every method and setting on four scenes, against a reference solution.

The error is the greatest over time of what a scene judges, in units of its range; the time is the
process's CPU time. References were calculated once (``reference.json``).
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from math import isfinite, log, nan
from pathlib import Path
from statistics import median

import numpy as np

from cosim.errors import SimulationFailed
from cosim.scene import Scene, load
from cosim.studies.accuracy import chaos, friction
from cosim.studies.accuracy.cases import CASES, Case
from cosim.studies.accuracy.solvers import SOLVERS, Outcome, Solver
from cosim.studies.study import Row, write

_WORSE = 1.5
"""An error this many times that of the next coarser setting marks a run as not monotone."""
_ROUNDS = 3
_DIVERGED = 1.0
_HALVINGS = 4  # over which an order is fitted


@dataclass(frozen=True)
class Run:
    """One point of a diagram; ``error`` is nan where the run failed."""

    case: str
    solver: Solver
    setting: float
    error: float
    seconds: float
    steps: int
    failure: str

    @property
    def good(self) -> bool:
        return not self.failure


@dataclass(frozen=True)
class Reference:
    """A scene's reference solution and how far it can be trusted."""

    signals: np.ndarray
    other_method: float
    growth: float

    def error(self, found: np.ndarray) -> float:
        """Greatest over time and signals, in units of their ranges; inf if it left the numbers."""
        off = np.abs(found - self.signals).max(axis=1) / np.ptp(self.signals, axis=1)
        return float(off.max()) if np.isfinite(off).all() else np.inf


def reference(name: str) -> Reference:
    """That of a case of :data:`cosim.studies.accuracy.cases.CASES`."""
    text = (files("cosim.studies.accuracy") / "reference.json").read_text(encoding="utf-8")
    entry = json.loads(text)["cases"][name]
    signals = np.array(list(entry["signals"].values()))
    return Reference(signals, entry["other_method"], entry["growth"])


def measure(case: Case, solvers: Sequence[Solver], rounds: int) -> list[Run]:
    """All settings of all solvers on a scene, interleaved; times are medians over the rounds."""
    scene = load("paper", case.overrides)
    plan = [(solver, value) for solver in solvers for value in solver.values(case)]
    seconds: list[list[float]] = [[] for _ in plan]
    outcomes: list[Outcome | str] = []
    for turn in range(rounds):
        for k, (solver, value) in enumerate(plan):
            if turn and (isinstance(outcomes[k], str) or seconds[k][0] > 1.0):
                continue
            outcome = _attempt(solver, scene, case, value)
            if not isinstance(outcome, str):
                seconds[k].append(outcome.seconds)
            if not turn:
                outcomes.append(outcome)
    return _judged(case, plan, outcomes, [median(s) if s else nan for s in seconds])


def _attempt(solver: Solver, scene: Scene, case: Case, value: float) -> Outcome | str:
    try:
        return solver.run(scene, case, value)
    except SimulationFailed as error:
        return "false limit cycle" if "limit cycle" in str(error) else "failed"


def _judged(
    case: Case,
    plan: Sequence[tuple[Solver, float]],
    outcomes: Sequence[Outcome | str],
    seconds: Sequence[float],
) -> list[Run]:
    runs: list[Run] = []
    for (solver, value), outcome, time in zip(plan, outcomes, seconds, strict=True):
        if isinstance(outcome, str):
            runs.append(Run(case.name, solver, value, nan, time, 0, outcome))
            continue
        leaky = case.smooth and solver.family == "ngspice leads"
        error = reference(f"{case.name}, netlist" if leaky else case.name).error(outcome.signals)
        before = runs[-1] if runs and runs[-1].solver is solver else None
        failure = ""
        if error > _DIVERGED:
            failure = "diverged"
        elif before is not None and error > _WORSE * before.error:
            failure = "not monotone"
        runs.append(Run(case.name, solver, value, error, time, outcome.steps, failure))
    return runs


def order(runs: Sequence[Run]) -> float:
    """Slope of log error over log setting, fitted to the last halvings; nan where it has none."""
    known = [run for run in runs if isfinite(run.error) and run.error > 0.0]
    if not known or not known[0].solver.setting.endswith("[s]"):
        return nan
    last = known[-_HALVINGS - 1 :]
    if len(last) <= _HALVINGS:
        return nan
    x, y = [log(run.setting) for run in last], [log(run.error) for run in last]
    return float(np.polyfit(x, y, 1)[0])


def slopes(runs: Sequence[Run]) -> Iterator[Row]:
    """A row a method: its order in theory where all is smooth, and fitted on each scene."""
    for solver in SOLVERS:
        own = [run for run in runs if run.solver is solver]
        row: Row = {"method": solver.name, "order if smooth": solver.order or "-"}
        for case in dict.fromkeys(run.case for run in runs):
            row[case] = round(order([run for run in own if run.case == case]), 2)
        if any(isfinite(v) for v in row.values() if isinstance(v, float)):
            yield row


def _rows(runs: Sequence[Run]) -> list[Row]:
    return [
        {
            "scene": run.case,
            "method": run.solver.name,
            "setting": run.solver.setting,
            "value": run.setting,
            "error": run.error,
            "CPU time [s]": run.seconds,
            "circuit steps": run.steps or "-",
            "failure": run.failure,
        }
        for run in runs
    ]


def run(out: Path, quick: bool) -> None:
    """Write ``accuracy`` as png, csv, md and json into ``out``, and print the orders."""
    from cosim.studies.accuracy.figure import draw

    names = [name for name, case in CASES.items() if not case.netlist]
    names = names[-1:] if quick else names
    runs: list[Run] = []
    for name in names:
        runs += measure(CASES[name], SOLVERS, 1 if quick else _ROUNDS)
    fitted = list(slopes(runs))
    trust = max(reference(name).other_method for name in names)
    growth = max(reference(name).growth for name in names)
    notes = [
        "Error: greatest over time of the part's height (on the smooth scene of the positions and "
        "velocity of ram and surface and the current too), in units of its range, against a "
        "monolithic solution by SUNDIALS restarted at each event, which differs from another "
        f"integration method by at most {trust:.1e}. Time: CPU seconds, median of {_ROUNDS} "
        "interleaved runs where it is short.",
        "The default method has no floor here. Two that it once had were a first step after each "
        "jump of the command that did not become shorter with the others (0.1 µs of first order, "
        "42 µA: 1e-6 at stick-slip), and the reference's own end of rigid bouncing at 1 µm/s, now "
        "10 nm/s (5e-7 at impacts).",
        f"A change of the normal force by 1e-9 of itself moves the path by at most {growth:.2g} "
        f"times as much: none of these scenes is chaotic. From {chaos.CHAOTIC:g} on only "
        "statistics are compared, as chaos.md does.",
    ]
    tables = {"Runs": _rows(runs), "Orders, fitted over the last four halvings": fitted}
    write(out, "accuracy", "Speed against accuracy", tables, notes)
    draw(runs, out)
    friction.run(out)
    chaos.run(out)
    for row in fitted:
        print(
            "  ".join(
                f"{cell!s:<32}" if k == 0 else f"{cell!s:>6}" for k, cell in enumerate(row.values())
            )
        )
    studies = (
        "accuracy.{csv,md,json,png}, accuracy-steps.png, friction.{csv,md,json,png}, "
        "chaos.{csv,md,json,png}"
    )
    print(f"Written to {out}: {studies}")
