"""The choice of circuit model and tolerance: its truths against another solver, its advice."""

import csv
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from benchmarks.choice import CHOICES, COST, TRUTHS, advice, choice, machines, report
from cosim.scene import changed, load
from cosim.simulation.choose_rung import advice as told
from cosim.simulation.choose_rung import expected
from cosim.simulation.simulate import summary
from tests.simulation.test_against_reference import CASES, scene_of

ROOT = Path(__file__).parents[2]


@pytest.mark.physics
@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("pressed", 5e-6),
        ("asymmetric", 5e-6),
        ("reference-limited", 1e-7),
        ("gripper-limited", 1e-7),
        ("fast-rigid-ideal", 1e-7),
    ],
)
def test_the_truths_are_those_of_an_independent_solver(name: str, within: float) -> None:
    case = CASES[name]
    true = case["result"]["v_average"]
    finest = changed(scene_of(case), TRUTHS[case["circuit"]], "truth")
    assert summary(finest)["v_average"] == pytest.approx(true, rel=within)


def row(model: str, cost: float, median: float, most: float) -> dict[str, Any]:
    columns = {"machine": "all", "line": model, "circuit.model": model, "steps": "default"}
    errors = {"median": median, "90 %": most, "worst": most}
    against = ("own model", "amplifier", "full")
    return columns | {COST: cost} | {
        f"against {what}: {share} [%]": error for what in against for share, error in errors.items()
    }  # fmt: skip


ROWS = [
    row("ideal", 0.01, 3.0, 40.0),
    row("limited", 0.02, 0.05, 2.0),
    row("amplifier", 1.0, 0.06, 0.9),
    row("full", 4.0, 1e-3, 1e-2),
]


@pytest.mark.parametrize(
    ("wanted", "half", "most"),
    [(10.0, "ideal", "limited"), (1.0, "limited", "amplifier"), (0.1, "limited", "full")],
)
def test_the_advice_is_the_cheapest_that_holds(wanted: float, half: str, most: str) -> None:
    found = advice(ROWS, wanted)
    assert found["in half of the settings"] == f"{half}, default"
    assert found["in nine of ten"] == f"{most}, default"


def test_none_where_nothing_holds() -> None:
    assert advice(ROWS, 1e-5)["in half of the settings"] == "none"


def test_all_machines_are_scenes_and_all_choices_can_be_run() -> None:
    for own in machines().values():
        for one in (CHOICES | TRUTHS).values():
            if "run.solver" not in one or own["mechanics.contact"] == "compliant":
                changed(load("reference"), {**own, **one}, "test")
    paper, rig = load("paper"), changed(load("reference"), machines()["paper, compliant"], "test")
    assert (rig.coil, rig.mechanics, rig.friction) == (paper.coil, paper.mechanics, paper.friction)


def test_auto_has_the_table_of_the_chart() -> None:
    table = (ROOT / "results" / "choice.csv").read_text(encoding="utf-8")
    assert (ROOT / "cosim" / "simulation" / "choice.csv").read_text(encoding="utf-8") == table
    rows = [row for row in csv.DictReader(table.splitlines()) if row["machine"] == "all"]
    assert set(expected()) == {"ideal", "limited", "amplifier", "full"}
    own = next(r for r in rows if (r["circuit.model"], r["steps"]) == ("limited", "default"))
    assert expected()["limited"] == own
    assert f"{float(own['against full: median [%]']):.2g} % of full" in told("limited")


def test_the_figure_and_the_page(tmp_path: Path) -> None:
    lines = [what.partition(": ")[::2] for what in CHOICES]
    model = {"limited, fast": "limited"}
    rows = [
        row(model.get(line, line), 0.1, 0.2, 0.4) | {"line": line, "steps": steps}
        for line, steps in lines
    ]
    report(rows, {"paper, rigid": Counter(regular=2, chaotic=1)}, 0.1).save(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        f"choice.{end}" for end in ("csv", "md", "png")
    }
    assert "3 settings of the knobs" in (tmp_path / "choice.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_quick_chart(tmp_path: Path) -> None:
    found = choice(True, tmp_path)
    every = {(r["circuit.model"], r["steps"]): r for r in found.rows if r["machine"] == "all"}
    ideal, limited, full = (every[model, "default"] for model in ("ideal", "limited", "full"))
    assert ideal["against full: worst [%]"] > 5.0 > limited["against full: worst [%]"]
    assert full["against own model: worst [%]"] < 0.1
    assert limited[COST] < 0.1 < full[COST]
    assert not (tmp_path / "choice.sqlite").exists()
