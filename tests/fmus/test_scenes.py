"""The library's scenes with ports, each against the same in one netlist in plain ngspice."""

from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.files.resources import circuits
from cosim.toolchain.processes import in_place
from tests.helpers import spice


def circuit(name: str) -> str:
    """The netlist of a scene without its title, analysis and end."""
    lines = (circuits() / "examples" / name).read_text().splitlines()
    return "\n".join(line for line in lines[1:] if not line.startswith((".tran", ".end")))


def off(time: np.ndarray, mine: np.ndarray, true: spice.Result, vector: str) -> float:
    """Greatest difference over the greatest value."""
    wanted = np.interp(time, true["time"], true[vector])
    return float(np.abs(mine - wanted).max() / np.abs(wanted).max())


def test_a_motor_with_a_gearbox(tmp_path: Path) -> None:
    """Friction by tanh in the netlist, set-valued in the FMU: at rest the netlist creeps."""
    duration = 0.2
    inertia, friction, viscous = 2e-5 + 2e-2 / 400, 1.5 / 20, 2e-3 / 400
    whole = circuit("dc_motor.cir").replace("Vemf y b 0", "Vsense y z 0\nEemf z b w 0 0.05")
    mechanics = f"""
Cj w 0 {inertia}
.ic v(w)=0
Bt 0 w I=0.05*i(Vsense)-{viscous}*v(w)-{friction}*tanh(v(w)/0.05)
"""
    options = f".options reltol=1e-5\n.tran 5u {duration} 0 5u\n.end\n"
    true = spice.run(tmp_path, f"* motor\n{whole}{mechanics}{options}")
    with in_place():
        result = cosim.run("dc-motor", {"run.duration": duration})
    time, waves = result.columns["time"], result.columns
    assert off(time, waves["gear.speed"], true, "w") < 2e-4
    held = time > 0.19
    assert (waves["gear.speed"][held] == 0.0).all()
    # The ripple is 5 kHz, and its waveform is compared where both have settled to it.
    assert np.mean(waves["i(Vemf)"]) == pytest.approx(
        np.interp(time, true["time"], true["vsense#branch"]).mean(), rel=2e-2, abs=2e-2
    )
