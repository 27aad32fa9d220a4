"""What runs with ports tell of the errors of their means, against the means of finer steps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.files.resources import circuits
from cosim.scene import Scene, load
from cosim.simulation import checks
from cosim.simulation.simulate import simulate
from cosim.toolchain.threads import Progress
from cosim.waveforms.report import table
from tests.ports.foreign import build, recompiled
from tests.simulation.test_checks import within_twice_the_told

pytestmark = [pytest.mark.physics, pytest.mark.checked]

PWM = {
    "fmu.gear.friction": 2.0,
    "circuit.param.inductance": 4e-3,
    "circuit.max_step": 1e-5,
    "run.duration": 0.06,
    "run.settle": 0.02,
}
"""Edges of 1 µs rule the steps; the bridge's switches store nothing that could tell their error."""

FINE = {"circuit.max_step": 2e-6, "circuit.reltol": 1e-7}


def test_edges_that_two_runs_meet_alike_do_not_hide_the_error() -> None:
    """Of a run with longer steps alone 0.3 to 1 % of the error was told."""
    found = simulate(load("dc-motor", PWM), checks="usual").summary
    true = simulate(load("dc-motor", PWM | FINE)).summary
    for name in ("gear.speed.mean", "gear.angle.mean", "Vemf.mean"):
        assert abs(found[name] - true[name]) > 1e-4 * abs(true[name])
        assert within_twice_the_told(found[name], found[f"{name}_error"], true[name])
        assert found[f"{name}_error"] < 20.0 * abs(found[name] - true[name])
    assert not any("may move" in note for note in found["notes"])


def test_a_comparator_that_longer_steps_pass_over_does_not_hide_the_error(tmp_path: Path) -> None:
    """Both runs erred alike: 3 rad/s were told for 25, of 72."""
    text = (circuits() / "ports" / "dc_motor.cir").read_text(encoding="utf-8")
    gate = next(line for line in text.splitlines() if line.startswith("Bgate"))
    carrier = "Vtri tri 0 SIN(0 1 30k)\nBgate gate 0 V=0.5+0.5*tanh(200*(0.5-V(tri)))"
    path = tmp_path / "sine.cir"
    path.write_text(text.replace(gate, carrier))
    own = {"circuit.netlist": str(path), "circuit.max_step": 2e-5}
    own |= {"run.duration": 0.04, "run.settle": 0.02}
    found = simulate(load("dc-motor", own), checks="usual").summary
    true = simulate(load("dc-motor", own | {"circuit.max_step": 1e-6, "circuit.reltol": 1e-7}))
    for name in ("gear.speed.mean", "gear.angle.mean", "i(Vemf).mean"):
        told, off = found[f"{name}_error"], abs(found[name] - true.summary[name])
        assert off > 0.2 * abs(true.summary[name])
        assert within_twice_the_told(found[name], told, true.summary[name])
        assert told < 20.0 * off
    (note,) = (each for each in found["notes"] if "may move the mean of" in each)
    assert "more than a tenth of its rms" in note and "circuit.max_step = 6e-06)" in note


CHOPPER = """* chopper
Vb b 0 12
Vf b p 0
Vg g 0 PULSE(0 1 5u 50n 50n 8u 20u)
Vn n 0 PULSE(1 0 5u 50n 50n 8u 20u)
S1 p s g 0 SM
S2 s 0 n 0 SM
.model SM SW(VT=0.5 VH=0 RON=30m ROFF=1e7)
L1 s o 47u
C1 o 0 47u
R1 o 0 1.5
.end
"""
CHOPPED = """
[circuit]
model = "file"
netlist = "chopper.cir"
save = ["v(o)", "v(p)"]
[[fmu]]
name = "load"
file = "Load.fmu"
parameters = { D = 0.1 }
[[port]]
source = "Vf"
from = "load.y"
[[port]]
probe = "i(Vf)"
to = "load.u"
[coupling]
method = "step-locked"
[run]
duration = 3e-3
settle = 1e-3
"""


def chopped(drop: float) -> dict[str, float]:
    """Means of the chopper with a resistor of ``drop`` (Ohm): its switches make linear circuits, a
    matrix exponential each, of the coil's current, the capacitor's voltage and both integrals."""
    on, off = np.zeros((2, 5, 5))
    for rates, resistance, supply in ((on, 0.03 + drop, 12.0), (off, 0.03, 0.0)):
        rates[0, [0, 1, 4]] = np.array([-resistance, -1.0, supply]) / 47e-6
        rates[1, :2] = np.array([1.0, -1.0 / 1.5]) / 47e-6
        rates[2, 0] = rates[3, 1] = 1.0
    state, means = np.array([0.0, 0.0, 0.0, 0.0, 1.0]), np.zeros(2)  # current while on, and v(o)
    state = expm(off * 5.025e-6) @ state
    before = state[3]
    for period in range(150):
        last = period == 149
        after_on = expm(on * 8.05e-6) @ state
        after = expm(off * (11.95e-6 - 5.025e-6 * last)) @ after_on
        if period == 49:
            before = (expm(off * 6.925e-6) @ after_on)[3]  # at 1 ms
        elif period > 49:
            means[0] += after_on[2] - state[2]
        state = after
    current, voltage = means[0] / 2e-3, (state[3] - before) / 2e-3
    return {"i(Vf)": current, "v(o)": voltage, "v(p)": 12.0 - drop * current}


