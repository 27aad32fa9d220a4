"""The solvers that the accuracy study compares, their settings from coarse to fine, and their runs.

The error is the largest one over time of the signals that a case judges, over their range; the time
is CPU time.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from math import nan
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from cosim.coupling.methods import methods
from cosim.coupling.polynomials import Array
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import variants
from cosim.drive.command import command
from cosim.errors import SimulationFailed
from cosim.evaluate.store import Store
from cosim.scene import Scene, load
from cosim.simulation.choose_steps import LEVELS
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.cases import Case, participants, reference
from cosim.toolchain.processes import in_place

_WORSE = 1.5
"""An error this many times that of the next coarser setting marks a run as not monotone."""
_DIVERGED = 1.0  # error over range above which a run counts as diverged
NOT_MONOTONE, FALSE_CYCLE = "not monotone", "false limit cycle"

SAME_TIME = 1e-12
"""s; communication points this close before a jump are at it."""


@dataclass(frozen=True)
class Outcome:
    """A run: the signals that the case judges (signals × times), CPU seconds, circuit steps."""

    signals: Array
    seconds: float
    steps: int


Solve = Callable[[Scene, Case, float], Outcome]
"""Runs a case with a setting."""


@dataclass(frozen=True)
class Solver:
    """A method with its ``values`` of one ``setting`` from coarse to fine."""

    name: str
    setting: str
    run: Solve
    values: Callable[[Case], Sequence[float]]
    order: int | None = None
    """Order of convergence in ``setting`` on a smooth scene; None where that is no step length."""
    netlist: bool = False
    """Whether ngspice leads: its netlist has a leak, so it needs a reference with this leak."""
    peer: bool = False
    """Whether it is another program; its line always stands out."""
    limits: str = ""
    """Why it has no ``values`` for some scenes."""


class Jumps:
    """The jumps of a scene's command, whose times are known beforehand, one after another."""

    def __init__(self, scene: Scene) -> None:
        self._command = command(scene)
        self.next = self._command.next_jump(0.0)

    def meet(self, joint: Joint) -> None:
        """Restart the extrapolation if ``joint`` has reached the next jump."""
        if joint.time >= self.next - SAME_TIME:
            self.next = self._command.next_jump(self.next)
            joint.past.restart()


Advance = Callable[[Joint, Jumps, Case, float], Iterator[int]]
"""Takes both sides to each of a case's times in turn, and yields the number of steps so far."""


def rewinding(make: Callable[[Any, Any], Joint], advance: Advance) -> Solve:
    """A solver of participants that can repeat a step: ``make`` joins them, ``advance`` steps."""

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        jumps = Jumps(scene)
        circuit, mechanics = participants(scene)
        began, rows, steps = process_time(), [], 0
        with closing(mechanics):
            joint = make(circuit, mechanics)
            for so_far in advance(joint, jumps, case, setting):
                steps = so_far
                row = mechanics.sample() | {"current": float(joint.past.current.value[0])}
                rows.append([row[name] for name in case.judged])
        return Outcome(np.array(rows).T, process_time() - began, steps)

    return run


def _equal_steps(joint: Joint, jumps: Jumps, case: Case, step: float) -> Iterator[int]:
    """Macro steps of a fixed length."""
    each = round(case.times()[0] / step)  # macro steps from one sample to the next
    for k in range(len(case.times())):
        for _ in range(each):
            joint.step(step)
            jumps.meet(joint)
        yield (k + 1) * each + joint.cuts


def of_case(case: Case, *overrides: str) -> Scene:
    """The case's scene, with the case's duration and further overrides."""
    return load("reference", [*case.overrides, f"run.duration={case.duration!r}", *overrides])


def _led(*overrides: str) -> Solve:
    """A solver in which ngspice leads; ``{}`` in ``overrides`` is replaced by the setting."""

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        times = case.times()
        given = [text.format(repr(setting)) for text in overrides]
        chosen = of_case(case, f"run.output_step={times[0]!r}", *given)
        began = process_time()
        with in_place():
            result = simulate(chosen)
        seconds = process_time() - began
        steps = result.summary["circuit_steps"]
        assert isinstance(steps, int)
        found = [result.columns[name][1 : len(times) + 1] for name in case.judged]
        return Outcome(np.array(found), seconds, steps)

    return run


