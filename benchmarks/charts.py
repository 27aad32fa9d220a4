"""Charts of this project's own methods and models.

    python -m benchmarks.charts [NAME ...] [--quick] [--out DIR]

draws all, or the named ones: ``accuracy``, that is ``cosim chart accuracy`` with other programs and
error-controlled macro steps added; laws of ``friction``; ``chaos``, a chaotic scene; ``choice``,
which circuit model and tolerance to take; ``knife_edge``, solvers at the paper's optimal waveform.
Each writes ``.csv``, ``.md`` and ``.png``.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from benchmarks import chaos, choice, friction, knife_edge
from benchmarks.error_control import ErrorControlled
from benchmarks.peers import lsoda, ngspice_alone
from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.rewind.joint import Joint
from cosim.files.resources import circuits
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.accuracy import accuracy
from cosim.studies.accuracy.cases import Case
from cosim.studies.accuracy.solvers import (
    SAME_TIME,
    Jumps,
    Outcome,
    Solver,
    of_case,
    rewinding,
    tenths,
)
from cosim.studies.report import Report
from cosim.toolchain.processes import in_place


def _all_in_ngspice(scene: Scene, case: Case, reltol: float) -> Outcome:
    chosen = of_case(case, "circuit.max_step=1e-4", f"circuit.reltol={reltol!r}")
    seconds, path = ngspice_alone.run(chosen, case.times())
    return Outcome(path[np.newaxis], seconds, 0)


def _solve_ivp(scene: Scene, case: Case, rtol: float) -> Outcome:
    seconds, path = lsoda.run(of_case(case), case.times(), rtol)
    return Outcome(path[np.newaxis], seconds, 0)


_PORTS = """
base = "reference"
[circuit]
model = "file"
netlist = "amplifier.cir"
[[port]]
from = "drive"
source = "Vcommand"
[[port]]
from = "machine.back_emf"
source = "Vemf"
[[port]]
probe = "i(Vemf)"
to = "machine.current"
[coupling]
method = "redo"
"""


def _redone(scene: Scene, case: Case, reltol: float) -> Outcome:
    """The machine as an FMU of any kind, which does not predict its impacts: steps are redone."""
    times = case.times()
    given = f"run.duration={case.duration!r}", f"run.output_step={times[0]!r}"
    with TemporaryDirectory() as name:
        copy(circuits() / "amplifier.cir", name)
        (Path(name) / "ports.toml").write_text(_PORTS)
        steps = f"circuit.reltol={reltol!r}", "circuit.max_step=1e-4"
        chosen = load(Path(name) / "ports.toml", [*case.overrides, *given, *steps])
        began = process_time()
        with in_place():
            result = simulate(chosen)
    seconds, rows = process_time() - began, slice(1, len(times) + 1)
    names = {"current": "i(Vemf)"}
    found = [result.columns[names.get(x, f"machine.{x}")][rows] for x in case.judged]
    return Outcome(np.array(found), seconds, result.summary["circuit_steps"])


def _values(first: int, last: int, case: Case) -> list[float]:
    """Settings on the scenes that the peers can run."""
    return tenths(first, last) if case.name in ("stick-slip", "reference") else []


def _controlled(
    joint: Joint, jumps: Jumps, case: Case, tolerance: float, audited: bool
) -> Iterator[int]:
    """Macro steps by Richardson's estimate, cut at jumps of the command and at sampling times.
    Yields the number of macro steps so far at each sampling time; an attempt takes three.

    An audit allows a residual of 0.5 tolerance^(2/3) of the power, since the residual is of order 2
    in the step, and the step is proportional to the cube root of the tolerance.
    """
    share = 0.5 * tolerance ** (2.0 / 3.0) if audited else None
    control = ErrorControlled(joint, 1e-5, tolerance, tolerance, shortest=1e-9, energy_share=share)
    for time in case.times():
        while joint.time < time - SAME_TIME:
            control.run(min(time, jumps.next))
            jumps.meet(joint)
        yield 3 * (control.accepted // 2 + control.rejected)  # each try takes h, h and 2 h


def _with_control(name: str, audited: bool) -> Solver:
    run = rewinding(
        lambda a, b: Joint(a, b, Jacobi(1, slopes=False)), partial(_controlled, audited=audited)
    )
    return Solver(name, "tolerance", run, lambda case: tenths(1, 4))


_peer = partial(Solver, peer=True, limits="knows compliant walls and the sawtooth only")

SOLVERS = (
    _with_control("error-controlled", audited=False),
    _with_control("error-controlled, audited", audited=True),
    Solver(
        *("redo in ngspice", "circuit.reltol", _redone, lambda case: tenths(2, 7)),
        netlist=True,
        peer=True,
    ),
    _peer("all in ngspice", "circuit.reltol", _all_in_ngspice, partial(_values, 4, 9)),
    _peer("SciPy's LSODA with events", "tolerance", _solve_ivp, partial(_values, 3, 6)),
)
"""Lines of the chart ``accuracy`` besides the study's own."""


CHARTS: dict[str, Callable[[bool, Path], Report]] = {
    "accuracy": lambda quick, out: accuracy(quick=quick, out=out, more=SOLVERS),
    "friction": lambda *_: friction.report(),
    "chaos": lambda *_: chaos.report(),
    "choice": lambda quick, out: choice.choice(quick, out),
    "knife_edge": lambda *_: knife_edge.report(),
}
"""The arguments are ``quick`` and the folder, in which an interrupted chart is resumed."""


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.charts", description="Charts of the methods.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(CHARTS)}")
    parser.add_argument("--quick", action="store_true", help="one scene, few settings")
    parser.add_argument("--out", type=Path, default=Path("results"), metavar="DIR")
    asked = parser.parse_args()
    if not set(asked.names) <= set(CHARTS):
        parser.error(f"a NAME must be one of {', '.join(CHARTS)}")
    for name in asked.names or CHARTS:
        report = CHARTS[name](asked.quick, asked.out)
        report.save(asked.out)
        print(f"{report}\n\n{report.written(asked.out)}")


if __name__ == "__main__":
    main()
