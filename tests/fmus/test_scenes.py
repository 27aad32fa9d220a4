"""The library's scenes with ports, each against the same in one netlist in plain ngspice."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import cosim
from benchmarks.peers import ngspice_alone
from cosim.files.resources import circuits
from cosim.mechanics.stickslip import Mechanics
from cosim.toolchain.processes import in_place
from tests.helpers import spice


def circuit(name: str) -> str:
    """The netlist of a scene without its title, analysis and end."""
    lines = (circuits() / "ports" / name).read_text().splitlines()
    return "\n".join(line for line in lines[1:] if not line.startswith((".tran", ".end")))


def off(time: np.ndarray, mine: np.ndarray, true: spice.Result, vector: str) -> float:
    """Greatest difference over the greatest value."""
    wanted = np.interp(time, true["time"], true[vector])
    return float(np.abs(mine - wanted).max() / np.abs(wanted).max())


def test_a_motor_with_a_gearbox(tmp_path: Path) -> None:
    """Friction by tanh in the netlist, set-valued in the FMU."""
    duration = 0.2
    inertia, friction, viscous = 2e-5 + 2e-2 / 400, 1.5 / 20, 2e-3 / 400
    whole = circuit("dc_motor.cir").replace("Vemf y b 0", "Vsense y z 0\nEemf z b w 0 0.05")
    mechanics = f"""
