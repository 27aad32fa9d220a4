"""Scenes with their own circuit and FMUs, against the same in one netlist in plain ngspice.

The FMUs are strangers, compiled by the test (foreign.c); ngspice runs by itself in tests/helpers.
"""

import ctypes
import re
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.arrays import Array
from cosim.coupling.loop.macro_steps import coupled
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import (
    Feed,
    Group,
    PortsState,
    Pulse,
    Slope,
    Source,
    StrangerState,
    Through,
    loop,
)
from cosim.coupling.ports import run as ports_run
from cosim.coupling.ports.run import Run
from cosim.errors import BadInput, SimulationFailed
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import changed, load, to_toml
from cosim.simulation.here import simulate_here
from cosim.simulation.simulate import simulate
from cosim.toolchain.processes import in_place
from tests.helpers import spice
from tests.ports.foreign import build, recompiled, reworded

BRIDGE = """
.param vdd=24
Vdd vdd 0 {vdd}
Vp gp 0 PULSE(0 1 0 1u 1u 129u 200u)
Vn gn 0 PULSE(1 0 0 1u 1u 129u 200u)
B1 vdd a I=v(vdd,a)*(1e-5+10/(1+exp(-20*(v(gp)-0.6))))
B2 a 0 I=v(a)*(1e-5+10/(1+exp(-20*(v(gn)-0.6))))
B3 vdd b I=v(vdd,b)*(1e-5+10/(1+exp(-20*(v(gn)-0.6))))
B4 b 0 I=v(b)*(1e-5+10/(1+exp(-20*(v(gp)-0.6))))
D1 a vdd DM
D2 0 a DM
D3 b vdd DM
D4 0 b DM
.model DM D(Is=1e-12 N=1 Rs=0.02)
Rm a x 1
Lm x y 1m
"""
ROTOR = """
Vsense y z 0
Eemf z b omega 0 0.05
Cj omega 0 2e-4
Rb omega 0 1e4
Bt 0 omega I=0.05*i(Vsense)
.ic v(omega)=0
"""
MOTOR = """
description = "A motor on an H-bridge"
[circuit]
model = "file"
netlist = "bridge.cir"
save = ["v(a)*i(Vemf)", "v(gp)"]
max_step = 5e-6
[[fmu]]
name = "rotor"
file = "Rotor.fmu"
parameters = { J = 2e-4, B = 1e-4 }
[[port]]
source = "Vemf"
from = "rotor.omega"
scale = 0.05
[[port]]
probe = "i(Vemf)"
to = "rotor.u"
scale = 0.05
[coupling]
method = "auto"
[run]
duration = 0.02
"""


def motor(folder: Path, **said: object) -> Path:
    build(folder, "Rotor", **said)  # pyright: ignore[reportArgumentType]
    (folder / "bridge.cir").write_text(f"* bridge{BRIDGE}Vemf y b 0\n.end\n")
    (folder / "motor.toml").write_text(MOTOR)
    return folder / "motor.toml"


def plain(folder: Path, duration: float) -> spice.Result:
    options = ".options reltol=1e-5\n"
    tran = f".tran 5u {duration} 0 5u\n.end\n"
    return spice.run(folder, f"* motor{BRIDGE}{ROTOR}{options}{tran}")


def here(scene: Path, overrides: Mapping[str, Any]) -> cosim.Result:
    with in_place():
        return cosim.run(scene, overrides)


@pytest.mark.checked
def test_power_is_what_flows_and_errors_hold(tmp_path: Path) -> None:
    scene, true = motor(tmp_path), plain(tmp_path, 0.02)
    result = cosim.run(scene)
    time, settle = true["time"], result.scene.run.settle
    power = 0.05 * true["omega"] * true["vsense#branch"]
    late = time >= settle
    energy = np.trapezoid(power[late], time[late])
    assert result.summary["Vemf.energy"] == pytest.approx(energy, rel=2e-3)
    assert result.summary["Vemf.power"] == pytest.approx(energy / (0.02 - settle), rel=2e-3)
    mean = np.trapezoid(true["omega"][late], time[late]) / (0.02 - settle)
    error = abs(result.summary["rotor.omega.mean"] - mean)
    assert error < result.summary["rotor.omega.mean_error"] + 1e-4 * mean
    assert result.summary["rotor.omega.mean_error"] < 1e-2 * mean


def off(result: cosim.Result, plain: spice.Result) -> float:
    """Greatest difference of the speeds over the greatest speed."""
    true = np.interp(result.columns["time"], plain["time"], plain["omega"])
    return float(np.abs(result.columns["rotor.omega"] - true).max() / np.abs(true).max())


@pytest.mark.parametrize("version", [2, 3])
def test_a_motor_on_a_bridge_is_that_of_one_netlist(tmp_path: Path, version: int) -> None:
    scene, true = motor(tmp_path, version=version), plain(tmp_path, 0.02)
    for overrides, most in (
        ({}, 5e-5),
        ({"coupling.method": "redo"}, 5e-5),
        ({"coupling.method": "macro-steps", "coupling.macro_step": 2e-5}, 2e-3),
    ):
        result = here(scene, overrides)
        assert off(result, true) < most, overrides
        assert result.summary["fmu_steps"] > 0
        power = result.columns["v(a)*i(Vemf)"]
        assert power == pytest.approx(
            np.interp(result.columns["time"], true["time"], true["a"] * true["vsense#branch"]),
            abs=0.05 * np.abs(power).max(),
        )


@pytest.mark.parametrize("version", [2, 3])
def test_a_discrete_output_is_held(tmp_path: Path, version: int) -> None:
    """A source that follows it has no other value than those that the FMU had at its steps."""
    scene = motor(tmp_path, version=version, discrete="omega")
    macro = {"coupling.method": "macro-steps", "coupling.macro_step": 1e-3}
    with in_place():
        run = Run(load(scene, macro), lambda _: None)
        run.run()
    times, given = run.points.array()[:, 0], 0.05 * run.points.array()[:, 1]
    at, source = run.log.array()[:, 0], run.log.array()[:, 1]
    assert len(times) == 21 and np.unique(given).size > 15
    assert source == pytest.approx(given[np.searchsorted(times, at - 1e-12) - (at > 0)])
    waves = here(scene, macro).columns["rotor.omega"]
    assert {*waves} <= {*run.points.array()[:, 1]}


