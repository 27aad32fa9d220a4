"""Names and units that others give to what is in their FMUs, in all that cosim writes."""

import csv
from pathlib import Path

import netCDF4
import numpy as np
import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.studies.sweep.design import parse
from cosim.toolchain.processes import in_place
from tests.ports.foreign import recompiled, reworded
from tests.ports.test_coupled import motor

pytestmark = pytest.mark.usefixtures("undrawn")

OUTPUT, UNIT = 'der(ω_"1", é) <&>', "°/µs"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = motor(tmp_path)
    name = 'name="der(ω_&quot;1&quot;, é) &lt;&amp;&gt;"'
    parameter = ('name="J"', 'name="J/ζ "'), ("J = 2e-4", '"J/ζ " = 2e-4')
    reworded(
        tmp_path / "Rotor.fmu", ('name="alpha"', name), ('"rad/s2"', f'"{UNIT}"'), parameter[0]
    )
    path.write_text(path.read_text().replace(*parameter[1]), encoding="utf-8")
    return path


def test_a_run_is_exported_and_shown(tmp_path: Path, scene: Path) -> None:
    out = tmp_path / "out"
    with in_place():
        assert main(["run", str(scene), "--set", "run.duration=2e-3", "--out", str(out)]) == 0
    with open(out / "waveforms.csv", encoding="utf-8", newline="") as file:
        (*names,), *rows = csv.reader(file)
    place = names.index(f"rotor.{OUTPUT} [{UNIT}]")
    values = np.array([float(row[place]) for row in rows])
    with netCDF4.Dataset(out / "waveforms.nc") as file:
        assert np.asarray(file[f"rotor.{OUTPUT}"][:]) == pytest.approx(values)
        assert file[f"rotor.{OUTPUT}"].units == UNIT
    assert (
        main(["export", str(out), "--as", "mat,hdf5,raw,csv", "--out", str(tmp_path / "to")]) == 0
    )
    exported = (tmp_path / "to" / "waveforms.csv").read_bytes()
    assert exported == (out / "waveforms.csv").read_bytes()
    assert main(["show", str(out)]) == 0


def test_a_sweep_is_written_and_read(tmp_path: Path, scene: Path) -> None:
    over = {"fmu.rotor.J/ζ ": [1e-4, 2e-4]}
    with in_place():
        data = cosim.sweep(scene, over, {"run.duration": 1e-3}, out=tmp_path / "out")
    name = f"rotor.{OUTPUT}.greatest"
    assert (data["failure"] == "").all() and data[name].dims == ("rotor.J|ζ",)
    with netCDF4.Dataset(tmp_path / "out" / "sweep.nc") as file:
        assert np.asarray(file[name][:]) == pytest.approx(data[name].values)
        assert np.asarray(file["rotor.J|ζ"][:]) == pytest.approx([1e-4, 2e-4])
    again = main(["export", str(tmp_path / "out"), "--as", "csv"])
    assert again == 0 and f"rotor.{OUTPUT}".split('"')[0] in (
        (tmp_path / "out" / "sweep.csv").read_text(encoding="utf-8")
    )


