"""The library as its users have it: in a script, from standard input and in a notebook."""

import json
import os
import subprocess
import sys
from base64 import b64decode
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import cosim
from cosim.cli.main import main
from cosim.errors import BeyondModel

REPOSITORY = Path(__file__).parents[1]
OWN = {
    "circuit.model": "file",
    "circuit.netlist": str(REPOSITORY / "circuits" / "examples" / "h_bridge.cir"),
    "run.duration": 0.06,
}
ENDLESS = 10**6000
SHORT = {"run.duration": 0.1, "run.settle": 0.05}
PNG = b"\x89PNG\r\n\x1a\n"

PROGRAM = """
import cosim
own = cosim.run("paper", {own!r})
print(own.summary["v_average"])
over = {{"drive.amplitude": [6, 8, 9], "drive.frequency": [10, 20, 30]}}
data = cosim.sweep("ideal-current", over, {short!r}, workers=2)
print(float(data.v_average.sel(amplitude=8, frequency=20)), int((data.failure != "").sum()))
own.plot().savefig("own.png")
"""


@pytest.fixture(scope="module")
def result() -> cosim.Result:
    return cosim.run("ideal-current", {**SHORT, "drive.amplitude": 6.0})


@pytest.mark.checked
def test_run_is_what_the_command_writes(result: cosim.Result, tmp_path: Path) -> None:
    """Overrides as a mapping, and the files of `save`, against `cosim run --set`."""
    sets = [f"--set={key}={value}" for key, value in (SHORT | {"drive.amplitude": 6.0}).items()]
    assert main(["run", "ideal-current", *sets, "--out", str(tmp_path / "command")]) == 0
    result.save(tmp_path / "library")
    files = {path.name for path in (tmp_path / "command").iterdir()}
    assert files == {path.name for path in (tmp_path / "library").iterdir()}
    for name in files - {"summary.json"}:
        mine, theirs = ((tmp_path / who / name).read_bytes() for who in ("library", "command"))
        assert mine == theirs, name
    summary = json.loads((tmp_path / "command" / "summary.json").read_text(encoding="utf-8"))
    assert len(summary.pop("run")) == 16
    assert summary | {"wall_time": 0.0} == result.summary | {"wall_time": 0.0}


def test_waveforms_have_units_and_names(result: cosim.Result, tmp_path: Path) -> None:
    """As another program reads them from the file, whose numbers are those of the table."""
    waves = result.waveforms
    result.save(tmp_path)
    stored = xr.load_dataset(tmp_path / "waveforms.nc")
    assert len(stored.attrs.pop("run")) == 16 and stored.identical(waves)
    with netCDF4.Dataset(tmp_path / "waveforms.nc") as file:
        assert file["v_part"].units == "m/s" and file["v_part"].long_name == "velocity of the part"
    heads = (tmp_path / "waveforms.csv").read_text(encoding="utf-8").partition("\n")[0].split(",")
    rows = np.loadtxt(tmp_path / "waveforms.csv", delimiter=",", skiprows=1)
    assert [head.partition(" [")[0] for head in heads] == ["time", *map(str, waves.data_vars)]
    for name, values in zip(["time", *map(str, waves.data_vars)], rows.T, strict=True):
        np.testing.assert_allclose(waves[name].values, values, rtol=1e-9, atol=1e-12)
        assert waves[name].dims == ("time",) and waves[name].attrs["long_name"]


def test_plot_and_html(result: cosim.Result) -> None:
    figure = result.plot()
    assert isinstance(figure, Figure) and len(figure.axes) >= 6
    html = result._repr_html_()
    image = html.partition("base64,")[2].partition('"')[0]
    assert b64decode(image, validate=True).startswith(PNG)
    assert f"{result.summary['v_average'] * 1e3:+.3f} mm/s" in html


def test_scenes_from_scenes() -> None:
    scene = cosim.load("paper", {"drive.frequency": np.float64(30)})
    assert scene.drive.frequency == 30.0 and cosim.load(scene) == scene
    assert cosim.load(scene, ["drive.frequency=31"]).drive.frequency == 31.0
    assert cosim.load(scene, {"drive.pot_frequency": 0.5}).drive.frequency == pytest.approx(50.5)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            {"frequency": 30},
            "frequency must be table.key; did you mean drive.frequency?",
        ),
        ({"drive.frequncy": 30}, "did you mean drive.frequency?"),
        ({"drive.frequency": -1}, "overrides: drive.frequency = -1 must be a number from 0.01"),
        ({"drive.frequency": None}, "overrides: drive.frequency = None must be a number"),
        ("drive.frequency=30", 'not "drive.frequency=30"'),
        ({1: 2}, "1 must be a text, table.key"),
        ({"x" * 10_000: 1}, "must be table.key"),
        ({"coil.count": ENDLESS}, "an endless number must be a whole number from 1 to 16"),
        ({"drive.waveform": [ENDLESS]}, "an endless number must be one of"),
        (["a"], "--set a: must be table.key=value"),
        ([1], "1 must be a text, table.key=value"),
        ([b"coil.count=1"], "must be a text, table.key=value"),
        (42, "a mapping or a list of strings, not 42"),
        (b"x", "a mapping or a list of strings, not b'x'"),
    ],
    ids=range(14),
)
def test_bad_overrides(overrides: Any, words: str) -> None:
    with pytest.raises(cosim.BadInput) as caught:
        cosim.run("paper", overrides)
    assert words in str(caught.value) and "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("scene", [1, None, ["paper"], ENDLESS], ids=range(4))