def _level(scene: Scene, case: Case, level: float) -> Outcome:
    """Run the default method with the tolerance and longest step of one of LEVELS."""
    reltol, max_step = LEVELS[round(level)]
    return _led(f"circuit.reltol={reltol!r}", "circuit.max_step={}")(scene, case, max_step)


def _halvings(first: float, count: int) -> list[float]:
    return [first * 0.5**k for k in range(count)]


def tenths(first: int, last: int) -> list[float]:
    return [10.0**-k for k in range(first, last + 1)]


def _steps(case: Case) -> list[float]:
    return _halvings(5e-5, 7) if case.smooth else _halvings(1.25e-3, 8)


DEFAULT = "step-locked (default), both"

SOLVERS = (
    *(
        Solver(name, "macro step [s]", rewinding(one.make, _equal_steps), _steps, one.order)
        for name, one in variants().items()
        if name != "iterated, plain"  # it has the solution of the accelerated ones
    ),
    Solver(
        "step-locked (default), max_step",
        "circuit.max_step [s]",
        # The tolerance is so loose that steps are as long as max_step.
        _led("circuit.max_step={}", "circuit.reltol=1e-2"),
        lambda case: _halvings(1e-4, 7),
        methods()["step-locked"]().order,
        netlist=True,
    ),
    Solver(
        "step-locked (default), reltol",
        "circuit.reltol",
        _led("circuit.reltol={}", "circuit.max_step=1e-4"),
        lambda case: tenths(2, 7),
        netlist=True,
    ),
    Solver(
        DEFAULT,
        "level of coupling.method = auto",
        _level,
        lambda case: range(len(LEVELS)),
        netlist=True,
    ),
    *(
        Solver(
            f"{name} in ngspice",
            "coupling.macro_step [s]",
            # ngspice's own steps are so fine that the macro steps decide.
            _led(
                *("coupling.macro_step={}", f"coupling.method={name}"),
                *("circuit.reltol=1e-6", "circuit.max_step=1e-5"),
            ),
            lambda case: _halvings(1e-3, 6),
            kind().order,
            netlist=True,
        )
        for name, kind in sorted(methods().items())
        if name != "step-locked"
    ),
)
"""Every line of the diagrams."""


@dataclass(frozen=True)
class Run:
    """One point of a diagram, a row of ``accuracy.csv``; ``error`` is nan where the run failed."""

    scene: str
    method: str
    setting: str
    value: float
    error: float
    seconds: float
    """CPU time, of a failed run until it failed."""
    steps: int
    """Steps of the circuit, which may be macro steps; 0 where unknown."""
    failure: str

    @property
    def counts(self) -> bool:
        """Whether the error is meaningful: not of a failed or diverged run or false limit cycle."""
        return self.failure in ("", NOT_MONOTONE)


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

    taken: list[list[tuple[float, float, int, str]]] = [[] for _ in plan]
    for turn in range(rounds):
        for (solver, value), known in zip(plan, taken, strict=True):
            # Failed runs, and those that took over 1 s, are not repeated for their time.
            if not known or not (known[0][3] or known[0][0] > 1.0):
                name = f"{case.name}, {solver.name}, {value!r}, {turn}"
                known.append(store.once(name, partial(once, solver, value)))
    runs: list[Run] = []
    for (solver, value), known in zip(plan, taken, strict=True):
        _, error, steps, failure = known[0]
        if not failure:
            before = runs[-1] if runs and runs[-1].method == solver.name else None
            if error > _DIVERGED:
                failure = "diverged"
            elif before is not None and error > _WORSE * before.error:
                failure = NOT_MONOTONE
        given = (case.name, solver.name, solver.setting, value)
        runs.append(Run(*given, error, median(seconds for seconds, *_ in known), steps, failure))
    return runs
