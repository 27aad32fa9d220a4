"""What is told where physics is left: against closed forms, on both sides of each limit."""

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BeyondModel
from cosim.scene import load
from cosim.simulation.simulate import simulate

NETLIST = Path(__file__).parents[2] / "circuits" / "amplifier.cir"
G = 9.81
BRIEF = {"run.duration": 0.02, "run.settle": 0.01}
GRIPPER = {
    **{"drive.amplitude": 10.0, "drive.offset": -2.5, "coil.count": 2},
    **{"mechanics.n_surfaces": 2, "mechanics.part_mass": 0.05, "friction.normal_force": 1.4},
}


def told(word: str, name: str, overrides: Mapping[str, Any]) -> list[str]:
    """The notes of a run that have ``word`` in them."""
    scene = load(name, {**BRIEF, "run.output_step": 1e-4, **overrides})
    return [note for note in simulate(scene).summary["notes"] if word in note]


@pytest.mark.physics
@pytest.mark.parametrize(("surfaces", "mu_plate"), [(1, 0.0), (2, 0.0), (2, 0.18)])
def test_a_grip_that_is_told_to_be_weak_drops_the_part(surfaces: int, mu_plate: float):
    """Surfaces at rest: the part stays, or falls by what its weight exceeds friction."""
    mass, mu_s, mu_k = 0.3, 0.72, 0.59
    least = mass * G / (surfaces * (mu_s + mu_plate))
    for share in (1.001, 0.999):
        keys = {
            "mechanics.part_mass": mass,
            "mechanics.n_surfaces": surfaces,
            "friction.mu_plate": mu_plate,
            "friction.normal_force": share * least,
        }
        still = {"drive.waveform": "sine", "drive.velocity_amplitude": 0.0}
        scene = load("held", {**BRIEF, **still, **keys, "run.output_step": 1e-3})
        summary = simulate(scene).summary
        (*notes,) = (note for note in summary["notes"] if "grip" in note)
        if share > 1.0:
            assert summary["v_average"] == pytest.approx(0.0, abs=1e-12) and not notes
            continue
        fall = G - surfaces * (mu_k + mu_plate) * share * least / mass
        assert summary["v_average"] == pytest.approx(-fall * 0.015, rel=1e-9)
        (note,) = notes
        assert f"= {0.999 * mass * G:.4g} N" in note and f"{mass * G:.4g} N." in note


def test_the_heavy_part_of_the_gripper_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    heavy = {"mechanics.part_mass": 0.3, "circuit.model": "limited", "run.duration": 0.1}
    sets = [f"--set={key}={value}" for key, value in heavy.items()]
    assert main(["run", "gripper", *sets, "--out", str(tmp_path)]) == 0
    streams = capsys.readouterr()
    (line,) = (line for line in streams.err.splitlines() if "too weak" in line)
    assert line.startswith("cosim: note: ") and line.endswith(".")
    # 2 surfaces, 0.72, 1.4 N, against 0.3 kg
    assert "2.016 N" in line and "2.943 N" in line and "too weak" not in streams.out
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["v_average"] < -0.2 and line.removeprefix("cosim: note: ") in summary["notes"]
    with pytest.warns(BeyondModel, match=r"2\.016 N"):
        cosim.run("gripper", heavy)


def test_a_grip_that_loosens_is_told_with_its_time(tmp_path: Path):
    file = tmp_path / "grip.csv"
    file.write_text("time [s],normal_force [N]\n0,0.5\n0.005,0.1\n0.01,0.5\n1,0.0\n")
    keys = {"circuit.model": "limited", "friction.normal_force_file": str(file)}
    (note,) = told("grip", "reference", keys)
    # 0.72 * 0.1 N against 9 g
    assert "0.072 N at 0.005 s" in note and "0.08829 N" in note
    file.write_text("time [s],normal_force [N]\n0,0.5\n0.005,0.13\n0.01,0.5\n")
    assert not told("grip", "reference", keys)


@pytest.mark.parametrize(
    ("model", "supply", "parts"),
    [
        ("limited", 30.0, []),
        ("limited", 30.5, ["OPA548"]),
        ("limited", 4.5, []),
        ("limited", 3.9, ["OPA548"]),
        ("amplifier", 31.0, ["OPA548"]),
        ("full", 18.0, []),
        ("full", 18.5, ["LM348"]),
        ("full", 31.0, ["LM348", "OPA548"]),
        ("ideal", 31.0, []),  # which has no supply
        ("file", 31.0, []),  # whose amplifier is the user's own
    ],
)
@pytest.mark.filterwarnings("ignore::cosim.errors.NoEffect")
def test_supplies_beyond_the_data_sheets_are_told(model: str, supply: float, parts: list[str]):
    keys = {"circuit.model": model, "circuit.supply": supply, "run.duration": 1e-3}
    keys |= {"run.settle": 5e-4, "circuit.swing_loss_high": 1.0, "circuit.swing_loss_low": 1.0}
    if model == "file":
        keys["circuit.netlist"] = str(NETLIST)
    notes = told("circuit.supply", "reference", keys)
    assert [next(part for part in ("LM348", "OPA548") if part in note) for note in notes] == parts
    assert all(f"circuit.supply = {supply:g} V" in note for note in notes)


