"""Speed against accuracy: every method and setting on four scenes; friction laws; chaos."""

from dataclasses import asdict
from pathlib import Path

from cosim.studies.accuracy import chaos, friction, report
from cosim.studies.accuracy.cases import CASES
from cosim.studies.accuracy.runs import measure
from cosim.studies.accuracy.solvers import SOLVERS
from cosim.studies.tables import write_csv

_ROUNDS = 3


def run(out: Path, quick: bool) -> None:
    """Write ``accuracy``, ``friction`` and ``chaos`` as png, csv and md into ``out``; print what
    they show."""
    cases = [case for case in CASES.values() if not case.netlist]
    rounds = 1 if quick else _ROUNDS
    runs = [
        run for case in (cases[-1:] if quick else cases) for run in measure(case, SOLVERS, rounds)
    ]
    write_csv(out / "accuracy.csv", [asdict(run) for run in runs])
    print(report.write(out, runs))
    print(friction.run(out))
    print(chaos.run(out))
    print(f"Written to {out}: {{accuracy,friction,chaos}}.{{csv,md,png}}")
