"""The runs of the accuracy study: every method and setting on a scene, against its reference.

The error is the greatest over time of what a scene judges, in units of its range; the time is the
process's CPU time. References were calculated once (``reference.json``).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from math import nan
from statistics import median
from time import process_time

import numpy as np

from cosim.errors import SimulationFailed
from cosim.evaluate.store import Store
from cosim.scene import load
from cosim.studies.accuracy.cases import Case
from cosim.studies.accuracy.solvers import Solver

_WORSE = 1.5
"""An error this many times that of the next coarser setting marks a run as not monotone."""
_DIVERGED = 1.0
NOT_MONOTONE, FALSE_CYCLE = "not monotone", "false limit cycle"


@dataclass(frozen=True)
class Run:
    """One point of a diagram, a row of ``accuracy.csv``; ``error`` is nan where the run failed."""

    scene: str
    method: str
    setting: str
    value: float
    error: float
    seconds: float
    """CPU time, until it failed where it did."""
    steps: int
    """Of the circuit; macro steps where these are the circuit's; 0 where unknown."""
    failure: str

    @property
    def counts(self) -> bool:
        """Whether its error is one: not that of a false limit cycle, nor of a diverged run."""
        return self.failure in ("", NOT_MONOTONE)


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


def measure(case: Case, solvers: Sequence[Solver], rounds: int, store: Store) -> list[Run]:
    """All settings of all solvers on a scene, interleaved; times are medians over the rounds."""
    scene = load("reference", case.overrides)
    plan = [(solver, value) for solver in solvers for value in solver.values(case)]

    def once(solver: Solver, value: float) -> tuple[float, float, int, str]:
        """CPU time (s), error, steps and failure of a run."""
        began = process_time()
        try:
            outcome = solver.run(scene, case, value)
        except SimulationFailed as failed:
            failure = FALSE_CYCLE if "limit cycle" in str(failed) else "failed"
            return process_time() - began, nan, 0, failure
        leaky = case.smooth and solver.netlist
        judge = reference(f"{case.name}, netlist" if leaky else case.name)
        return outcome.seconds, judge.error(outcome.signals), outcome.steps, ""

    done: list[tuple[float, float, int, str]] = []
    seconds: list[list[float]] = [[] for _ in plan]
    for turn in range(rounds):
        for k, (solver, value) in enumerate(plan):
            if turn and (done[k][3] or seconds[k][0] > 1.0):
                continue
            name = f"{case.name}, {solver.name}, {value!r}, {turn}"
            found = store.once(name, lambda solver=solver, value=value: once(solver, value))
            seconds[k].append(found[0])
            if not turn:
                done.append(found)
    runs: list[Run] = []
    for (solver, value), (_, error, steps, failure), spent in zip(plan, done, seconds, strict=True):
        if not failure:
            before = runs[-1] if runs and runs[-1].method == solver.name else None
            if error > _DIVERGED:
                failure = "diverged"
            elif before is not None and error > _WORSE * before.error:
                failure = NOT_MONOTONE
        given = (case.name, solver.name, solver.setting, value)
        runs.append(Run(*given, error, median(spent), steps, failure))
    return runs
