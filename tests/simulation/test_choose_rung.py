"""circuit.model = "auto" against whole runs on every rung."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cosim.cli.main import main
from cosim.scene import load
from cosim.simulation.simulate import simulate

SHORT = ["run.duration=1", "run.settle=0.5", "run.output_step=0.1"]


@cache
def summary(*changes: str) -> Any:
    return simulate(load("reference", [*SHORT, *changes])).summary


@pytest.mark.parametrize(
    ("tolerance", "amplitude", "expected"),
    [("0.01", "8", "limited"), ("0.15", "8", "ideal"), ("1e-6", "8", "amplifier")],
)
def test_cheapest_within_tolerance(tolerance: str, amplitude: str, expected: str) -> None:
    drive = f"drive.amplitude={amplitude}"
    found = summary(drive, "circuit.model=auto", f"run.tolerance={tolerance}")
    assert found["circuit_model"] == expected
    whole = summary(drive, f"circuit.model={expected}")
    assert found["v_average"] == whole["v_average"]
    top = summary(drive, "circuit.model=amplifier")
    assert abs(found["v_average"] / top["v_average"] - 1) <= float(tolerance)


RESTLESS = [
    (0.508, 0.5452, 0.5565),  # chaotic: a millionth of the normal force is enough to change it
    (0.5319, 0.6075, 0.3988),  # steady, but next to a motion a quarter slower
]


@pytest.mark.parametrize("knobs", RESTLESS)
def test_refused_where_nothing_can_be_told(knobs: tuple[float, float, float]) -> None:
    names = ("pot_max", "pot_frequency", "pot_offset")
    turned = [f"drive.{name}={value}" for name, value in zip(names, knobs, strict=True)]
    found = summary(*turned, "circuit.model=auto", "run.tolerance=0.05")
    assert found["circuit_model"] == "amplifier"
    assert "ten-thousandth of the coil's force" in found["circuit_model_why"]
    rungs = [summary(*turned, f"circuit.model={model}") for model in ("limited", "amplifier")]
    limited, amplifier = (rung["v_average"] for rung in rungs)
    assert abs(limited / amplifier - 1) > 0.05


@pytest.mark.parametrize(
    "changes",
    [
        # The ringing after each return from a limit reaches into the slip: 3.6 % and 0.6 % off.
        ["circuit.swing_loss_high=2", "circuit.swing_loss_low=2"],
        ["coil.inductance=8e-3", "drive.frequency=50", "run.tolerance=0.005"],
    ],
)
def test_ringing_that_reaches_the_slip_is_seen(changes: list[str]) -> None:
    found = simulate(load("reference", [*changes, "circuit.model=auto"])).summary
    assert found["circuit_model"] == "amplifier"
    limited = simulate(load("reference", [*changes, "circuit.model=limited"])).summary
    tolerance = load("reference", changes).run.tolerance
    assert abs(limited["v_average"] / found["v_average"] - 1) > tolerance


def test_coil_too_fast_for_the_limited_rung() -> None:
    brief = "run.duration=0.12", "run.settle=0.1"
    found = summary("coil.inductance=1e-6", "circuit.model=auto", *brief)
    assert found["circuit_model"] == "amplifier"


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = [f"--set={change}" for change in [*SHORT, "circuit.model=auto", "run.tolerance=0.02"]]
    assert main(["run", "reference", *changes, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "circuit taken           limited: at most about" in printed
    assert " settings half within " in printed
    written = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert written["circuit_model"] == "limited" and set(written["circuit_model_errors"]) == {
        "limited", "ideal",
    }  # fmt: skip
    assert load(tmp_path / "scene.toml").circuit.model == "limited"