Cj w 0 {inertia}
.ic v(w)=0
Bt 0 w I=0.05*i(Vsense)-{viscous}*v(w)-{friction}*tanh(v(w)/0.005)
"""
    options = f".options reltol=1e-5\n.tran 5u {duration} 0 5u\n.end\n"
    true = spice.run(tmp_path, f"* motor\n{whole}{mechanics}{options}")
    with in_place():
        result = cosim.run("dc-motor", {"run.duration": duration})
    time, waves = result.columns["time"], result.columns
    assert off(time, waves["gear.speed"], true, "w") < 5e-5
    held = time > 0.19
    assert (waves["gear.speed"][held] == 0.0).all()
    # The ripple is 5 kHz, and its waveform is compared where both have settled to it.
    assert np.mean(waves["i(Vemf)"]) == pytest.approx(
        np.interp(time, true["time"], true["vsense#branch"]).mean(), rel=2e-2, abs=2e-2
    )


SAMPLED = """
Vjsense j2 j3 0
Bjemf j3 0 V=2*v(vj)
Cvj vj 0 0.05
Bvj 0 vj I=2*i(Vjsense)-v(nf)-5*v(vj)
Cx x 0 1 ic=0.195
Bx 0 x I=1e3*v(vj)
Bnf nf 0 V=max(0,2*v(x)+2*v(vj))
Vs1 s1 0 PULSE(0 1 {50m-20u} 1u 1u 18u 50m)
B1 0 h1 I=1e-3*v(s1)*(v(p)-v(h1))
C1 h1 0 1n
Bread read 0 V=max(0.2,min(0.5,0.39+60e-3*(6-v(h1))))
Vs2 s2 0 PULSE(0 1 60m 1u 1u 18u 50m)
B2 0 h2 I=1e-3*v(s2)*(v(read)-v(h2))
C2 h2 0 1n ic=0.39
Bjaw jaw 0 V=2*v(h2)
"""


@pytest.mark.slow
def test_a_grip_in_a_closed_loop(tmp_path: Path) -> None:
    """The mechanics as capacitors and sources, friction by tanh, the controller as two
    capacitors that sample and hold."""
    reference, duration = cosim.load("reference"), 0.6
    with closing(Mechanics(reference)) as mechanics:
        lines = ngspice_alone._mechanics(reference, mechanics.sample())
    lines = lines.replace("Vemf c3", "Vemf c2").replace("V=0.5*tanh", "V=v(nf)*tanh")
    whole = circuit("closed_grip.cir")
    for old, new in (
        ("Vcommand v1 0 0", f"Vcommand v1 0 PULSE(-5.2 2.8 0 {0.05 - 2e-9} 1n 1n 50m)"),
        ("Vemf c2 sense 0\n", ""),
        ("Vjaw jaw 0 0\n", ""),
        ("Vjemf j2 0 0", ""),
        ("Ljaw j1 j2 1m", "Ljaw j1 j2 1m ic=0.195"),
    ):
        assert old in whole
        whole = whole.replace(old, new)
    options = f".options reltol=1e-7 method=trap\n.tran 10u {duration} 0 10u uic\n.end\n"
    true = spice.run(tmp_path, f"* grip\n{whole}{lines}{SAMPLED}{options}")
    assert true["time"][-1] == pytest.approx(duration)
    with in_place():
        result = cosim.run("closed-grip", {"run.duration": duration, "circuit.max_step": 1e-5})
    time, waves = result.columns["time"], result.columns
    assert off(time, 1e3 * waves["rig.z_part"], true, "p") < 2e-2
    late = time > 0.01
    assert off(time[late], waves["jaw.normal_force"][late], true, "nf") < 2e-2


ARMATURE = """
Bcoil c d I=v(flux)*(v(x)+0.3)*1e-3/1.2e-4
Cflux flux 0 1 ic=0
Bflux 0 flux I=v(c)-v(d)
Cx x 0 1 ic=1.0015
Bx 0 x I=1e3*v(w)
Cw w 0 3e-3 ic=0
Bspring spring 0 V=0.3+0.2*(1-v(x))-0.05*v(w)-v(flux)**2/2.4e-4
Blow low 0 V=(v(x)<0) ? max(0,-200*v(x)-10*v(w)) : 0
Bhigh high 0 V=(v(x)>1) ? max(0,200*(v(x)-1)+10*v(w)) : 0
Bw 0 w I=v(spring)+v(low)-v(high)
Bclosed contact 0 V=(v(x)<0.1) ? 1 : 0
"""


@pytest.mark.checked
def test_slopes_of_a_current_that_has_died_down_are_not_judged() -> None:
    """At 1e-15 A the FMU's own steps show: 12 changes in a row off its slope were called wrong, so
    that scene `relay` had no error of its means."""
    longer = {"circuit.max_step": 3.5e-5, "circuit.reltol": 3.5e-5, "coupling.macro_step": 3.5e-4}
    coarse, found = cosim.run("relay", longer).summary, cosim.run("relay").summary
    assert coarse["relay.current.mean"] == pytest.approx(found["relay.current.mean"], rel=1e-3)
    assert found["relay.current.mean_error"] < 1e-3 * found["relay.current.mean"]


def test_a_relay(tmp_path: Path) -> None:
    duration = 0.04
    whole = circuit("relay.cir")
    for old in ("Icoil c d 0\n", "Vcontact contact 0 0\n"):
        assert old in whole
        whole = whole.replace(old, "")
    options = f".options reltol=1e-6\n.tran 1u {duration} 0 1u uic\n.end\n"
    true = spice.run(tmp_path, f"* relay\n{whole}{ARMATURE}{options}")
    with in_place():
        result = cosim.run("relay", {"run.duration": duration})
    time, waves = result.columns["time"], result.columns
    assert off(time, 1e3 * waves["relay.gap"], true, "x") < 1e-2
    flux = np.interp(time, true["time"], true["flux"])
    wanted = flux * (np.interp(time, true["time"], true["x"]) + 0.3) * 1e-3 / 1.2e-4
    assert np.abs(waves["relay.current"] - wanted).max() < 1e-2 * wanted.max()
    # It closes once the coil is on, and opens only after it is off; between it bounces.
    closed = waves["relay.contact"] > 0.5
    assert 2e-3 < time[closed][0] < 9e-3 and 16e-3 < time[closed][-1] < 30e-3