CIRCLE = """
[circuit]
model = "file"
netlist = "rc.cir"
[[fmu]]
name = "a"
file = "Load.fmu"
[[fmu]]
name = "b"
file = "Load.fmu"
parameters = { D = -4.0 }
[[port]]
from = "a.y"
to = "b.u"
[[port]]
from = "b.y"
to = "a.u"
offset = 0.1
[run]
duration = 1e-3
"""


def test_a_run_that_diverges_fails(tmp_path: Path) -> None:
    """a = b + 0.1 and b = -4 a, each from the other's last value, grow with each step."""
    build(tmp_path, "Load", through=True)
    (tmp_path / "rc.cir").write_text("* rc\nV1 in 0 1\nR1 in out 1k\nC1 out 0 1u\n.end\n")
    (tmp_path / "circle.toml").write_text(CIRCLE)
    with pytest.raises(SimulationFailed, match=r"diverges: [ab]\.y has .* t = \S+ s"):
        here(tmp_path / "circle.toml", {"coupling.method": "step-locked"})
    quiet = {"fmu.b.D": -0.5, "coupling.method": "step-locked"}
    (note,) = here(tmp_path / "circle.toml", quiet).summary["notes"]
    assert all(name in note for name in ("a.y", "b.u", "b.y", "a.u", "not iterated", '"redo"'))


@pytest.mark.parametrize("gain", [-100.0, -4.0, -0.5, 0.5, 0.99, 3.0])
def test_fmus_that_feed_each_other_agree(tmp_path: Path, gain: float) -> None:
    """a = b + 0.1 and b = gain a."""
    build(tmp_path, "Load", through=True)
    (tmp_path / "rc.cir").write_text("* rc\nV1 in 0 1\nR1 in out 1k\nC1 out 0 1u\n.end\n")
    (tmp_path / "circle.toml").write_text(CIRCLE)
    result = here(tmp_path / "circle.toml", {"fmu.b.D": gain})
    assert result.summary["method"] == "redo"
    assert not result.summary["notes"]
    assert result.columns["a.y"][1:] == pytest.approx(0.1 / (1.0 - gain), rel=1e-4)
    build(tmp_path, "Load", through=True, saves=False)
    (note,) = here(tmp_path / "circle.toml", {"fmu.b.D": 0.5}).summary["notes"]
    assert "not iterated" in note and '"redo"' not in note


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("m->r[D] * m->r[U] + 0.1", r"Circuit and FMUs do not agree at t = \S+ s"),
        ("m->steps == 5 ? NAN : 0.5 * m->r[U]", "a.y is not a finite number at t = "),
    ],
)
def test_a_circle_without_a_solution_fails(tmp_path: Path, source: str, said: str) -> None:
    recompiled(tmp_path, ("m->r[D] * m->r[U]", source))
    build(tmp_path, "Load", through=True)
    (tmp_path / "rc.cir").write_text("* rc\nV1 in 0 1\nR1 in out 1k\nC1 out 0 1u\n.end\n")
    (tmp_path / "circle.toml").write_text(CIRCLE)
    with pytest.raises(SimulationFailed, match=said):
        here(tmp_path / "circle.toml", {"fmu.b.D": 1.0})


@pytest.mark.parametrize("offset", [-1.9, -1.0, 0.0])
def test_a_motor_at_rest_agrees_when_its_controller_answers(offset: float) -> None:
    """Its back-EMF of 1e-17 V, right but for rounding, must not learn from the controller's jump
    how it responds."""
    control = {"fmu.control.period": 1e-2, "fmu.control.delay": 2e-3, "run.duration": 0.013}
    given = {"coupling.method": "redo", "drive.offset": offset, "run.output_step": 1e-4}
    columns = simulate_here(load("closed-grip", given | control), lambda _: None).columns
    assert columns["control.out"][-1] == 0.5 and columns["jaw.back_emf"][-1] > 1e-3


def test_a_run_without_end_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An hour of an undamped tank circuit of 500 MHz; of an ordinary one any length may be run."""
    scene = motor(tmp_path)
    monkeypatch.setattr(ports_run, "ENOUGH", 1000)
    monkeypatch.setattr(ports_run, "BUDGET", 1000)
    assert here(scene, {}).summary["fmu_steps"] > 4000
    monkeypatch.setattr(ports_run, "BUDGET", 1e9)
    netlist = tmp_path / "bridge.cir"
    tank = "It 0 t PULSE(0 1 0 0.1n 0.1n 1n 2n)\nLt t 0 1n\nCt t 0 0.1n\n.end"
    netlist.write_text(netlist.read_text().replace(".end", tank))
    with pytest.raises(SimulationFailed, match=r"too short to come to an end: \d+ until t = \d"):
        here(scene, {"run.duration": 3600.0, "run.output_step": 1.0})


def test_what_an_fmu_says_of_its_slope_is_taken(tmp_path: Path) -> None:
    """A macro step's error falls where the derivative need not be guessed from differences."""
    scene, true = motor(tmp_path, derivative=True), plain(tmp_path, 0.02)
    macro = {"coupling.method": "macro-steps", "coupling.macro_step": 1e-3}
    known = off(here(scene, macro), true)
    scene.write_text(scene.read_text().replace("scale = 0.05", 'scale = 0.05\nslope = "held"', 1))
    assert off(here(scene, macro), true) > 0.0 and known < 0.05


def test_slopes_that_an_fmu_tells_only_after_its_first_step_are_taken(tmp_path: Path) -> None:
    """OpenModelica's FMUs tell of a derivative that is no number before it."""
    scene, true = motor(tmp_path, slopes=True), plain(tmp_path, 0.02)
    assert off(here(scene, {}), true) < 5e-5


