"""What the accuracy study makes of its runs, on runs with known errors."""

import csv
import re
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import SimulationFailed
from cosim.evaluate.store import Store
from cosim.scene import Scene
from cosim.studies.accuracy.accuracy import error_in, order, time_to
from cosim.studies.accuracy.cases import CASES, Case, reference
from cosim.studies.accuracy.solvers import FALSE_CYCLE, Outcome, Run, Solver, measure
from cosim.studies.report import write_csv, write_page

REFERENCE = CASES["reference"]
STEPS = [1e-3 / 2**k for k in range(6)]


def solver(errors: dict[float, float | str]) -> Solver:
    """One whose error at each setting is given, as a share of the range; or its failure."""
    true = reference("reference").signals

    def run(scene: Scene, case: Case, setting: float) -> Outcome:
        error = errors[setting]
        if isinstance(error, str):
            raise SimulationFailed(error)
        return Outcome(true + error * np.ptp(true), 0.01, 7)

    return Solver("a method", "macro step [s]", run, lambda case: list(errors))


def test_error_and_order_of_known_runs() -> None:
    runs = measure(
        REFERENCE, [solver({h: 30.0 * h**1.5 for h in STEPS})], rounds=2, store=Store(None)
    )
    assert [run.error for run in runs] == pytest.approx([30.0 * h**1.5 for h in STEPS], rel=1e-6)
    assert order(runs) == pytest.approx(1.5, abs=1e-6)
    assert not any(run.failure for run in runs)
    assert isnan(order(runs[:4]))


def test_failures_are_marked() -> None:
    found = measure(
        REFERENCE,
        [
            solver(
                {
                    8.0: "A false limit cycle: until t = ...",
                    4.0: "something else",
                    2.0: 3.0,
                    1.0: 0.1,
                    0.5: 0.01,
                    0.25: 0.02,
                    0.125: nan,
                }
            )
        ],
        rounds=1,
        store=Store(None),
    )
    assert [run.failure for run in found] == [
        "false limit cycle",
        "failed",
        "diverged",
        "",
        "",
        "not monotone",
        "diverged",
    ]
    assert isinstance(found[0], Run) and isnan(found[0].error)


def test_failures_are_left_out_of_what_is_fitted() -> None:
    """Beside runs of order 2 whose time is 1e-3/h: false ones that would be better and worse."""
    true = [Run("reference", "a", "macro step [s]", h, h**2, 1e-3 / h, 7, "") for h in STEPS]
    false = [
        Run("reference", "a", "macro step [s]", 1e-6, 1e-12, 1e-6, 7, FALSE_CYCLE),
        Run("reference", "a", "macro step [s]", 1e-6, 3.0, 1e3, 7, "diverged"),
        Run("reference", "a", "macro step [s]", 1e-6, nan, 1e3, 7, "failed"),
    ]
    runs = [*true, *false]
    assert order(runs) == pytest.approx(2.0)
    assert error_in(runs, 2.5) == pytest.approx((1e-3 / 2.5) ** 2)
    assert time_to(runs, (1e-3 / 2.5) ** 2) == pytest.approx(2.5)
    assert isnan(error_in(runs, 0.5)) and error_in(runs, 1e3) == pytest.approx(STEPS[-1] ** 2)
    assert isnan(time_to(runs, 1e-11)) and time_to(runs, 1.0) == pytest.approx(1.0)
    assert isnan(error_in(false, 1.0)) and isnan(time_to(false, 1.0))


def test_tables(tmp_path: Path) -> None:
    rows = [{"method": "a", "error [1]": 1.0 / 3.0}, {"method": "b", "error [1]": nan}]
    write_csv(tmp_path / "study.csv", rows)
    write_page(tmp_path / "study.md", "A study", ["A note."], {"Runs": rows})
    with (tmp_path / "study.csv").open() as file:
        read = list(csv.DictReader(file))
    assert float(read[0]["error [1]"]) == 1.0 / 3.0
    text = (tmp_path / "study.md").read_text(encoding="utf-8")
    assert re.search(r"\| a +\| 0.3333 +\|", text) and re.search(r"\| b +\| - +\|", text)
    assert "A note." in text
    assert "cores" in text
