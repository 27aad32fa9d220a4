"""The ladder: against runs made one by one, and the files."""

import csv
from pathlib import Path
from typing import Any

import pytest

from cosim.cli.main import main
from cosim.evaluate.store import Store
from cosim.scene import Scene, load
from cosim.scene.rungs import LADDER
from cosim.simulation.simulate import simulate
from cosim.studies.speed.ladder import Rung, _on, cheapest, each_rung, report

QUICK = ["run.duration=0.2", "run.settle=0.1"]


def summary(scene: Scene) -> Any:
    return simulate(scene).summary


def on(model: str, *changes: str) -> Any:
    return summary(load("reference", [f"circuit.model={model}", "run.output_step=0.05", *changes]))


def test_ladder() -> None:
    scene = load("reference", [*QUICK, "run.tolerance=0.2"])
    rungs = each_rung(scene, Store(None))
    assert [rung.model for rung in rungs] == list(LADDER)
    for rung in rungs[:3]:
        assert rung.v_average == pytest.approx(on(rung.model, *QUICK)["v_average"], rel=1e-9)
    top = rungs[-1].v_average
    assert rungs[0].off_top == pytest.approx(abs(rungs[0].v_average / top - 1))
    assert rungs[1].off_amplifier < 0.003 and rungs[3].off_top == 0.0
    assert all(low <= cost <= high for cost, low, high in (rung.cost for rung in rungs))
    within = [rung for rung in rungs if rung.off_top <= 0.2]
    assert cheapest(rungs, 0.2) is within[0]


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = [f"--set={change}" for change in ("run.duration=0.1", "run.settle=0.05")]
    assert main(["chart", "ladder", "reference", *short, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "within 0.01 of the top the cheapest rung is" in said and "staircase of codes" in said
    with open(tmp_path / "ladder.csv", encoding="utf-8", newline="") as file:
        assert [row["circuit.model"] for row in csv.DictReader(file)] == list(LADDER)
    assert {path.name for path in tmp_path.iterdir()} == {
        f"ladder.{end}" for end in ("csv", "md", "png")
    }


def test_the_command_of_each_rung_is_told_as_it_is() -> None:
    """A scene whose drive is quantised has the staircase on every rung."""
    smooth, stairs = (load("reference", {"drive.quantised": own}) for own in (False, True))
    for scene in (smooth, stairs):
        assert _on(scene, "limited").drive.quantised == scene.drive.quantised
        rungs = [Rung(model, (1.0, 1.0, 1.0), 1.0, 1.0, 0.0, 0.0) for model in LADDER]
        found = report([(scene, rungs)])
        notes = " ".join(found.figures[""]().get_supxlabel().split())
        for said in (repr(found), notes):
            assert ("but in reference the staircase" in said) == scene.drive.quantised


def test_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["chart", "ladder", "held", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert 'scene held: circuit.model = "none"' in said and said.count("\n") == 1
    assert not out.exists()


def test_a_scene_that_no_rung_of_ngspice_can_have_is_told_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["chart", "ladder", "two-surfaces", "--out", str(tmp_path)]) == 2
    assert "The ladder runs each of ideal, limited, amplifier, full" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]