def test_a_lag_between_edges_is_told(tmp_path: Path) -> None:
    """A resistor as an FMU that saves no state, in a current that switches chop: the circuit learns
    of its voltage a step late, and edges rule the steps of all runs alike. Less than half of the
    error was told."""
    build(tmp_path, "Load", saves=False, through=True)
    (tmp_path / "chopper.cir").write_text(CHOPPER)
    (tmp_path / "chopper.toml").write_text(CHOPPED)
    found = simulate(load(tmp_path / "chopper.toml"), checks="usual").summary
    for name, true in chopped(0.1).items():
        told, off = found[f"{name}.mean_error"], abs(found[f"{name}.mean"] - true)
        assert off > 2e-4 * abs(true)
        assert within_twice_the_told(found[f"{name}.mean"], told, true)
        assert told < 20.0 * off


BRIDGE = """* bridge
V1 in 0 SIN(0 1 1k)
R1 in out 1k
C1 out 0 1u
Ra out p 1k
Rb out q 1k
Rc p 0 1k
Rd q 0 1k
Re p q 2k
.end
"""
BALANCED = """
[circuit]
model = "file"
netlist = "balanced.cir"
save = ["v(p)-v(q)"]
[[fmu]]
name = "load"
file = "Load.fmu"
[[port]]
probe = "v(out)"
to = "load.u"
[run]
duration = 0.01
settle = 0.005
"""


def test_a_zero_but_for_rounding_asks_for_no_third_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The voltage across a balanced bridge: its mean differed by 11 % of its rms of 7 aV, so a run
    with steps 3.5 times as short told all errors, and took most of the time."""
    build(tmp_path, "Load")
    (tmp_path / "balanced.toml").write_text(BALANCED)
    (tmp_path / "balanced.cir").write_text(BRIDGE)
    scene, numbers, steps = load(tmp_path / "balanced.toml"), checks._numbers, list[float]()

    def counted(of: Scene, progress: Progress) -> dict[str, Any]:
        steps.append(of.circuit.max_step)
        return numbers(of, progress)

    monkeypatch.setattr(checks, "_numbers", counted)
    found = simulate(scene, checks="usual").summary
    assert found["v(p)-v(q).rms"] < 1e-15
    assert steps == [checks.COARSER * scene.circuit.max_step]


@pytest.mark.parametrize("rows", [2e-5, 2e-6])
def test_a_chopper_as_fast_as_the_rows_is_told(tmp_path: Path, rows: float) -> None:
    """Rows as far apart as its period show what it chops as if it stood."""
    build(tmp_path, "Load", through=True)
    (tmp_path / "chopper.cir").write_text(CHOPPER)
    (tmp_path / "chopper.toml").write_text(CHOPPED.replace("step-locked", "redo"))
    found = simulate(load(tmp_path / "chopper.toml", {"run.output_step": rows})).summary
    told = [note for note in found["notes"] if "changes faster than the rows" in note]
    assert [note.startswith("Vf, i(Vf) changes") for note in told] == [True] * (rows > 1e-5)


def test_macro_steps_are_not_taken_for_ringing(tmp_path: Path) -> None:
    """Their ends are ngspice's, too, and nothing else made its steps twenty times as many."""
    build(tmp_path, "Load")
    (tmp_path / "balanced.toml").write_text(BALANCED)
    (tmp_path / "balanced.cir").write_text(BRIDGE)
    macro = {"coupling.method": "macro-steps", "coupling.macro_step": 1e-6, "run.duration": 0.011}
    found = simulate(load(tmp_path / "balanced.toml", macro)).summary
    assert found["circuit_steps"] >= 11_000 and found["notes"] == []


def test_the_table_of_what_another_run_leaves_out(tmp_path: Path) -> None:
    """An output that nothing reads, and that is no number in longer steps."""
    recompiled(tmp_path, ("m->r[D] * m->r[U]", "m->steps < 2.5e4 * m->time ? NAN : m->r[U]"))
    build(tmp_path, "Load")
    (tmp_path / "balanced.toml").write_text(BALANCED)
    (tmp_path / "balanced.cir").write_text(BRIDGE)
    found = simulate(load(tmp_path / "balanced.toml"), checks="usual")
    assert "load.y.mean" in found.summary and "load.y.mean_error" not in found.summary
    lines = table(found.scene, found.summary, found.units).splitlines()
    (line,) = (each for each in lines if each.startswith("  load.y "))
    assert line.split()[-1] == "nan"