def test_what_is_no_scene(scene: Any) -> None:
    with pytest.raises(cosim.BadInput, match="must be a scene, or the name of one"):
        cosim.load(scene)


LONG = range(10_000_000_000)


@pytest.mark.parametrize(
    ("over", "more", "words"),
    [
        ({1: [2]}, {}, "--over: 1 must be a key"),
        (["coil.count=1,2"], {}, "sweep: over = ['coil.count=1,2'] must be a mapping."),
        ({}, {}, "a sweep needs at least one key and its values, such as --over"),
        ({"coil.count": 2}, {}, '--over: "coil.count" must be a key, 2 its numbers'),
        ({"coil.count": "12"}, {}, '"12" its numbers'),
        ({"coil.count": np.array(2)}, {}, "2 its numbers"),
        ({"coil.count": [1, 2]}, {"workers": 2.0}, "--workers 2.0: must be a whole number"),
        ({"coil.count": ["a"]}, {}, '"a" must be a whole number from 1 to 16'),
        ({"coil.count": [[1]]}, {}, "[1] must be a whole number from 1 to 16"),
        ({"coil.count": [ENDLESS]}, {}, "an endless number must be a whole number from 1 to 16"),
        ({"drive.amplitude": LONG}, {}, "10000000000 points; it may have 1000000"),
        (
            dict.fromkeys(["drive.amplitude", "drive.offset", "coil.b1"], range(1000)),
            {},
            "1000000000 points; it may have 1000000",
        ),
        ({"coil.count": [1, 2]}, {"samples": "a"}, '--samples "a": must be a whole number'),
        ({"coil.count": [1, 2]}, {"samples": ENDLESS}, "must be a whole number from 1 to 1000000"),
        ({"coil.count": [1, 2]}, {"samples": 3, "seed": 1.5}, "--seed 1.5: must be a whole"),
    ],
    ids=range(15),
)
def test_what_no_sweep_goes_over(over: Any, more: dict[str, Any], words: str) -> None:
    """Said before any work is done, or any memory taken."""
    with pytest.raises(cosim.BadInput) as caught:
        cosim.sweep("held", over, SHORT, **more)
    assert words in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("over", "words"),
    [
        (["drive.offset"], "tune: over = ['drive.offset'] must be a mapping or None."),
        ({1: (0, 1)}, "--over 1: there is no such key"),
        *(
            ({"drive.offset": ends}, "must be LOW and HIGH, LOW below HIGH, each a number")
            for ends in (5, None, (1,), (0, 1, 2), "01", ("a", "b"), [[0, 1], [1, 2]], (1, ENDLESS))
        ),
    ],
    ids=range(10),
)
def test_what_no_search_goes_over(over: Any, words: str) -> None:
    with pytest.raises(cosim.BadInput) as caught:
        cosim.tune("held", SHORT, maximise="v_average", over=over)
    assert words in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("theory", {"mu_s": "a"}, 'theory: mu_s = "a" must be a number.'),
        ("theory", {"mu_k": np.ones(2)}, "theory: mu_k = [1. 1.] must be a number."),
        ("limits", {"effort": "1"}, 'limits: effort = "1" must be a number.'),
        ("limits", {"overrides": 5}, "overrides: must be a mapping or a list of strings"),
        ("limits", {"quick": "no"}, 'limits: quick = "no" must be True or False.'),
        ("run", {"scene": "held", "overrides": np.ones(2)}, "must be a mapping or a list of"),
        ("run", {"scene": "held", "progress": None}, "run: progress = None must be a function."),
        ("compare", {"run": "held", "trial": None}, "trial = None must be a text or a path."),
        ("spread", {"scene": 5}, "must be a scene, or the name of one"),
        ("tune", {"scene": "held", "waveform": 5}, "5 must be a text or a list of texts."),
        ("tune", {"scene": "held", "waveform": [1]}, "[1] must be a text or a list of texts."),
        ("identify", {"trials": "x", "apart": "5"}, 'apart = "5" must be a list of texts.'),
        ("fit", {"trials": "x", "mu_k": "low"}, 'mu_k = "low" must be a number or "free".'),
        ("ladder", {"scenes": []}, "ladder: scenes must name a scene at least."),
        ("bench", {"quick": None}, "bench: quick = None must be True or False."),
    ],
    ids=range(15),
)
def test_a_wrong_type_is_told_in_one_sentence(name: str, given: dict[str, Any], words: str) -> None:
    with pytest.raises(cosim.BadInput) as caught:
        getattr(cosim, name)(**given)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_note_is_told_with_the_line_of_the_caller() -> None:
    """Behind the check of its arguments, which is a call between."""
    with pytest.warns(BeyondModel) as told:
        cosim.run("paper-limited", {"drive.amplitude": 9.0, "run.duration": 0.2})
    assert {each.filename for each in told} == {__file__}


