"""What the accuracy study compares: each solver with its ladder of settings, and how it is run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from time import process_time
from typing import Any, Literal

import numpy as np

from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.polynomials import Array
from cosim.coupling.rewind.error_control import ErrorControlled
from cosim.coupling.rewind.event_aware import EventAware
from cosim.coupling.rewind.iterated import Iterated
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import METHODS, ORDERS
from cosim.coupling.rewind.predictor_corrector import PredictorCorrector
from cosim.drive.command import command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, load
from cosim.simulation.choose_steps import LEVELS
from cosim.studies.accuracy.cases import Case, participants

Family = Literal["macro steps", "ngspice leads", "peers"]

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
    family: Family
    setting: str
    run: Callable[[Scene, Case, float], Outcome]
    values: Callable[[Case], Sequence[float]]
    order: int | None = None
    """Order in ``setting`` where all is smooth; None where it is not a step."""
    limits: str = ""
    """Why some scenes have no ``values``."""

    @property
    def takes_macro_steps(self) -> bool:
        """Whether its setting is the length of a macro step."""
        return "macro" in self.setting and self.order is not None


Make = Callable[[Any, Any], Joint]


def _macro(make: Make, events: bool = False) -> Callable[[Scene, Case, float], Outcome]:
    """Macro steps of a fixed length with participants that can go back; the extrapolation begins
    anew at jumps of the command, which are known beforehand."""

    def run(scene: Scene, case: Case, step: float) -> Outcome:
        with_jumps = _Jumps(scene)
        circuit, mechanics = participants(scene)
        began, rows, steps = process_time(), [], 0
        try:
            method = make(circuit, mechanics)
            stepper = EventAware(method, within=1e-8) if events else method
            each = round(case.times()[0] / step)
            for k in range(round(case.duration / step)):
                stepper.step(step)
                steps += 1
                if with_jumps.passed(method.time):
                    method.restart()
                if (k + 1) % each == 0:
                    rows.append(_sample(method, mechanics, case))
        finally:
            mechanics.close()
        steps += stepper.events if isinstance(stepper, EventAware) else 0
        return Outcome(np.array(rows).T, process_time() - began, steps)

    return run


def _audited(scene: Scene, case: Case, tolerance: float) -> Outcome:
    return _controlled(scene, case, tolerance, energy_share=_AUDITED * tolerance ** (2.0 / 3.0))


def _controlled(
    scene: Scene, case: Case, tolerance: float, energy_share: float | None = None
) -> Outcome:
    """Jacobi k = 1 with Richardson's estimate, cut at jumps of the command and at samples."""
    jumps = _Jumps(scene)
    circuit, mechanics = participants(scene)
    began, rows = process_time(), []
    try:
        method = Joint(circuit, mechanics, Jacobi(1, slopes=False))
        control = ErrorControlled(
            method, 1, 1e-5, tolerance, tolerance, shortest=1e-9, energy_share=energy_share
        )
        for time in case.times():
            while method.time < time - _SAME_TIME:
                control.run(min(time, jumps.next))
                if jumps.passed(method.time):
                    method.restart()
            rows.append(_sample(method, mechanics, case))
    finally:
        mechanics.close()
    steps = 3 * (control.accepted // 2 + control.rejected)
    return Outcome(np.array(rows).T, process_time() - began, steps)


def _sample(method: Joint, mechanics: Mechanics, case: Case) -> list[float]:
    row: dict[str, float] = mechanics.sample()
    current = float(method.past.current.value[0])
    return [current if name == "current" else row[name] for name in case.judged]


class _Jumps:
    """The jumps of a scene's command, in turn."""

    def __init__(self, scene: Scene) -> None:
        self._command = None if scene.drive.waveform == "sine" else command(scene)
        self.next = inf if self._command is None else self._command.next_jump(0.0)

    def passed(self, time: float) -> bool:
        """Whether ``time`` (s) has reached a jump that was not told before."""
        if self._command is None or time < self.next - _SAME_TIME:
            return False
        self.next = self._command.next_jump(self.next)
        return True


def _led(*overrides: str) -> Callable[[Scene, Case, float], Outcome]:
    """ngspice leads; ``overrides`` contain ``{}`` where the setting goes."""

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        from cosim.simulation.simulate import simulate

        given = [text.format(repr(setting)) for text in overrides]
        times = case.times()
        given += [f"run.duration={case.duration!r}", f"run.output_step={times[0]!r}"]
        chosen = load("paper", [*case.overrides, *given])
        began = process_time()
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

    seconds, path = run(_for_peer(case, f"circuit.reltol={reltol!r}"), case.times())
    return Outcome(path[np.newaxis], seconds, 0)


def _solve_ivp(scene: Scene, case: Case, rtol: float) -> Outcome:
    from cosim.simulation.peers.lsoda import run

    chosen = _for_peer(case)
    mechanics = Mechanics(chosen)
    try:
        row = mechanics.sample()
    finally:
        mechanics.close()
    seconds, path = run(chosen, case.times(), (row["z_surface"], row["z_ram"]), rtol)
    return Outcome(path[np.newaxis], seconds, 0)


def _for_peer(case: Case, *overrides: str) -> Scene:
    given = [f"run.duration={case.duration!r}", "circuit.max_step=1e-4", *overrides]
    return load("paper", [*case.overrides, *given])


def _peers_reltols(case: Case) -> Sequence[float]:
    return [10.0**-k for k in range(4, 10)] if case.name in ("stick-slip", "paper") else []


def _peers_rtols(case: Case) -> Sequence[float]:
    return [10.0**-k for k in range(3, 7)] if case.name in ("stick-slip", "paper") else []


def _halvings(first: float, count: int) -> list[float]:
    return [first * 0.5**k for k in range(count)]


def _steps(case: Case) -> Sequence[float]:
    return _halvings(5e-5, 7) if case.smooth else _halvings(1.25e-3, 8)


def _control(case: Case) -> Sequence[float]:
    return [10.0**-k for k in range(1, 5)]


def _reltols(case: Case) -> Sequence[float]:
    return [10.0**-k for k in range(2, 8)]


def _max_steps(case: Case) -> Sequence[float]:
    return _halvings(1e-4, 7)


def _macro_steps(case: Case) -> Sequence[float]:
    return _halvings(1e-3, 6)


_FINE = ("circuit.reltol=1e-6", "circuit.max_step=1e-5")
"""Of ngspice under macro steps, so that these decide."""

_AUDITED = 0.5
"""Share of the power that the audit lets be lost, over the tolerance's power of 2/3: a residual is
of order 2 in a step that goes with the cube root of the tolerance."""

_EVENT_AWARE = "EMF's slope, linear current"


def _fixed(name: str, make: Make, order: int, events: bool = False) -> Solver:
    return Solver(name, "macro steps", "macro step [s]", _macro(make, events), _steps, order)


_IN_NGSPICE = {
    "jacobi": "Jacobi k = 1",
    "gauss-seidel": "Gauss-Seidel k = 1",
    "mean-current": "EMF's slope, mean current",
    "companion": "companion",
}
"""The methods under ngspice, and the same ones with participants that can go back."""

DEFAULT = "step-locked (default), both"
ALL_IN_NGSPICE, LSODA = "all in ngspice", "SciPy's LSODA with events"
_OF_PEERS = "knows compliant walls and the sawtooth only"

SOLVERS = (
    *(
        _fixed(name, make, ORDERS[name])
        for name, make in METHODS.items()
        if name != "iterated, plain"
    ),
    _fixed("event-aware", METHODS[_EVENT_AWARE], ORDERS[_EVENT_AWARE], events=True),
    _fixed("predictor-corrector", PredictorCorrector, 2),
    _fixed("iterated, Aitken", lambda a, b: Iterated(a, b, "aitken", tolerance=1e-9), 2),
    _fixed("iterated, Anderson", lambda a, b: Iterated(a, b, "anderson", tolerance=1e-9), 2),
    Solver("error-controlled", "macro steps", "tolerance", _controlled, _control),
    Solver("error-controlled, audited", "macro steps", "tolerance", _audited, _control),
    Solver(
        "step-locked (default), max_step",
        "ngspice leads",
        "circuit.max_step [s]",
        # So loose that steps are as long as they may be.
        _led("circuit.max_step={}", "circuit.reltol=1e-2"),
        _max_steps,
        2,
    ),
    Solver(
        "step-locked (default), reltol",
        "ngspice leads",
        "circuit.reltol",
        _led("circuit.reltol={}", "circuit.max_step=1e-4"),
        _reltols,
    ),
    Solver(
        DEFAULT,
        "ngspice leads",
        "level of coupling.method = auto",
        _level,
        lambda case: range(len(LEVELS)),
    ),
    *(
        Solver(
            f"{method} in ngspice",
            "ngspice leads",
            "coupling.macro_step [s]",
            _led("coupling.macro_step={}", f"coupling.method={method}", *_FINE),
            _macro_steps,
            ORDERS[twin],
        )
        for method, twin in _IN_NGSPICE.items()
    ),
    Solver(
        ALL_IN_NGSPICE,
        *("peers", "circuit.reltol", _all_in_ngspice, _peers_reltols),
        limits=_OF_PEERS,
    ),
    Solver(LSODA, "peers", "tolerance", _solve_ivp, _peers_rtols, limits=_OF_PEERS),
)
"""Every line of the diagrams."""