TELLS = "places[k] == OMEGA ? value(m, ALPHA) : 0.0;"


@pytest.mark.parametrize(
    "wrong",
    [
        "-value(m, ALPHA)",
        pytest.param("3.0 * value(m, ALPHA)", marks=pytest.mark.slow),
        pytest.param("value(m, OMEGA)", marks=pytest.mark.slow),
    ],
)
def test_a_slope_by_which_nothing_changes_is_refused(tmp_path: Path, wrong: str) -> None:
    recompiled(tmp_path, (TELLS, f"places[k] == OMEGA ? {wrong} : 0.0;"))
    scene, true = motor(tmp_path, slopes=True), plain(tmp_path, 0.02)
    macro = {"coupling.method": "macro-steps", "coupling.macro_step": 1e-4}
    for given in ({}, {"coupling.method": "redo"}, macro):
        with pytest.raises(BadInput, match=r'Rotor\.fmu: .*"rotor\.omega": .*"difference"'):
            here(scene, given)
    text = scene.read_text()
    scene.write_text(text.replace("scale", 'slope = "difference"\nscale', 1))
    assert off(here(scene, {}), true) < 5e-5
    scene.write_text(text.replace("scale", 'slope = "omega"\nscale', 1))
    with pytest.raises(BadInput, match="does not change by its slope"):
        here(scene, {})


def test_the_slope_of_a_ram_that_rings_in_its_wall_is_not_refused() -> None:
    """In steps longer than the ringing its little changes lie beyond the slopes at both ends."""
    settings = {"frequency": 12.685, "amplitude": 8.142, "offset": 0.379}
    given = {f"drive.{key}": value for key, value in settings.items()}
    given |= {"fmu.rig.normal_force": 0.4539, "run.duration": 0.3}
    assert simulate(load("closed-grip", given)).summary["rig.v_part.rms"] > 1e-3