def test_a_name_with_a_comma_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A wrong one is told before the points run."""
    path, out = motor(tmp_path), tmp_path / "out"
    path.write_text(path.read_text().replace('"v(gp)"', '"v(a,b)", "max(v(a),v(b))"'))
    command = ["sweep", str(path), "--set", "run.duration=1e-3", "--over", "fmu.rotor.J=1e-4,2e-4"]
    kept = ["v(a,b)", "rotor.omega", "max(v(a),v(b))"]
    with in_place():
        assert main([*command, "--keep", ",".join(kept), "--out", str(out)]) == 0
    with netCDF4.Dataset(out / "points" / "0.nc") as file:
        assert {*kept} <= {*file.variables}
    assert main([*command, "--keep", "v(a,c)", "--out", str(tmp_path / "none")]) == 2
    assert '"v(a,c)"; did you mean v(a,b)?' in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_names_that_netcdf_makes_one_stay_two(tmp_path: Path) -> None:
    scene, out = motor(tmp_path), tmp_path / "out"
    names = ('name="alpha"', 'name="a/b"'), ('name="y"', 'name="a|b"')
    reworded(tmp_path / "Rotor.fmu", *names)
    with in_place():
        result = cosim.run(scene, {"run.duration": 1e-3, "run.output_step": 1e-5})
        data = cosim.sweep(scene, {"fmu.rotor.B": [1e-4, 1e-3]}, {"run.duration": 1e-3})
    result.save(out)
    with netCDF4.Dataset(out / "waveforms.nc") as file:
        for name, there in (("a/b", "a|b_2"), ("a|b", "a|b")):
            found = np.asarray(file[f"rotor.{there}"][:])
            assert found == pytest.approx(result.columns[f"rotor.{name}"]) and found.any()
        assert file["rotor.a|b_2"].units == "rad/s2"
    assert data["rotor.a|b.rms"].values[0] == pytest.approx(result.summary["rotor.a|b.rms"])
    assert data["rotor.a|b.rms_2"].values[0] == pytest.approx(result.summary["rotor.a/b.rms"])


@pytest.mark.parametrize("version", [2, 3])
def test_a_text_is_set_and_a_name_may_have_a_sign_in_it(tmp_path: Path, version: int) -> None:
    """What the FMU is given comes back as the gain D: the number of letters."""
    known = f"int fmi{version}SetString(Model *m, void *p, size_t n, const char **x)"
    recompiled(
        tmp_path,
        (f"STUB(fmi{version}SetString)", f"{known} {{ m->r[D] = strlen(*x); return 0; }}"),
        ("case Y: return m->r[D] * m->r[U];", "case Y: return m->r[D];"),
    )
    scene = motor(tmp_path, version=version)
    one = (
        '<ScalarVariable name="a=b" valueReference="50" causality="parameter" '
        'variability="fixed"><String start=""/></ScalarVariable></ModelVariables>'
        if version == 2
        else '<String name="a=b" valueReference="50" causality="parameter" variability="fixed">'
        '<Start value=""/></String></ModelVariables>'
    )
    reworded(tmp_path / "Rotor.fmu", ("</ModelVariables>", one), ('name="J"', 'name="J=1"'))
    scene.write_text(scene.read_text().replace("J = 2e-4", '"J=1" = 2e-4'))
    given = ['fmu.rotor."a=b"=c=d.csv', "run.duration=1e-4", 'fmu.rotor."J=1"=3e-4']
    with in_place():
        result = cosim.run(scene, given)
        assert (result.columns["rotor.y"] == 7).all()
        assert result.scene.fmu[0].parameters == {"J=1": 3e-4, "B": 1e-4, "a=b": "c=d.csv"}
        with pytest.raises(BadInput, match=r'a=b = 5 must be a text, "5"'):
            cosim.run(scene, ['fmu.rotor."a=b"=5'])
        data = cosim.sweep(scene, dict(parse(['fmu.rotor."J=1"=1e-4,2e-4'])), given[:2])
    assert (data["failure"] == "").all()


@pytest.mark.parametrize("version", [2, 3])
def test_parameters_and_name_are_known_when_it_initialises(tmp_path: Path, version: int) -> None:
    """An FMU may use its parameters, as those of pythonfmu do, as soon as that begins. Two FMUs of
    one file are told apart by their names."""
    enter = f"int fmi{version}EnterInitializationMode(void *m"
    rest = ") {" if version == 2 else ", bool a, double b, double c, bool d, double e)\n{"
    recompiled(
        tmp_path,
        (f"{enter}{rest}", f"{enter}{rest} ((Model *)m)->r[D] *= 2.0;"),
        ("case Y: return m->r[D] * m->r[U];", "case Y: return m->r[D];"),
        (f"m->log{version} = ", f"m->steps = strlen(a); m->log{version} = "),
    )
    given = {"run.duration": 1e-4, "fmu.rotor.D": 3.0, "coupling.method": "step-locked"}
    with in_place():
        columns = cosim.run(motor(tmp_path, version=version), given).columns
    assert (columns["rotor.y"] == 6.0).all()
    assert columns["rotor.steps"][0] == len("rotor")