def test_a_folder_that_is_none() -> None:
    made: Any = cosim.theory()
    with pytest.raises(cosim.BadInput, match=r"Theory\.save: folder = None must be a text or"):
        made.save(None)


def test_names_of_a_sweep() -> None:
    """A key by itself where that can be typed, else with its table."""
    over = {"coil.count": [1, 2], "drive.amplitude": [6.0, 8.0], "circuit.reltol": [1e-5]}
    data = cosim.sweep("ideal-current", over, SHORT, workers=1)
    assert data.sizes == {"coil_count": 2, "amplitude": 2, "reltol": 1}
    assert data.amplitude.attrs["key"] == "drive.amplitude" and data.amplitude.units == "V"
    assert callable(data.count)


def test_knobs_have_volts_and_hertz_beside_them() -> None:
    """What they stand for is what a scene with these knobs says."""
    over = {
        "drive.pot_max": [0.3, 0.5],
        "drive.pot_frequency": [0.6, 0.8, 0.9],
        "drive.pot_offset": [0.2],
    }
    data = cosim.sweep("ideal-current", over, SHORT, workers=2)
    assert (data.amplitude.units, data.frequency.units, data.offset.units) == ("V", "Hz", "V")
    for place in ({"pot_max": 1, "pot_frequency": 2}, {"pot_max": 0, "pot_frequency": 0}):
        point = data.isel(place, drop=False).squeeze()
        knobs = {f"drive.{knob}": float(point[knob]) for knob in ("pot_max", "pot_frequency")}
        drive = cosim.load("ideal-current", knobs | {"drive.pot_offset": 0.2}).drive
        found = [float(point[name]) for name in ("amplitude", "frequency", "offset")]
        assert found == [drive.amplitude, drive.frequency, drive.offset]


def test_tune_theory_and_compare(tmp_path: Path, result: cosim.Result) -> None:
    over = {"drive.offset": (-2.0, 0.0)}
    tuning = cosim.tune("ideal-current", SHORT, maximise="v_average", over=over, budget=24)
    assert tuning.best.value == max(run.value for run in tuning.runs if run.value is not None)
    again = cosim.run(tuning.scene).summary["v_average"]
    assert again == pytest.approx(tuning.best.value, rel=1e-6)
    tuning.save(tmp_path / "tune")
    with pytest.raises(cosim.BadInput, match=r"either maximise or minimise.*such as v_average"):
        cosim.tune("ideal-current", over=over)
    assert cosim.theory().numbers["up"]["v_average_over_gT"] == pytest.approx(0.31065088757)
    with pytest.raises(cosim.BadInput, match="too small"):
        cosim.theory(f_n=1.0)
    long = cosim.run("ideal-current", {"run.duration": 0.6, "run.settle": 0.3})
    long.save(tmp_path)
    assert main(["export", str(tmp_path), "--as", "tracker"]) == 0
    compared = [cosim.compare(run, tmp_path / "tracker.csv") for run in (long, tmp_path)]
    for found in compared:
        assert found.numbers["velocity_r2"] == pytest.approx(1.0, abs=1e-6)
        assert isinstance(found.plot(), Figure)


@pytest.mark.parametrize("way", ["stdin", pytest.param("script", marks=pytest.mark.slow)])
def test_without_a_main_guard(way: str, tmp_path: Path) -> None:
    """A netlist of one's own and a sweep, which both run in processes of their own."""
    program = PROGRAM.format(own=OWN, short=SHORT)
    (tmp_path / "script.py").write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-" if way == "stdin" else "script.py"],
        input=program if way == "stdin" else None,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    own, (point, failed) = done.stdout.splitlines()[0], done.stdout.splitlines()[1].split()
    assert float(own) == cosim.run("paper", OWN).summary["v_average"]
    alone = cosim.run("ideal-current", SHORT | {"drive.amplitude": 8, "drive.frequency": 20})
    assert float(point) == pytest.approx(alone.summary["v_average"], rel=1e-6)
    assert failed == "0" and (tmp_path / "own.png").read_bytes().startswith(PNG)


def test_import_is_light() -> None:
    program = (
        "import sys, cosim; cosim.BadInput; "
        "print(*{'numpy', 'xarray', 'matplotlib', 'pydantic', 'scipy'} & sys.modules.keys()); "
        "cosim.load('paper'); print(*{'xarray', 'matplotlib', 'scipy'} & sys.modules.keys())"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout.split("\n")[:2], done.stderr) == (["", ""], "")