@pytest.mark.parametrize("tells", ["-9.81", "0.0"])
def test_slopes_of_what_jumps_or_is_held_are_not_refused(tmp_path: Path, tells: str) -> None:
    """A ball that jumps each third step; and what has no slope at all, as a sampled value."""
    recompiled(tmp_path, (TELLS, f"places[k] == V ? {tells} : 0.0;"), ("*= -0.5", "*= -1.0"))
    build(tmp_path, "Load", slopes=True)
    (tmp_path / "rl.cir").write_text("* r\nVf y 0 0\nR1 y 0 1\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD.replace("load.y", "load.v"))
    given = {"run.duration": 0.02, "fmu.load.drop": 2e-8, "coupling.method": "macro-steps"}
    for macro in (2e-5, 5e-5):
        speed = here(tmp_path / "load.toml", given | {"coupling.macro_step": macro})
        assert np.ptp(speed.columns["load.v"]) > 1e-3


LOAD = """
[circuit]
model = "file"
netlist = "rl.cir"
max_step = 1e-6
[[fmu]]
name = "load"
file = "Load.fmu"
[[port]]
source = "Vf"
from = "load.y"
[[port]]
probe = "i(Vf)"
to = "load.u"
[run]
duration = 2e-4
output_step = 2e-7
settle = 0
"""
RL = "V1 in 0 PULSE(0 1 5u 2u 2u 40u 90u)\nR1 in x 1\nL1 x y 10u\n"


def against_one_netlist(
    folder: Path, load_of_it: str, overrides: dict[str, float]
) -> tuple[Run, dict[str, Array], dict[str, Array]]:
    """The run of load.toml, which repeats steps; ngspice alone with this element instead, in steps
    as long, and in short ones."""
    decks = [
        f"* load\n{RL}Vf y z 0\n{load_of_it}\n.options reltol={reltol}\n"
        f".tran {step} 2e-4 0 {step}\n.end\n"
        for reltol, step in (("1e-5", "1u"), ("1e-7", "5n"))
    ]
    plain, fine = spice.run_all(folder, *decks)
    with in_place():
        run = Run(load(folder / "load.toml", overrides), lambda _: None)
        run.run()
    assert run.plan.method == "redo"
    return run, plain, fine


def apart(time: Array, current: Array, fine: dict[str, Array]) -> float:
    """At the solvers' own points, since straight lines between them err more than either."""
    return float(np.abs(current - np.interp(time, fine["time"], fine["vf#branch"])).max())


def error(run: Run, fine: dict[str, Array]) -> float:
    time, _, current = run.log.array().T
    return apart(time, current, fine)


@pytest.mark.parametrize("gain", [0.5, 2.0, 10.0, 100.0])
@pytest.mark.parametrize("version", [2, 3])
def test_feedthrough_is_as_exact_as_one_netlist(tmp_path: Path, gain: float, version: int) -> None:
    build(tmp_path, "Load", version, through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    run, plain, fine = against_one_netlist(tmp_path, f"R2 z 0 {gain}", {"fmu.load.D": gain})
    # The circuit itself carries what is fed through, so that no more steps are tried than alone.
    assert run.state.attempts < 1.5 * len(plain["time"])
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


@pytest.mark.parametrize("gain", [0.5, 100.0])
@pytest.mark.parametrize("start", [0.0, 0.7])
def test_a_run_begins_at_the_operating_point_with_what_is_fed_through(
    tmp_path: Path, gain: float, start: float
) -> None:
    """A battery's current through the FMU's resistor, and nothing that changes."""
    build(tmp_path, "Load", through=True)
    (tmp_path / "rl.cir").write_text("* load\nV1 in 0 5\nR1 in x 1\nL1 x y 10u\nVf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    columns = here(tmp_path / "load.toml", {"fmu.load.D": gain, "fmu.load.u": start}).columns
    current = 5.0 / (1.0 + gain)
    assert columns["i(Vf)"] == pytest.approx(current, rel=1e-6)
    assert columns["load.y"] == pytest.approx(gain * current, rel=1e-6)


def test_a_comparator_that_the_circuit_leaves_when_it_switches(tmp_path: Path) -> None:
    """A relaxation oscillator: no value of the source at the end of a step agrees where the
    comparator turns it back."""
    turned = "((Model *)m)->r[D] = m->r[U] > 0.5 ? -1.0 : m->r[U] < -0.5 ? 1.0 : m->r[D]"
    recompiled(tmp_path, ("m->r[D] * m->r[U]", turned))
    build(tmp_path, "Load", through=True)
    (tmp_path / "rl.cir").write_text("* rc\nVf y 0 0\nR1 y c 1k\nC1 c 0 1u\n.ic v(c)=0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD.replace('"i(Vf)"', '"v(c)"'))
    with in_place():
        run = Run(load(tmp_path / "load.toml", {"run.duration": 0.01}), lambda _: None)
        run.run()
    assert run.plan.method == "redo"
    place = next(place for _, name, place, _ in run.plan.outputs() if name == "load.y")
    times, values = run.points.array()[:, 0], run.points.array()[:, 1 + place]
    switched = times[1:][np.diff(values) != 0.0]
    expected = 1e-3 * (np.log(2.0) + np.log(3.0) * np.arange(len(switched)))
    assert len(switched) == 9
    assert switched == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("version", [2, 3])
def test_feedthrough_that_no_fmu_declares_is_as_exact(tmp_path: Path, version: int) -> None:
    """A model structure without dependencies, as pythonfmu writes it, says nothing of them."""
    build(tmp_path, "Load", version)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    run, plain, fine = against_one_netlist(tmp_path, "R2 z 0 10", {"fmu.load.D": 10.0})
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)
    build(tmp_path, "Load", version, saves=False)
    with pytest.raises(BadInput, match=r"Load\.fmu: load\.u to load\.y is fed through at once, so"):
        here(tmp_path / "load.toml", {})


def test_feedthrough_one_way_that_no_fmu_declares_is_as_exact(tmp_path: Path) -> None:
    """A diode with a resistor in series; more of u at the start, 0, leaves it blocked."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->r[D] * fmax(0.0, -m->r[U])"))
    build(tmp_path, "Load")
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD.replace('"load.u"', '"load.u"\nscale = -1'))
    run, plain, fine = against_one_netlist(
        tmp_path, "B2 z 0 V=10*max(0,i(B2))", {"fmu.load.D": 10.0}
    )
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


def test_feedthrough_that_shows_at_the_end_alone_is_told(tmp_path: Path) -> None:
    """A diode with a threshold: without repeated steps its voltage reached 2.7 V on 1 V."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->r[D] * fmax(0.0, m->r[U] - 0.02)"))
    build(tmp_path, "Load")
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    summary = here(tmp_path / "load.toml", {"fmu.load.D": 100.0}).summary
    assert summary["method"] == "step-locked" and summary["Vf.greatest"] > 2.0
    assert any("load.u to load.y" in n and '"redo" is as exact' in n for n in summary["notes"])
    redo = {"fmu.load.D": 100.0, "coupling.method": "redo"}
    summary = here(tmp_path / "load.toml", redo).summary
    assert summary["Vf.greatest"] == pytest.approx(100.0 * (1.0 - 0.02) / 101.0, rel=1e-3)
    assert not any("load.u to load.y" in note for note in summary["notes"])


def test_feedthrough_of_a_product_that_no_fmu_declares_is_as_exact(tmp_path: Path) -> None:
    """Of two inputs that begin at 0, so that neither alone changes it."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->r[D] * m->r[U] * m->r[X1]"))
    build(tmp_path, "Load", 3)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    other = '[[port]]\nprobe = "abs(i(Vf))"\nto = "load.x[1]"\n[run]'
    (tmp_path / "load.toml").write_text(LOAD.replace("[run]", other))
    run, plain, fine = against_one_netlist(
        tmp_path, "B2 z 0 V=10*i(B2)*abs(i(B2))", {"fmu.load.D": 10.0}
    )
    time, current = run.log.array()[:, 0], run.log.array()[:, 2]
    assert apart(time, current, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


def test_feedthrough_of_an_input_that_cannot_be_read_is_as_exact(tmp_path: Path) -> None:
    """An element of an array, which the FMU takes but does not give back."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->r[D] * m->r[X1]"))
    build(tmp_path, "Load", 3)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD.replace("load.u", "load.x[1]"))
    run, plain, fine = against_one_netlist(tmp_path, "R2 z 0 10", {"fmu.load.D": 10.0})
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


