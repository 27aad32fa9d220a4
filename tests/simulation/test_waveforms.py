"""Waveforms and the coil's polarity through every circuit model: against an independent search's
numbers, an exact symmetry, and each other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.coupling.loop.macro_steps import coupled
from cosim.coupling.loop.recorder import Recorder
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import load
from cosim.simulation.simulate import summary

TIMES = {"run.settle": 0.4, "run.duration": 1.0}
FALLING = {
    **{"drive.waveform": "falling-sawtooth", "drive.amplitude": 7.867974},
    **{"drive.frequency": 76.374830, "drive.offset": -1.984750},
}
PIECES = {
    **{"drive.waveform": "pieces", "drive.frequency": 50.0},
    "drive.table": [[0.0, 0.5], [0.3, 0.2], [0.6, -0.3], [0.6, -0.5], [0.9, -0.4]],
}
NETLIST = Path(__file__).parents[2] / "circuits" / "amplifier.cir"


@pytest.mark.physics
def test_what_another_solver_and_search_found() -> None:
    """44.1 mm/s with a sine; 53.5 with a falling sawtooth, made there of a slow reset."""
    sine = {"drive.waveform": "sine", "drive.amplitude": 6.575099, "drive.frequency": 85.136547}
    found = summary(load("paper-limited", TIMES | sine | {"drive.offset": -1.551425}))
    assert found["v_average"] == pytest.approx(44.1e-3, abs=0.1e-3)
    reset = {"drive.waveform": "sawtooth", "drive.reset_time": 0.0130920}
    for shape in ({}, reset):
        found = summary(load("paper-limited", TIMES | FALLING | shape))
        assert found["v_average"] == pytest.approx(53.5e-3, abs=0.15e-3)
        assert found["energy_residual"] < 1e-6
        assert found["coil_heat"] == pytest.approx(3.5, abs=0.03)


@pytest.mark.physics
@pytest.mark.parametrize(
    ("model", "within"), [("ideal", 1e-9), ("limited", 1e-9), ("amplifier", 2e-3)]
)
def test_exchanged_wires_are_an_inverted_command(model: str, within: float) -> None:
    """A falling sawtooth with an offset is the rising one with the opposite offset and polarity:
    the same motion, the opposite current, where the output's two limits are exchanged too."""
    times = {"run.settle": 0.02, "run.duration": 0.1, "circuit.model": model}
    swing = ("circuit.swing_loss_high", "circuit.swing_loss_low")
    losses = {} if model == "ideal" else dict(zip(swing, (1.8, 2.6), strict=True))
    inverted = {"drive.waveform": "sawtooth", "drive.offset": 1.984750, "coil.polarity": -1}
    one = cosim.run("paper", times | FALLING)
    other = cosim.run("paper", times | FALLING | inverted | losses)
    for name in one.waveforms:
        sign = -1 if name in ("command", "current", "coil_voltage", "back_emf") else 1
        scale = float(np.ptp(one.waveforms[name].values))
        if name in ("time", "command", "current", "z_surface", "z_ram", "z_part"):
            apart = other.waveforms[name].values - sign * one.waveforms[name].values
            assert np.abs(apart).max() <= within * scale, name
    assert other.summary["coil_heat"] == pytest.approx(
        one.summary["coil_heat"], rel=max(within, 1e-9)
    )
    assert max(run.summary["energy_residual"] for run in (one, other)) < 1e-3


@pytest.mark.physics
def test_every_circuit_model_plays_pieces() -> None:
    """They differ by what the models differ by; a netlist of one's own is the built-in one."""
    found: dict[str, Any] = {}
    for model in ("limited", "amplifier", "full", "file"):
        own = {"circuit.netlist": str(NETLIST)} if model == "file" else {}
        few = {"run.settle": 0.1, "run.duration": 0.4, "circuit.model": model}
        found[model] = summary(load("paper", PIECES | few | own))
        assert found[model]["energy_residual"] < 1e-3, model
    speeds = {model: told["v_average"] for model, told in found.items()}
    assert speeds["amplifier"] == pytest.approx(speeds["limited"], rel=0.02)
    assert speeds["file"] == pytest.approx(speeds["amplifier"], rel=0.01)
    assert speeds["full"] == pytest.approx(speeds["limited"], rel=0.15)  # another swing
    assert abs(speeds["limited"]) > 1e-3


def test_ngspice_lands_on_each_corner() -> None:
    """On those where V1 jumps, and on those where its slope alone does."""
    scene = load("paper", PIECES | {"run.duration": 0.1, "run.settle": 0.0})
    mechanics = Mechanics(scene)
    try:
        lead = coupled(scene, Recorder(scene, mechanics, lambda _: None))
        lead.run()
        times = lead.log()["time"]
    finally:
        mechanics.close()
    corners = [(n + phase) / 50.0 for n in range(5) for phase in (0.0, 0.3, 0.6, 0.9)][1:]
    near = np.abs(times[:, np.newaxis] - corners).min(axis=0)
    assert near.max() <= 1e-12
