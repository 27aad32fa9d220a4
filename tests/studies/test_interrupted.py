"""A chart that is interrupted goes on where it was."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cosim.cli.main import main
from cosim.evaluate.store import Store
from cosim.studies.accuracy.cases import CASES
from cosim.studies.accuracy.solvers import measure
from cosim.studies.speed import ladder
from cosim.studies.stability import stability as limits
from tests.studies.test_tables import solver

pytestmark = pytest.mark.reliability


class Interrupted:
    """A function that is interrupted at a call, and counts the others."""

    def __init__(self, function: Any, at: int) -> None:
        self.function, self.at, self.calls = function, at, 0

    def __call__(self, *given: Any) -> Any:
        self.calls += 1
        if self.calls == self.at:
            raise KeyboardInterrupt
        return self.function(*given)


def test_an_interrupted_ladder_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["chart", "ladder", "ideal-current", "--set=circuit.model=ideal"]
    command += ["--set=run.duration=0.04", "--set=run.settle=0.01", f"--out={tmp_path}"]
    first = Interrupted(ladder.simulate, at=6)
    monkeypatch.setattr(ladder, "simulate", first)
    assert main(command) == 130
    assert "interrupted" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"ladder.sqlite"}
    second = Interrupted(first.function, at=0)
    monkeypatch.setattr(ladder, "simulate", second)
    assert main(command) == 0
    # Each begins with a run that does not count, and the sixth was not finished.
    assert second.calls - 1 == len(ladder.RUNS) - 4
    assert {path.name for path in tmp_path.iterdir()} == {"ladder.csv", "ladder.md", "ladder.png"}


def test_interrupted_limits_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the chart ``stability``."""
    monkeypatch.setattr(limits, "predicted", lambda *given: 1e-3)
    first = Interrupted(lambda *given: 1.1e-3, at=4)
    monkeypatch.setattr(limits, "observed", first)
    regimes = limits.REGIMES[:2]
    with pytest.raises(KeyboardInterrupt), Store(tmp_path / "store") as store:
        list(limits.limits(regimes, store))
    second = Interrupted(first.function, at=0)
    monkeypatch.setattr(limits, "observed", second)
    with Store(tmp_path / "store") as store:
        found = list(limits.limits(regimes, store))
    assert second.calls == len(found) - 3 == 2 * len(limits.METHODS) - 3
    assert found == list(limits.limits(regimes, Store(None)))


def test_an_interrupted_measurement_goes_on(tmp_path: Path) -> None:
    """Of the chart ``accuracy``: failed and diverged runs are not repeated either."""
    case = CASES["reference"]
    known = solver({8.0: "failed", 4.0: 3.0, 2.0: 0.1, 1.0: 0.01})
    first, second = Interrupted(known.run, at=3), Interrupted(known.run, at=0)
    with pytest.raises(KeyboardInterrupt), Store(tmp_path / "store") as store:
        measure(case, [replace(known, run=first)], 2, store)
    with Store(tmp_path / "store") as store:
        found = measure(case, [replace(known, run=second)], 2, store)
    assert second.calls == 7 - 2  # a failed run has no second time
    expected = measure(case, [known], 2, Store(None))
    assert [str(run.error) for run in found] == [str(run.error) for run in expected]
    assert [run.failure for run in found] == [run.failure for run in expected]