@pytest.mark.parametrize("gain", [0.5, 10.0])
def test_feedthrough_by_way_of_another_fmu_is_as_exact(tmp_path: Path, gain: float) -> None:
    """The source is from the second FMU, of which the scene tells first."""
    build(tmp_path, "Load", through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    two = LOAD.replace('name = "load"', 'name = "second"').replace('"load.y"', '"second.y"')
    first = '[[fmu]]\nname = "load"\nfile = "Load.fmu"\n[[port]]\nfrom = "load.y"\nto = "second.u"'
    (tmp_path / "load.toml").write_text(two.replace("[run]", f"{first}\n[run]"))
    run, plain, fine = against_one_netlist(
        tmp_path, f"R2 z 0 {gain**2}", {"fmu.load.D": gain, "fmu.second.D": gain}
    )
    assert run.state.attempts < 1.5 * len(plain["time"])
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


@pytest.mark.parametrize("gain", [1.0, 100.0])
def test_feedthrough_that_is_no_line_is_as_exact(tmp_path: Path, gain: float) -> None:
    """Its steps leave the line without an event."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->r[D] * m->r[U] * m->r[U] * m->r[U]"))
    build(tmp_path, "Load", through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    run, plain, fine = against_one_netlist(
        tmp_path, f"B2 z 0 V={gain}*i(B2)^3", {"fmu.load.D": gain}
    )
    assert run.state.attempts < 3.0 * len(plain["time"])
    assert error(run, fine) <= 1.5 * apart(plain["time"], plain["vf#branch"], fine)


def test_feedthrough_needs_an_fmu_that_saves_its_state(tmp_path: Path) -> None:
    build(tmp_path, "Load", saves=False, through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    for overrides in ({}, {"coupling.method": "redo"}):
        with pytest.raises(BadInput, match=r"Load\.fmu: .*canGetAndSetFMUstate = true"):
            here(tmp_path / "load.toml", overrides)
    (note,) = here(tmp_path / "load.toml", {"coupling.method": "step-locked"}).summary["notes"]
    assert "load.u to load.y" in note and "redo" not in note
    build(tmp_path, "Load", through=True)
    (note,) = here(tmp_path / "load.toml", {"coupling.method": "step-locked"}).summary["notes"]
    assert 'coupling.method = "redo" is' in note


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_that_does_not_go_back_is_not_repeated(tmp_path: Path, version: int) -> None:
    """It says that it can. What no port leads on is told; its steps agree."""
    restore = "int fmi2SetFMUstate(void *m, void *state) { return "
    recompiled(tmp_path, (f"{restore}!memcpy(m, state, sizeof(Model)); }}", f"{restore}0; }}"))
    redo = {"coupling.method": "redo", "run.duration": 1e-3}
    with pytest.raises(BadInput, match=r"Rotor\.fmu: .*another rotor\.omega, .* not restore"):
        here(motor(tmp_path, version=version), redo)
    build(tmp_path, "Load", version=version, through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    (note,) = here(tmp_path / "load.toml", {}).summary["notes"]
    assert re.match(r"repeated steps change load.omega, load.v, .*load.steps,", note)


def test_an_fmu_of_fixed_steps_that_feeds_through_is_not_repeated(tmp_path: Path) -> None:
    build(tmp_path, "Load", fixed=True, through=True)
    (tmp_path / "rl.cir").write_text(f"* load\n{RL}Vf y 0 0\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD)
    result = here(tmp_path / "load.toml", {"run.duration": 1e-3, "fmu.load.D": 0.5})
    assert result.summary["method"] == "macro-steps"


def test_outputs_that_settle_do_not_move_in_steps_of_their_own(tmp_path: Path) -> None:
    """The ball lies on the floor after the seventh part of the run, and nothing else moves."""
    build(tmp_path, "Load")
    (tmp_path / "rl.cir").write_text("* r\nVf y 0 0\nR1 y 0 1\n.end\n")
    (tmp_path / "load.toml").write_text(LOAD.replace("load.y", "load.v"))
    given = {"run.duration": 2e-3, "fmu.load.drop": 1e-8, "coupling.method": "step-locked"}
    given |= {"circuit.max_step": 1e-5}
    result = here(tmp_path / "load.toml", given)
    still = np.diff(result.columns["load.v"]) == 0.0
    assert 0.5 < still.mean() < 0.99 and still[-100:].all()
    told = "a [[port]] leads load.v [m/s] to Vf [V] without a scale."
    assert result.summary["notes"] == [told]
    reworded(tmp_path / "Load.fmu", ('unit="m/s"', 'unit="V"'))
    assert here(tmp_path / "load.toml", given).summary["notes"] == []


def test_an_event_of_an_fmu_is_found(tmp_path: Path) -> None:
    """A ball above a coil: its velocity, which induces the voltage, jumps at each impact. The
    FMU tells nobody when; a step that ends beyond it is repeated."""
    build(tmp_path, "Load")
    (tmp_path / "rl.cir").write_text("* coil\nR1 x 0 1\nL1 x y 1m\nVf y 0 0\n.end\n")
    text = LOAD.replace("load.y", "load.v").replace("max_step = 1e-6", "max_step = 1e-4")
    (tmp_path / "ball.toml").write_text(text)
    given = {"run.duration": 0.12, "run.output_step": 1e-4, "coupling.method": "redo"}
    with in_place():
        run = Run(load(tmp_path / "ball.toml", given), lambda _: None)
        run.run()
    first = np.sqrt(2 * 0.01 / 9.81)
    impacts = first * np.array([1.0, 2.0, 2.5])  # each flight takes half as long as the last
    assert impacts[-1] < 0.12
    times, speeds = run.points.array()[:, 0], run.points.array()[:, 1 + 3]
    after = np.searchsorted(times, impacts)
    assert (times[after] - times[after - 1]).max() <= 1.01e-9
    hit = 9.81 * first
    assert speeds[after - 1] == pytest.approx(-hit * np.array([1, 0.5, 0.25]), rel=1e-6)
    assert speeds[after] == pytest.approx(hit * np.array([0.5, 0.25, 0.125]), rel=1e-6)
    assert run.steps < 3000


EDGES = """
.param per=50u
.param edge=1u
.subckt pw o
V1 o 0 PULSE(0 1 0 {edge} {edge} {per/2-edge} {per})
.ends
X1 p pw
V2 q 0 PULSE(0 1 {per/4} {per/2} {per/2} 0 {per})
V3 z 0 PULSE(0 1 0 0 0 {per/2} {per})
R3 z 0 1
R1 p x 1
L1 x y 1m
R2 q 0 1
Vemf y 0 0
.end
"""


@pytest.mark.parametrize(
    "period",
    [5e-5, 3.1415926e-5, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-4, 2e-5, 3e-5))],
)
def test_no_edge_of_a_pulse_is_lost(tmp_path: Path, period: float) -> None:
    """A step ends on each corner, whatever lengths the steps have; also within a subcircuit."""
    scene = motor(tmp_path)
    (tmp_path / "bridge.cir").write_text(f"* edges{EDGES}")
    text = scene.read_text().replace('["v(a)*i(Vemf)", "v(gp)"]', '["v(p)"]')
    scene.write_text(text)
    duration = 40 * period
    starts = np.arange(40) * period
    corners = np.concatenate(
        [starts + at for at in (1e-6, period / 2, period / 2 + 1e-6)]
        + [starts + share * period for share in (0.25, 0.75)]
    )
    for step in (1e-6, 2e-6, 5e-6, 1e-5, 2e-5):
        edges = np.concatenate([starts + at for at in (0.01 * step, period / 2 + 0.02 * step)])
        for macro in (None, 1e-5, 2e-5, 2.5e-5, 3e-5, 5e-5, 1e-4, 2e-4):
            given = {"circuit.param.per": period, "circuit.max_step": step}
            given |= {"run.duration": duration, "run.settle": 0.0}
            if macro:
                given |= {"coupling.method": "macro-steps", "coupling.macro_step": macro}
            with in_place():
                run = Run(load(scene, given), lambda _: None)
                run.run()
            times = run.log.column()
            every = np.concatenate([corners, edges])
            nearest = np.abs(times[np.searchsorted(times, every - 1e-12)] - every)
            assert nearest.max() < 1e-11, (step, macro)


PULSE = "V1 p 0 PULSE(0 1 0 1u 1u 24u 50u)"
DRIVEN = """
.param coil_resistance=7.1 coil_inductance=1.2m eddy_inductance=0 eddy_resistance=1 count=1
V1 p 0 PULSE(0 1 0 1u 1u 24u 50u)
V2 r 0 PWL(0 0 5m 0 5.001m 1 10m 1 10.001m 0)
R1 p 0 1
R2 r 0 1
C1 r p 1u
Vcommand v1 0 0
Rv v1 0 1k
Bout out 0 V=V(v1)*V(p)
Rcoil out c1 {coil_resistance/count}
Lcoil c1 c2 {coil_inductance/count}
Leddy c2 c3 {eddy_inductance/count}
Reddy c2 c3 {eddy_resistance/count}
Vemf c3 sense 0
Rs sense 0 1
.end
"""


@pytest.mark.parametrize("frequency", [50, 100, 200])
def test_a_jump_of_the_drive_on_an_edge_of_the_circuit_is_one_time(
    tmp_path: Path, frequency: float
) -> None:
    """Each is computed by another program, a rounding apart; led on the machine and with FMUs."""
    scene = motor(tmp_path)
    (tmp_path / "bridge.cir").write_text(f"* edges{DRIVEN}")
    port = '\n[[port]]\nfrom = "drive"\nsource = "Vcommand"\n'
    scene.write_text(scene.read_text().replace('["v(a)*i(Vemf)", "v(gp)"]', '["v(p)"]') + port)
    given = {"drive.waveform": "square", "drive.amplitude": 2, "drive.offset": 0}
    given |= {"drive.frequency": frequency, "run.duration": 0.0201, "run.settle": 0.0}
    own = {"circuit.model": "file", "circuit.netlist": tmp_path / "bridge.cir"}
    edges = np.arange(1, 400) * 5e-5
    for step in (2e-6, 5e-6):
        with in_place():
            run = Run(load(scene, {**given, "circuit.max_step": step}), lambda _: None)
            run.run()
            alone = load("paper-limited", {**given, **own, "circuit.max_step": step})
            with closing(Mechanics(alone)) as mechanics:
                lead = coupled(alone, Recorder(alone, mechanics, lambda _: None))
                lead.run()
        for times in (run.log.column(), lead.log()["time"]):
            assert (
                np.diff(times).min() > 1e-15
            )  # ngspice itself begins again with a part of the last
            assert np.abs(times[np.searchsorted(times, edges - 1e-12)] - edges).max() < 1e-12


def test_no_corner_of_a_triangle_is_lost_on_the_machine(tmp_path: Path) -> None:
    """ngspice itself meets the next corner only if a step ends within 1e-7 of the pulse's width of
    this one, which rounding alone misses. Without corners a bridge's current was off by a third."""
    triangle = "V1 p 0 PULSE(-1 1 0 50u 50u 1n 100.001u)"
    (own := tmp_path / "own.cir").write_text("* triangle" + DRIVEN.replace(PULSE, triangle))
    given = {"circuit.model": "file", "circuit.netlist": own, "run.duration": 0.005}
    scene = load("paper-limited", given | {"run.settle": 0.0})
    with in_place(), closing(Mechanics(scene)) as mechanics:
        lead = coupled(scene, Recorder(scene, mechanics, lambda _: None))
        lead.run()
    times, starts = lead.log()["time"], np.arange(1, 49) * 100.001e-6
    for corners in (starts, starts + 50e-6, starts + 50.001e-6):
        assert np.abs(times[np.searchsorted(times, corners - 1e-12)] - corners).max() < 1e-12


@pytest.mark.slow
def test_edges_that_rounding_parts_are_one(tmp_path: Path) -> None:
    """From 1/16 s on, times are further apart than what ngspice takes for one with such steps."""
    scene, times = motor(tmp_path), {"run.duration": 0.066, "run.settle": 0.0}
    with in_place():
        run = Run(load(scene, {"circuit.max_step": 1e-7, **times}), lambda _: None)
        run.run()
    late = run.log.column()[-60_000:]
    assert late[0] < 0.0625 < late[-1]
    assert np.diff(late).min() > 1e-12


def test_arrays_truth_values_and_whole_numbers(tmp_path: Path) -> None:
    """Two FMUs and a drive: the second is fed by the first and switched off by a voltage."""
    build(tmp_path, "Three", 3)
    (tmp_path / "rc.cir").write_text(
        "* rc\nVin in 0 0\nR1 in out 1k\nC1 out 0 1u\nVoff off 0 PULSE(0 1 5m 1u 1u 1 2)\n"
        "R2 off 0 1k\nIload 0 out 0\n.end\n"
    )
    (tmp_path / "two.toml").write_text("""
[circuit]
model = "file"
netlist = "rc.cir"
save = ["v(out)"]
[drive]
waveform = "square"
frequency = 200
amplitude = 2
offset = 1
[[fmu]]
name = "a"
file = "Three.fmu"
parameters = { J = 1e-3, B = 1.0 }
[[fmu]]
name = "b"
file = "Three.fmu"
parameters = { J = 1e-3, B = 1.0, "x[0]" = 0.5, "x[1]" = -0.5 }
[[port]]
from = "drive"
source = "Vin"
[[port]]
probe = "v(out)"
to = "a.x[1]"
[[port]]
from = "a.xs[1]"
to = "b.u"
[[port]]
probe = "v(off)"
to = "a.off"
[[port]]
from = "b.omega"
source = "Iload"
scale = 0.0
offset = 1e-6
[run]
duration = 0.01
settle = 0.005
""")
    result = here(tmp_path / "two.toml", {})
    waves, time = result.columns, result.columns["time"]
    before, after = time < 4.9e-3, time > 5.1e-3
    # First-order lags of 1 ms each: in the circuit, in a, and in b, whose input is -a.
    t, tau = time[before & (time < 2.4e-3)], 1e-3
    x = t / tau
    rising = 2.0 * (1.0 - np.exp(-x))
    a = 2.0 * (1.0 - (1.0 + x) * np.exp(-x))
    b = -2.0 * (1.0 - (1.0 + x + x**2 / 2) * np.exp(-x))
    first = slice(0, len(t))
    assert waves["v(out)"][first] - 1e-3 == pytest.approx(rising, abs=2e-3)
    assert waves["a.omega"][first] == pytest.approx(a, abs=2e-3)
    assert waves["a.xs[1]"][first] == pytest.approx(-a, abs=2e-3)
    assert waves["b.omega"][first] == pytest.approx(b, abs=2e-3)
    off_at = np.interp(5.0e-3, time, waves["a.omega"])
    gone = off_at * np.exp(-(time[after] - 5e-3) / tau)
    assert waves["a.omega"][after] == pytest.approx(gone, abs=5e-3)
    assert (waves["a.steps"] == np.round(waves["a.steps"])).all()
    assert result.units["Iload"] == "A" and result.units["a.omega"] == "rad/s"
    assert result.summary["Iload.mean"] == pytest.approx(1e-6)
    settled = np.abs(time - 5e-3) < 1e-9
    assert result.summary["a.omega.greatest"] == pytest.approx(
        float(waves["a.omega"][settled][0]), rel=1e-3
    )


@pytest.mark.parametrize("bits", [8, 16, 32])
@pytest.mark.parametrize("sign", ["", "U"])
def test_a_whole_number_beyond_its_type_is_the_limit(tmp_path: Path, bits: int, sign: str) -> None:
    """It has wrapped around: 200 was -56. What the FMU was given comes back as an output."""
    kind, of = f"{sign}Int{bits}", f"{sign.lower()}int{bits}_t"
    known = f"int fmi3Set{kind}(Model *m, void *p, size_t n, {of} *x, size_t k)"
    recompiled(
        tmp_path,
        (f"STUB(fmi3Set{kind})", f"{known} {{ if (n) m->r[DROP] = *x; return 0; }}"),
        ("case Y: return", "case Y: return m->r[DROP]; case DROP: return"),
    )
    scene = motor(tmp_path, version=3)
    boolean = '<Boolean name="off" valueReference="20" causality="input" start="false"/>'
    changed = boolean.replace("Boolean", kind).replace("false", "0")
    reworded(tmp_path / "Rotor.fmu", (boolean, changed))
    port = '[[port]]\nprobe = "v(gp)"\nto = "rotor.off"\nscale = 1e11\noffset = -5e10\n'
    scene.write_text(scene.read_text().replace("[coupling]", f"{port}[coupling]"))
    given = here(scene, {"run.duration": 1e-3, "run.output_step": 1e-5}).columns["rotor.y"]
    least = 0 if sign else -(2 ** (bits - 1))
    most = 2 ** (bits if sign else bits - 1) - 1
    assert given[[15, 25]] == pytest.approx([least, most], rel=1e-12)


def test_fixed_steps_take_macro_steps(tmp_path: Path) -> None:
    result = here(motor(tmp_path, fixed=True), {"run.duration": 1e-3})
    assert result.summary["method"] == "macro-steps" and result.summary["fmu_steps"] == 10


@pytest.mark.checked
@pytest.mark.parametrize(
    ("fixed", "refused"), [(True, "fabs(h / 1e-4 - rint(h / 1e-4)) > 1e-6"), (False, "h > 1e-5")]
)
def test_the_error_is_told_where_an_fmu_discards_other_steps(
    tmp_path: Path, fixed: bool, refused: str
) -> None:
    """It takes whole multiples of its own step: 3.5 of them failed, and no error was told; or none
    as long as those of the second run, so shorter ones tell it."""
    strict = f"int a) {{ return {refused} ? 2 : ((void)a, step"
    ended = ("(m, time, h); }", "(m, time, h)); }")
    recompiled(tmp_path, ("int a) { return (void)a, step", strict), ended)
    scene, true = motor(tmp_path, fixed=fixed), plain(tmp_path, 0.02)
    found = cosim.run(scene, {"run.settle": 0.01}).summary
    late = true["time"] >= 0.01
    mean = np.trapezoid(true["omega"][late], true["time"][late]) / 0.01
    assert found["method"] == ("macro-steps" if fixed else "step-locked")
    assert abs(found["rotor.omega.mean"] - mean) < 2.0 * found["rotor.omega.mean_error"]


@pytest.mark.checked
def test_errors_that_no_other_run_shows_are_told_as_not_known(tmp_path: Path) -> None:
    strict = ("int a) { return (void)a, step", "int a) { return h != 1e-4 ? 2 : ((void)a, step")
    recompiled(tmp_path, strict, ("(m, time, h); }", "(m, time, h)); }"))
    found = cosim.run(motor(tmp_path, fixed=True), {"run.duration": 2e-3}).summary
    assert not any(name.endswith("_error") for name in found)
    assert "errors of the means are not known" in found["notes"][-1]


FIXED = 'canHandleVariableCommunicationStepSize="false"'


@pytest.mark.parametrize(("version", "own"), [(2, "2e-3"), (2, "x"), (3, "3e-5")])
def test_steps_that_an_fmu_tells_are_told(tmp_path: Path, version: int, own: str) -> None:
    scene = motor(tmp_path, version=version, fixed=True)
    usual = ("<ModelVariables>", f'<DefaultExperiment stepSize="{own}"/><ModelVariables>')
    internal = (FIXED, f'{FIXED} fixedInternalStepSize="{own}"')
    reworded(tmp_path / "Rotor.fmu", usual if version == 2 else internal)
    taken = {"2e-3": 2e-3, "x": 1e-4, "3e-5": 9e-5}[own]
    notes = here(scene, {}).summary["notes"]
    told = re.findall(
        r"steps are of \S+ s, .*macro_step = 0\.0001 s .*; (\S+) s is", "".join(notes)
    )
    assert [float(each) for each in told] == ([] if own == "x" else [pytest.approx(taken)])
    assert here(scene, {"coupling.macro_step": taken}).summary["notes"] == []
    (note,) = here(scene, {"coupling.method": "step-locked"}).summary["notes"]
    assert "rotor says that it takes steps of one length alone" in note


def test_a_scene_with_ports_is_written_and_read(tmp_path: Path) -> None:
    scene = load(motor(tmp_path), {"fmu.rotor.J": 3e-4, "circuit.param.vdd": 12.0})
    path = tmp_path / "again.toml"
    path.write_text(to_toml(scene))
    assert load(path).as_dict() == {**scene.as_dict()}
    other = changed(scene, {"fmu.rotor.J": 1e-4}, "test")
    assert other.fmu[0].parameters == {"J": 1e-4, "B": 1e-4}


def test_a_sweep_goes_over_parameters_of_fmus_and_circuit(tmp_path: Path) -> None:
    over = {"fmu.rotor.J": [1e-4, 2e-4], "circuit.param.vdd": [12.0, 24.0]}
    with in_place():
        data = cosim.sweep(motor(tmp_path), over, {"run.duration": 2e-3})
    speed = data["rotor.omega.greatest"].values
    assert speed.shape == (2, 2) and (np.abs(speed[0]) > np.abs(speed[1])).all()
    assert (data["failure"].values == "").all()
    units = {name: of.attrs.get("units") for name, of in data.data_vars.items()}
    assert units["rotor.omega.greatest"] == "rad/s" and units["v(gp).mean"] == "V"
    assert (units["Vemf.mean"], units["Vemf.power"], units["v(a)*i(Vemf).rms"]) == ("V", "W", "W")


def test_a_sweep_goes_over_truth_values_and_elements_of_arrays(tmp_path: Path) -> None:
    """What is switched off has no torque: the speed stays 0."""
    over = {"fmu.rotor.off": [0, 1], "fmu.rotor.x[1]": [0.1, 0.2]}
    scene = motor(tmp_path, version=3)
    reworded(tmp_path / "Rotor.fmu", ('name="xs"', 'name="xs" unit="rad/s"'))
    with in_place():
        data = cosim.sweep(scene, over, {"run.duration": 1e-3})
        with pytest.raises(BadInput, match=r"off = 0\.5 must be true or false"):
            cosim.run(scene, {"fmu.rotor.off": 0.5})
    speeds = data["rotor.xs[0].greatest"]
    assert speeds.attrs["units"] == "rad/s"
    on, off = speeds.values
    assert on[1] > on[0] and on.all() and not off.any()


def test_an_fmu_that_ends_its_process_or_fails_is_told(tmp_path: Path) -> None:
    scene = motor(tmp_path)
    with pytest.raises(SimulationFailed, match=r"died after t = .*SIGABRT"):
        cosim.run(scene, {"run.duration": 2e-3, "fmu.rotor.crash_at": 1e-3})
    with pytest.raises(SimulationFailed, match=r"rotor failed at t = .*the bearing is worn out"):
        cosim.run(scene, {"run.duration": 2e-3, "fmu.rotor.fail_at": 1e-3})
    for method in ("step-locked", "redo"):
        given = {"run.duration": 2e-3, "fmu.rotor.B": 0.0, "coupling.method": method}
        with pytest.raises(SimulationFailed, match=r"output rotor\.\w+ is not a finite number"):
            cosim.run(scene, given)


def test_what_is_no_number_ends_a_run_only_where_it_is_read(tmp_path: Path) -> None:
    recompiled(
        tmp_path,
        ("case ALPHA: return", "case ALPHA: return m->steps == 5 ? NAN :"),
        ("case Y: return m->r[D] * m->r[U];", "case Y: return INFINITY;"),
    )
    scene = motor(tmp_path)
    given = {"run.duration": 1e-3, "coupling.method": "step-locked"}
    result = here(scene, given)
    (note,) = result.summary["notes"]
    assert re.search(r"nothing reads them: rotor\.alpha \(first at t = [1-9]\S+ s\)", note)
    assert "rotor.y (first at t = 0 s)" in note
    assert {"rotor.alpha", "rotor.y", "rotor.omega"} & {*result.columns} == {"rotor.omega"}
    scene.write_text(scene.read_text().replace("rotor.omega", "rotor.alpha"))
    with pytest.raises(SimulationFailed, match=r"output rotor\.alpha is not a finite number at"):
        here(scene, given)


def test_ground_may_be_kept(tmp_path: Path) -> None:
    scene = motor(tmp_path)
    given = {"run.duration": 1e-3, "circuit.save": ["v(0)", "v(a, 0)", "v(GND)"]}
    columns = here(scene, given).columns
    assert not columns["v(0)"].any() and not columns["v(GND)"].any()


def test_structures_have_the_sizes_that_the_compiled_ones_have() -> None:
    kinds = (Group, Source, Feed, StrangerState, Pulse, Through, Slope, PortsState)
    assert [ctypes.sizeof(kind) for kind in kinds] == [
        loop().loop_size(k) for k in range(5, 5 + len(kinds))
    ]