@pytest.mark.physics
@pytest.mark.parametrize(("count", "share"), [(1, 0.99), (1, 1.01), (2, 0.99), (2, 1.01)])
def test_a_coil_beyond_its_data_sheet_is_told(count: int, share: float):
    """A square wave of the current 5 V / 7.1 Ohm makes the heat of the data sheet's 10 V."""
    current = share * 5.0 / 7.1
    keys = {"circuit.model": "ideal", "drive.waveform": "square", "drive.offset": 0.0}
    keys |= {"drive.amplitude": 2.0 * 4.0 * current * count, "coil.count": count}
    keys |= {"run.duration": 0.1}
    notes = told("heat", "reference", keys)
    assert len(notes) == (share > 1.0)
    assert all(f"{7.1 * current**2:.3g} W" in note for note in notes)


def test_the_sense_resistor_is_not_the_coil():
    """The same circuit as the bench's own and as a user's, whose sense resistor is not counted."""
    keys = {"drive.waveform": "square", "drive.offset": 0.0, "run.duration": 0.1}
    own = told("heat", "reference", keys)
    foreign = {"circuit.model": "file", "circuit.netlist": str(NETLIST)}
    assert own == told("heat", "reference", keys | foreign) and len(own) == 1


@pytest.mark.physics
@pytest.mark.parametrize(("depth", "count"), [(0.09, 0), (0.11, 1)])
def test_a_ram_deep_in_its_wall_is_told(depth: float, count: int):
    """It lies on the lower wall, without suspension: Hertz's law, K depth^1.5 = m g."""
    stiffness = 0.004 * G / (depth * 1.9e-3) ** 1.5
    keys = {"mechanics.suspension_k1": 0.0, "mechanics.suspension_k3": 0.0}
    notes = told("wall", "held", {**keys, "mechanics.contact_stiffness": stiffness})
    assert len(notes) == count
    assert all(f"{depth * 1.9:.3g} mm into its wall" in note for note in notes)
    assert not told("wall", "held", {**keys, "mechanics.contact": "rigid"})


def test_both_rams_of_two_surfaces_are_told():
    keys = {"mechanics.contact_stiffness": 5e4, "run.duration": 0.1, "mechanics.n_surfaces": 2}
    keys |= {"circuit.model": "limited", "drive.phase_deg": 90.0, "mechanics.part_mass": 0.018}
    notes = told("wall", "reference", keys)
    assert [note.partition(" presses")[0] for note in notes] == ["the ram", "the second ram"]


@pytest.mark.physics
@pytest.mark.parametrize(
    ("b1", "b2", "amplitude", "where"),
    [
        # The ram hangs at q = -m g / k1 = -0.981 mm.
        (1010.0, 0.0, 0.0, None),
        (1030.0, 0.0, 0.0, "q = -0.981 mm"),
        # 1 + b1 q + b2 q^2 is negative about q = -b1 / (2 b2) alone, between the places reached.
        (3000.0, 2e6, 8.0, "q = -0.75 mm"),
        (3000.0, 2.3e6, 8.0, None),
    ],
)
def test_a_force_factor_that_turns_its_sign_is_told(
    b1: float, b2: float, amplitude: float, where: str | None
):
    keys = {
        "circuit.model": "ideal",
        "coil.b1": b1,
        "coil.b2": b2,
        "drive.amplitude": amplitude,
        "drive.offset": 0.0,
    }
    keys |= {"mechanics.suspension_k3": 0.0} if amplitude == 0.0 else {"run.duration": 0.1}
    notes = told("Bl", "reference", keys)
    assert len(notes) == (where is not None) and all(str(where) in note for note in notes)


@pytest.mark.physics
@pytest.mark.parametrize(("length", "count"), [(34.2e-3, 0), (34.4e-3, 1)])
def test_a_part_off_the_finger_is_told(length: float, count: int):
    """It falls freely, g t^2 / 2; the surface, rid of its weight, hardly counts."""
    keys = {"mechanics.flexure_stiffness": 1e7, "friction.normal_force": 0.0}
    fall = (2.0 * length / G) ** 0.5
    keys |= {"run.duration": fall, "run.output_step": fall / 100.0}
    notes = told("along the surface", "held", keys)
    assert len(notes) == count and all(f"{-length * 1e3:.4g} mm" in note for note in notes)


@pytest.mark.parametrize(
    ("name", "keys"),
    [("reference", {}), ("reference", GRIPPER), ("held", {}), ("optimal", {}), ("umbanhowar", {})],
    ids=["one surface", "gripper", "held", "optimal", "umbanhowar"],
)
def test_ordinary_scenes_are_silent(name: str, keys: Mapping[str, Any]):
    model = {"circuit.model": "limited"} if name == "reference" else {}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cosim.run(name, {**keys, **model}).summary["notes"] == []
