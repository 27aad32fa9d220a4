"""The built-in machine through ports: under a netlist's own names, and beside other FMUs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput, BeyondModel
from cosim.files.resources import circuits
from cosim.toolchain.processes import in_place
from tests.ports.foreign import build

NAMES = {"Vemf": "Vmot", "Vcommand": "Vin", "out": "hot", "sense": "shunt", "v1": "inp"}
"""Of the example with half-bridges, and others."""

OWN = """
base = "paper"
[circuit]
model = "file"
netlist = "own.cir"
save = ["v(left)", "v(hot,shunt)*i(Vmot)"]
[[port]]
from = "drive"
source = "Vin"
[[port]]
from = "machine.back_emf"
source = "Vmot"
[[port]]
probe = "i(Vmot)"
to = "machine.current"
"""
ENDS = """
[[port]]
probe = "v(hot)"
to = "machine.out"
[[port]]
probe = "v(shunt)"
to = "machine.sense"
"""
UNSAVED = "".join(line for line in (OWN + ENDS).splitlines(True) if "save" not in line)
RUN = """
[run]
duration = 0.1
output_step = 1e-4
"""


def renamed(example: Path) -> str:
    """A netlist with names of its own."""
    lines = example.read_text().splitlines()
    own = "\n".join(line for line in lines if not line.startswith("*"))
    for old, new in NAMES.items():
        own = re.sub(rf"\b{old}\b", new, own, flags=re.IGNORECASE)
    return own


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    example = circuits() / "examples" / "h_bridge.cir"
    (tmp_path / "agreed.cir").write_text(example.read_text())
    (tmp_path / "own.cir").write_text(renamed(example))
    return tmp_path


def agreed(folder: Path, base: str = "paper", **given: Any) -> cosim.Result:
    with in_place():
        return cosim.run(
            base,
            {
                **{"circuit.model": "file", "circuit.netlist": str(folder / "agreed.cir")},
                **{"run.duration": 0.1, "run.output_step": 1e-4},
                **{key.replace("_", ".", 1): value for key, value in given.items()},
            },
        )


def test_a_netlist_with_names_of_its_own_is_the_same_circuit(folder: Path) -> None:
    (folder / "own.toml").write_text(UNSAVED + RUN)
    with in_place():
        result = cosim.run(folder / "own.toml")
    expected = agreed(folder)
    assert list(result.columns) == list(expected.columns)
    for name, values in expected.columns.items():
        # The example has a node v1, whose voltage the circuit itself computes.
        least = 1e-12 if name == "command" else 0.0
        assert result.columns[name] == pytest.approx(values, rel=0.0, abs=least), name
    assert result.summary["energy_residual"] < 1e-4


@pytest.mark.parametrize("method", ["step-locked", "redo", "macro-steps"])
def test_two_coils_are_one_behind_twice_the_resistances(method: str, tmp_path: Path) -> None:
    """In parallel each takes half of the current, whatever couples them to the netlist."""
    settings = f'[coupling]\nmethod = "{method}"\nmacro_step = 2e-5\n[run]\nduration = 0.05\n'
    z = []
    for count in (1, 2):
        before, coil, shunt = 2 / count, 7.1 / count, 0.6 / count
        (tmp_path / "own.cir").write_text(
            f"t\nVin in 0 0\nEgain e 0 in 0 1.5\nRo e hot {before}\nRc hot c1 {coil}\n"
            f"Lc c1 c2 {1.2e-3 / count}\nVmot c2 shunt 0\nRs shunt 0 {shunt}\n.end\n"
        )
        own = UNSAVED.replace('"paper"', '"reference"') + f"[coil]\ncount = {count}\n" + settings
        (tmp_path / "own.toml").write_text(own)
        with in_place():
            columns = cosim.run(tmp_path / "own.toml").columns
        z.append(columns["machine.z_ram" if "machine.z_ram" in columns else "z_ram"])
    np.testing.assert_allclose(z[1], z[0], rtol=0, atol=1e-4 * np.ptp(z[0]))


@pytest.mark.parametrize("method", ["redo", "macro-steps"])
def test_a_machine_at_rest_waits_for_its_drive(method: str, tmp_path: Path) -> None:
    """What rounding makes of its back-EMF there tells nothing of its slope; later it moves as one
    whose drive begins at once."""
    (tmp_path / "own.cir").write_text(
        "t\nVin in 0 0\nEgain hot 0 in 0 2\nRc hot c1 7.1\nLc c1 c2 1.2m\nVmot c2 0 0\n.end\n"
    )
    (tmp_path / "own.toml").write_text(UNSAVED.replace('"paper"', '"reference"'))
    moved = {}
    for start in (0.0, 0.01):
        given = {"drive.start_time": start, "run.duration": 0.02 + start, "run.settle": 0.0}
        given |= {"coupling.method": method, "coupling.macro_step": 2e-5}
        with in_place():
            columns = cosim.run(tmp_path / "own.toml", given).columns
        moved[start] = columns["machine.z_ram"][columns["time"] >= start - 1e-9]
    assert moved[0.01] == pytest.approx(moved[0.0], abs=1e-4 * np.ptp(moved[0.0]))


@pytest.mark.parametrize("method", ["redo", "macro-steps"])
def test_a_normal_force_from_a_file_is_refused_where_it_would_be_left_out(
    folder: Path, method: str
) -> None:
    (folder / "own.toml").write_text(UNSAVED + RUN + f'[coupling]\nmethod = "{method}"\n')
    (folder / "force.csv").write_text("time [s],normal_force [N]\n0,0.5\n1,0.9\n")
    given = {"friction.normal_force_file": str(folder / "force.csv")}
    with pytest.raises(BadInput, match=r'friction\.normal_force_file.*"machine\.normal_force"'):
        cosim.load(folder / "own.toml", given)
    cosim.load(folder / "own.toml", {**given, "coupling.method": "step-locked"})


def test_what_is_saved_of_it_is_in_the_waveforms(folder: Path) -> None:
    (folder / "own.toml").write_text(OWN + ENDS + RUN)
    with in_place():
        result = cosim.run(folder / "own.toml")
    power = result.columns["v(hot,shunt)*i(Vmot)"]
    alone = result.columns["coil_voltage"] * result.columns["current"]
    assert power == pytest.approx(alone, abs=1e-3 * np.abs(alone).max())
    assert (result.units["v(left)"], result.units["v(hot,shunt)*i(Vmot)"]) == ("V", "W")


def test_a_node_called_as_the_machine_calls_its_own_stays_the_netlists(tmp_path: Path) -> None:
    """The coil is between ``hot`` and ground, ``out`` is before half an ohm, ``v1``, ``swing``,
    ``climit`` and ``slewing`` are supplies, no limits at work."""
    (tmp_path / "own.cir").write_text(
        "t\nVin in 0 0\nVone v1 0 12\nVs swing 0 5\nVl climit 0 5\nVw slewing 0 5\n"
        "Eout out 0 in 0 1\nRs out hot 0.5\nRc hot c1 7.1\nLc c1 c2 1.2m\nVmot c2 0 0\n"
        ".meas tran top max v(out)\n.end\n"
    )
    scene = OWN.replace('"v(left)", "v(hot,shunt)*i(Vmot)"', '"v(out)"') + ENDS + RUN
    (tmp_path / "own.toml").write_text(scene.replace('"v(shunt)"', '"0"'))
    with in_place():
        result = cosim.run(tmp_path / "own.toml")
    waves = result.columns
    before = waves["coil_voltage"] + 0.5 * waves["current"]
    assert waves["v(out)"] == pytest.approx(before, abs=1e-6)
    assert waves["command"] == pytest.approx(waves["v(out)"], abs=1e-3)
    limits = {"swing_high_fraction", "current_limit_fraction", "slew_fraction"}
    assert not limits & result.summary.keys()
    assert result.summary["meas.top"] == pytest.approx(waves["v(out)"].max(), rel=1e-2)


@pytest.mark.parametrize(
    ("base", "contact", "alone"),
    [
        ("paper", "compliant", False),
        pytest.param("reference", "rigid", False, marks=pytest.mark.slow),
        pytest.param("paper", "compliant", True, marks=pytest.mark.slow),
    ],
)
def test_as_an_fmu_like_others_the_machine_moves_alike(
    folder: Path, base: str, contact: str, alone: bool
) -> None:
    """Beside another, or with steps that are done again: it tells nobody when its ram meets a
    wall, and is asked for no voltage of its coil."""
    text = OWN.replace("paper", base) + ENDS
    if not alone:
        build(folder, "Load")
        fmu = '[[fmu]]\nname = "other"\nfile = "Load.fmu"\n[[port]]'
        text = text.replace("[[port]]", fmu, 1)
    (folder / "own.toml").write_text(text + RUN)
    given = {"mechanics_contact": contact}
    fine = agreed(folder, base, circuit_reltol=1e-7, circuit_max_step=1e-6, **given)
    own = agreed(folder, base, **given)
    with in_place():
        result = cosim.run(
            folder / "own.toml", {"coupling.method": "redo", "mechanics.contact": contact}
        )
    for name, other in (("z_surface", "machine.z_surface"), ("current", "i(Vmot)")):
        true = fine.columns[name]
        error = np.sqrt(np.mean((result.columns[other] - true) ** 2))
        assert error < 3.0 * np.sqrt(np.mean((own.columns[name] - true) ** 2)), name


def test_by_macro_steps_the_machine_is_an_fmu_like_others(folder: Path) -> None:
    (folder / "own.toml").write_text(OWN + ENDS + RUN)
    given = {"coupling.method": "macro-steps", "coupling.macro_step": 2e-5, "run.duration": 0.02}
    with in_place():
        result = cosim.run(folder / "own.toml", given)
    expected = agreed(folder, run_duration=0.02).columns["current"]
    error = np.abs(result.columns["i(Vmot)"] - expected).max()
    assert error < 1e-3 * np.abs(expected).max()


WRONG = {
    "two ends": ('source = "Vin"', 'source = "Vin"\n[[port]]\nfrom="drive"\nsource="Vx"', "twice"),
    "no current": (
        *('[[port]]\nprobe = "i(Vmot)"\nto = "machine.current"\n', ""),
        'with to = "machine.current"',
    ),
    "another's current": (*('probe = "i(Vmot)"', 'probe = "i(Lcoil)"', 'probe = "i(Vmot)"'),),
    "a scale": ('source = "Vin"', 'source = "Vin"\nscale = 2', "scale must be 1"),
    "an unknown end": ("machine.current", "machine.force", "must be one of from"),
    "no source": ('"Vin"', '"Vout"', 'source = "Vout" must be a V source of its own'),
    "a resistor": ('"Vin"', '"Rleft"', "must be a V source"),
    "no node": ('"v(hot)"', '"v(hott)"', "no node hott"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_told(folder: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    old, new, said = WRONG[what]
    text = OWN + ENDS + RUN
    assert old in text
    (folder / "own.toml").write_text(text.replace(old, new, 1))
    with in_place():
        assert main(["run", str(folder / "own.toml"), "--out", str(folder / "o")]) == 2
    told = [line for line in capsys.readouterr().err.splitlines() if "note" not in line]
    assert len(told) == 1 and said in told[0], told
    assert told[0].startswith(f"cosim: {folder / 'own.toml'}: ")


BRIDGE = """A class-D bridge with a carrier of 20 kHz
Vcommand v1 0 0
Vtri tri 0 PULSE(-5 5 0 24u 24u 1u 50u)
Bout out 0 V=max(-12, min(12, 60*(V(v1)-V(tri))))
Rcoil out c1 7.1
Lcoil c1 c2 1.2m
Vemf c2 sense 0
Rsense sense 0 0.1
.end
"""


def test_a_carrier_as_fast_as_the_rows_is_told(tmp_path: Path) -> None:
    """Rows as far apart as its period show the voltage as if it stood; and its bridge is on when
    the run starts, so the coil has a current, whose energy 1/2 L i^2 the balance knows."""
    (tmp_path / "agreed.cir").write_text(BRIDGE)
    quick = agreed(tmp_path, run_duration=0.05, run_output_step=5e-5)
    (told,) = [note for note in quick.summary["notes"] if "run.output_step" in note]
    assert told.startswith("coil_voltage changes faster than the rows of the waveforms, which are")
    assert quick.columns["current"][0] == pytest.approx(12.0 / 7.2, rel=1e-6)
    assert quick.summary["energy_residual"] < 1e-5
    fine = agreed(tmp_path, run_duration=0.05, run_output_step=2e-6)
    assert not any("run.output_step" in note for note in fine.summary["notes"])
    assert fine.summary["v_average"] == pytest.approx(quick.summary["v_average"], rel=1e-3)


OSCILLATOR = """
Vrel rel 0 1
Rrel rel cap 1k
Crel cap 0 1u
Srel cap 0 cap 0 dump
.model dump SW(vt=0.5 vh=0.2 ron=1 roff=1meg)
.meas tran turns TRIG v(cap) VAL=0.5 RISE=2 TARG v(cap) VAL=0.5 RISE=12
"""


@pytest.mark.filterwarnings(f"ignore::{BeyondModel.__module__}.{BeyondModel.__name__}")
@pytest.mark.parametrize("beside", ["the machine", "ports alone"])
def test_a_circuit_without_operating_point_begins_as_in_ngspice(folder: Path, beside: str) -> None:
    """A relaxation oscillator between 0.3 and 0.7 V: R C ln(7/3) to fill, and r C ln(7/3) to
    empty."""
    for path in folder.glob("*.cir"):
        path.write_text(path.read_text().replace(".end\n", f"{OSCILLATOR}.end\n"))
    if beside == "the machine":
        result = agreed(folder, circuit_max_step=1e-6, run_duration=0.02)
    else:
        (folder / "bare.toml").write_text(
            '[circuit]\nmodel = "file"\nnetlist = "bare.cir"\n'
            '[[port]]\nfrom = "drive"\nsource = "Vin"\n[run]\nduration = 0.02\nsettle = 0.0\n'
        )
        (folder / "bare.cir").write_text(f"t\nVin in 0 0\nRin in 0 1k\n{OSCILLATOR}.end\n")
        with in_place():
            result = cosim.run(folder / "bare.toml", {"circuit.max_step": 1e-6})
    period = 1001e-6 * np.log(7.0 / 3.0)
    assert result.summary["meas.turns"] == pytest.approx(10 * period, rel=5e-3)
    assert sum("found no operating point" in note for note in result.summary["notes"]) == 1
