"""The ladder and the limits: against runs made one by one, closed relations, and the files."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.scene import Scene, changed, load
from cosim.simulation.simulate import simulate
from cosim.studies.circuit.ladder import RUNGS, cheapest, ladder
from cosim.studies.circuit.limits import LIMITS, needed_acceleration, prepared, study
from cosim.studies.circuit.limits_report import words

QUICK = ["run.duration=0.2", "run.settle=0.1"]
BY_NAME = {limit.name: limit for limit in LIMITS}


def summary(scene: Scene) -> Any:
    return simulate(scene).summary


def on(model: str, *changes: str) -> Any:
    return summary(load("reference", [f"circuit.model={model}", "run.output_step=0.05", *changes]))


def test_back_emf_is_turned_alone() -> None:
    """Within the limits: the same motion, and a voltage less by what is gone of the back-EMF."""
    base = load(
        "reference",
        [
            *QUICK,
            "circuit.model=limited",
            "drive.waveform=sine",
            "circuit.supply=100",
            "coil.count=2",
        ],
    )
    less = changed(base, BY_NAME["back-EMF"].turned(base, 0.25), "test")
    own, other = simulate(base).columns, simulate(less).columns
    np.testing.assert_allclose(other["z_ram"], own["z_ram"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(other["current"], 4.0 * own["current"], rtol=1e-9, atol=1e-12)
    gone = own["coil_voltage"] - other["coil_voltage"]
    np.testing.assert_allclose(gone, 0.75 * own["back_emf"], rtol=0, atol=1e-8)


def test_sense_resistance_leaves_the_current() -> None:
    base = load("reference", ["circuit.model=ideal", *QUICK])
    less = changed(base, BY_NAME["sense resistance"].turned(base, 0.03), "test")
    assert summary(less)["v_average"] == pytest.approx(summary(base)["v_average"], rel=1e-9)


def test_needed_acceleration() -> None:
    """0.72 x 0.5 N / 9 g + g; two surfaces of a gripper hold twice."""
    assert needed_acceleration(load("reference")) == pytest.approx(49.81)
    assert needed_acceleration(load("reference", ["mechanics.n_surfaces=2"])) == pytest.approx(
        89.81
    )


def test_study_agrees_with_single_runs() -> None:
    whole = ["drive.frequency=50", "drive.amplitude=9", *QUICK, "circuit.max_step=5e-5"]
    found = study(load("reference", whole), turn=False)
    near = 1e-4  # rows are communication points too, and there are other ones
    assert found.own.v_average == pytest.approx(on("amplifier", *whole)["v_average"], rel=near)
    assert found.ideal.v_average == pytest.approx(on("ideal", *whole)["v_average"], rel=1e-6)
    alone = on("amplifier", *whole, "circuit.swing_loss_high=0", "circuit.swing_loss_low=0")
    lifted = found.without["output's swing loss"].v_average
    assert lifted == pytest.approx(alone["v_average"], rel=near)
    limited = (
        on("limited", *whole)["v_average"],
        on("limited", *whole, "circuit.current_limit=250.4")["v_average"],
    )
    assert found.gain("current limit") == pytest.approx(limited[1] - limited[0], abs=1e-12)
    steps = on("amplifier", *whole, "drive.quantised=true")["v_average"]
    assert found.gain("DAC steps") == pytest.approx(found.own.v_average - steps, abs=near * steps)
    assert found.verdict("slew rate") == found.verdict("current limit") == "does not matter"
    assert "current limit" in words(found) and "not matter" in words(found)
    peak, between_impacts = found.peaks
    assert peak > 10.0 * between_impacts > 0.0


def test_knobs_are_resolved() -> None:
    scene = load("reference", ["drive.pot_max=0.8", "drive.pot_offset=0.3"])
    base = prepared(scene)
    assert base.drive.pot_max is None and base.drive.amplitude == scene.drive.amplitude
    assert base.drive.offset == scene.drive.offset
    with pytest.raises(BadInput, match="has no limits to lift"):
        prepared(load("held"))


# At 50.8 Hz and 9 V the limits take most of the transport, at 20 Hz and 4.7 V nearly none.
FAST = ["drive.frequency=50.8", "drive.amplitude=9", "drive.offset=-1.2"]
FAST += [f"run.settle={51 / 50.8}", f"run.duration={102 / 50.8}"]


@pytest.mark.parametrize(
    ("changes", "low", "high"),
    [
        (FAST, 2.0, 9.0),
        ([*FAST, "mechanics.contact=rigid"], 1.5, 9.0),
        (["drive.amplitude=4.7"], 1.01, 1.05),
    ],
    ids=["fast", "fast, rigid", "slow"],
)
def test_how_much_an_ideal_current_promises(changes: list[str], low: float, high: float) -> None:
    """Bounds from an independent event-driven model of this rig."""
    ratio = on("ideal", *changes)["v_average"] / on("amplifier", *changes)["v_average"]
    assert low < max(ratio, 1.0 / ratio) < high


def test_ladder() -> None:
    scene = load("reference", [*QUICK, "run.tolerance=0.2"])
    rungs = ladder(scene)
    assert [rung.model for rung in rungs] == list(RUNGS)
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
    assert "within 0.01 of the top the cheapest rung is" in capsys.readouterr().out
    with open(tmp_path / "ladder.csv", encoding="utf-8", newline="") as file:
        assert [row["circuit.model"] for row in csv.DictReader(file)] == list(RUNGS)
    assert main(["chart", "limits", "reference", *short, "--out", str(tmp_path)]) == 0
    assert "The part slips where the surface falls away" in capsys.readouterr().out
    with open(tmp_path / "limits.csv", encoding="utf-8", newline="") as file:
        assert {row["limit"] for row in csv.DictReader(file)} == set(BY_NAME)
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    assert page.count("\n| ") == 3 + len(BY_NAME) + 6 + 9 * 7
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{end}" for name in ("ladder", "limits") for end in ("csv", "md", "png")
    }


@pytest.mark.parametrize("name", ["ladder", "limits"])
def test_bad_input(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["chart", name, "held", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert 'scene held: circuit.model = "none"' in said and said.count("\n") == 1
    assert not out.exists()
