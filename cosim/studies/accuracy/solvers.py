"""What the accuracy study compares: each solver with its ladder of settings, and how it is run."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from cosim.coupling.methods import methods
from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.polynomials import Array
from cosim.coupling.rewind.error_control import ErrorControlled
from cosim.coupling.rewind.event_aware import EventAware
from cosim.coupling.rewind.iterated import Iterated
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import METHODS, ORDERS, Make
from cosim.coupling.rewind.predictor_corrector import PredictorCorrector
from cosim.drive.command import command
from cosim.scene import Scene, load
from cosim.simulation.choose_steps import LEVELS
from cosim.studies.accuracy.cases import Case, participants
from cosim.toolchain.processes import in_place

_SAME_TIME = 1e-12


@dataclass(frozen=True)
class Outcome:
    """What the case judges (rows) at its times, CPU seconds, and steps of the circuit."""

    signals: Array
    seconds: float
    steps: int


@dataclass(frozen=True)
class Solver:
    """A method with its settings from coarse to fine; ``setting`` is what they are."""

    name: str
    setting: str
    run: Callable[[Scene, Case, float], Outcome]
    values: Callable[[Case], Sequence[float]]
    order: int | None = None
    """Order in ``setting`` where all is smooth; None where it is not a step."""
    netlist: bool = False
    """Whether ngspice leads, whose netlist has a leak of its own."""
    limits: str = ""
    """Why some scenes have no ``values``."""

    @property
    def takes_macro_steps(self) -> bool:
        """Whether its setting is the length of a macro step."""
        return "macro" in self.setting and self.order is not None


class _Jumps:
    """The jumps of a scene's command, which are known beforehand, in turn."""

    def __init__(self, scene: Scene) -> None:
        self._command = command(scene)
        self.next = self._command.next_jump(0.0)

    def meet(self, method: Joint) -> None:
        """The extrapolation begins anew where the method has reached a jump."""
        if method.time >= self.next - _SAME_TIME:
            self.next = self._command.next_jump(self.next)
            method.restart()


Advance = Callable[[Joint, _Jumps, Case, float], Iterator[int]]
"""Takes a method from each of a case's times to the next; gives the steps of the circuit so far."""


def _rewinding(make: Make, advance: Advance) -> Callable[[Scene, Case, float], Outcome]:
    """With participants that can go back."""

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        jumps = _Jumps(scene)
        circuit, mechanics = participants(scene)
        began, rows, steps = process_time(), [], 0
        with closing(mechanics):
            method = make(circuit, mechanics)
            for so_far in advance(method, jumps, case, setting):
                steps = so_far
                row = mechanics.sample() | {"current": float(method.past.current.value[0])}
                rows.append([row[name] for name in case.judged])
        return Outcome(np.array(rows).T, process_time() - began, steps)

    return run


def _equal_steps(
    method: Joint, jumps: _Jumps, case: Case, step: float, events: bool = False
) -> Iterator[int]:
    """Macro steps of a fixed length."""
    stepper, cut = (EventAware(method, within=1e-8) if events else method), 0
    each = round(case.times()[0] / step)
    for k in range(len(case.times())):
        for _ in range(each):
            stepper.step(step)
            jumps.meet(method)
        cut = stepper.events if isinstance(stepper, EventAware) else 0
        yield (k + 1) * each + cut


def _controlled(
    method: Joint, jumps: _Jumps, case: Case, tolerance: float, audited: bool = False
) -> Iterator[int]:
    """With Richardson's estimate, cut at jumps of the command and at samples.

    An audit lets half of the tolerance's power of 2/3 be lost of the power: a residual is of order
    2 in a step that goes with the cube root of the tolerance.
    """
    share = 0.5 * tolerance ** (2.0 / 3.0) if audited else None
    control = ErrorControlled(
        method, 1, 1e-5, tolerance, tolerance, shortest=1e-9, energy_share=share
    )
    for time in case.times():
        while method.time < time - _SAME_TIME:
            control.run(min(time, jumps.next))
            jumps.meet(method)
        yield 3 * (control.accepted // 2 + control.rejected)


def _led(*overrides: str) -> Callable[[Scene, Case, float], Outcome]:
    """ngspice leads; ``overrides`` contain ``{}`` where the setting goes."""

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        from cosim.simulation.simulate import simulate

        times = case.times()
        given = [text.format(repr(setting)) for text in overrides]
        chosen = _over(case, f"run.output_step={times[0]!r}", *given)
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
    reltol, max_step = LEVELS[round(level)]
    return _led(f"circuit.reltol={reltol!r}", "circuit.max_step={}")(scene, case, max_step)


def _all_in_ngspice(scene: Scene, case: Case, reltol: float) -> Outcome:
    from cosim.simulation.peers.ngspice_alone import run

    chosen = _over(case, "circuit.max_step=1e-4", f"circuit.reltol={reltol!r}")
    seconds, path = run(chosen, case.times())
    return Outcome(path[np.newaxis], seconds, 0)


def _solve_ivp(scene: Scene, case: Case, rtol: float) -> Outcome:
    from cosim.simulation.peers.lsoda import run

    seconds, path = run(_over(case), case.times(), rtol)
    return Outcome(path[np.newaxis], seconds, 0)


def _over(case: Case, *overrides: str) -> Scene:
    """The case's scene as long as it is studied."""
    return load("reference", [*case.overrides, f"run.duration={case.duration!r}", *overrides])


def _halvings(first: float, count: int) -> list[float]:
    return [first * 0.5**k for k in range(count)]


def _tenths(first: int, last: int) -> list[float]:
    return [10.0**-k for k in range(first, last + 1)]


def _steps(case: Case) -> list[float]:
    return _halvings(5e-5, 7) if case.smooth else _halvings(1.25e-3, 8)


def _fixed(name: str, make: Make, order: int, events: bool = False) -> Solver:
    run = _rewinding(make, partial(_equal_steps, events=events))
    return Solver(name, "macro step [s]", run, _steps, order)


def _with_control(name: str, audited: bool) -> Solver:
    run = _rewinding(
        lambda a, b: Joint(a, b, Jacobi(1, slopes=False)), partial(_controlled, audited=audited)
    )
    return Solver(name, "tolerance", run, lambda case: _tenths(1, 4))


def _peer(
    name: str, setting: str, run: Callable[[Scene, Case, float], Outcome], values: list[float]
) -> Solver:
    limits = "knows compliant walls and the sawtooth only"
    known = ("stick-slip", "reference")
    return Solver(
        name, setting, run, lambda case: values if case.name in known else [], limits=limits
    )


_EVENT_AWARE = "EMF's slope, linear current"
_ITERATED = ORDERS["iterated, Newton"]
DEFAULT = "step-locked (default), both"
ALL_IN_NGSPICE, LSODA = "all in ngspice", "SciPy's LSODA with events"

SOLVERS = (
    *(_fixed(name, make, ORDERS[name]) for name, make in METHODS.items() if "plain" not in name),
    _fixed("event-aware", METHODS[_EVENT_AWARE], ORDERS[_EVENT_AWARE], events=True),
    _fixed("predictor-corrector", PredictorCorrector, _ITERATED),
    _fixed("iterated, Aitken", lambda a, b: Iterated(a, b, "aitken", tolerance=1e-9), _ITERATED),
    _fixed(
        "iterated, Anderson", lambda a, b: Iterated(a, b, "anderson", tolerance=1e-9), _ITERATED
    ),
    _with_control("error-controlled", audited=False),
    _with_control("error-controlled, audited", audited=True),
    Solver(
        "step-locked (default), max_step",
        "circuit.max_step [s]",
        # So loose that steps are as long as they may be.
        _led("circuit.max_step={}", "circuit.reltol=1e-2"),
        lambda case: _halvings(1e-4, 7),
        methods()["step-locked"]().order,
        netlist=True,
    ),
    Solver(
        "step-locked (default), reltol",
        "circuit.reltol",
        _led("circuit.reltol={}", "circuit.max_step=1e-4"),
        lambda case: _tenths(2, 7),
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
    _peer(ALL_IN_NGSPICE, "circuit.reltol", _all_in_ngspice, _tenths(4, 9)),
    _peer(LSODA, "tolerance", _solve_ivp, _tenths(3, 6)),
)
"""Every line of the diagrams."""
