"""``cosim export``: every form read back by a reader of its own, with equal numbers."""

import csv
import json
import math
import os
import re
import subprocess
import sys
import wave
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import numpy.typing as npt
import pytest
import xarray
from scipy.io import loadmat

from cosim.cli.main import main
from cosim.trials.camera import accelerations, frame_times, velocities
from cosim.trials.tracked import read
from cosim.waveforms.formats import formats
from cosim.waveforms.formats.tracker import number
from tests.helpers.ngspice_alone import LIBRARY

pytestmark = pytest.mark.usefixtures("undrawn")

Array = npt.NDArray[np.float64]

ELECTRIC = ["command", "current", "coil_voltage", "back_emf"]
MECHANIC = [
    "z_surface", "v_surface", "a_surface", "z_ram", "v_ram", "z_part", "v_part", "friction_force",
    "sticking",
]  # fmt: skip

ROWS_A_FRAME = 10
STEP = 1 / (960 * ROWS_A_FRAME)  # s: a row at each frame of the camera
SETTLE = 24 / 960  # s
SPEED, FREQUENCY = 0.2, 37.0  # of the given surface, m/s and Hz


def make_run(folder: Path, scene: str, *settings: str) -> Path:
    options = [word for setting in settings for word in ("--set", setting)]
    assert main(["run", scene, *options, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a circuit and impacts whose rows meet the camera's frames."""
    return make_run(
        tmp_path_factory.mktemp("driven") / "run",
        "ideal-current",
        "run.duration=0.3",
        f"run.settle={SETTLE!r}",
        f"run.output_step={STEP!r}",
    )


@pytest.fixture(scope="module")
def sine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the part alone, on a surface whose velocity is a sine."""
    return make_run(
        tmp_path_factory.mktemp("given") / "run",
        "optimal",
        "drive.waveform=sine",
        f"drive.frequency={FREQUENCY}",
        f"drive.velocity_amplitude={SPEED}",
        "run.duration=0.5",
    )


def truth(run: Path) -> dict[str, Array]:
    """The run's columns, read by the netCDF library."""
    with netCDF4.Dataset(run / "waveforms.nc") as data:
        return {name: np.array(variable[:]) for name, variable in data.variables.items()}


def units(run: Path) -> dict[str, str]:
    header = (run / "waveforms.csv").read_text().splitlines()[0].split(",")
    return dict(re.fullmatch(r"(\w+) \[(.+)\]", cell).groups() for cell in header)  # type: ignore


def export(run: Path, forms: str, out: Path) -> None:
    assert main(["export", str(run), "--as", forms, "--out", str(out)]) == 0


def same(found: dict[str, Array], run: Path) -> None:
    expected = truth(run)
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


@pytest.mark.parametrize("form", ["csv", "nc"])
def test_the_runs_own_files_for_another_folder(run: Path, form: str, tmp_path: Path) -> None:
    export(run, form, tmp_path)
    name = f"waveforms.{form}"
    assert (tmp_path / name).read_bytes() == (run / name).read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_matlab(run: Path, tmp_path: Path) -> None:
    export(run, "mat", tmp_path)
    data = loadmat(tmp_path / "waveforms.mat")
    made = {name: values for name, values in data.items() if not name.startswith("__")}
    assert (made.pop("title"), made.pop("scene")) == (
        [netCDF4.Dataset(run / "waveforms.nc").title],
        [(run / "scene.toml").read_text(encoding="utf-8")],
    )
    assert len(made.pop("run")[0]) == 16
    struct_ = made.pop("units")
    assert {name: str(struct_[name][0, 0][0]) for name in struct_.dtype.names} == units(run)
    assert all(values.shape == (len(made["time"]), 1) for values in made.values())
    same({name: values[:, 0] for name, values in made.items()}, run)
    head = (tmp_path / "waveforms.mat").read_bytes()[:128]
    assert head.startswith(b"MATLAB 5.0 MAT-file") and head[124:] == b"\x00\x01IM"
    assert max(map(len, made)) <= 31


def test_names_of_expressions_stay_apart(tmp_path: Path) -> None:
    """Vectors with commas, signs and blanks, of a circuit of one's own."""
    scene = tmp_path / "own.toml"
    assert main(["new", str(scene), "--kind", "circuit"]) == 0
    words = ["v(out,c1)", "v(out)-v(c1)", "v(out)+v(c1)", "2*v(out)", "v(out) * i(Vemf)"]
    words.append("(v(out)-v(c1))*(v(out)-v(c1))/7.1")
    short = ("run.duration=0.05", "run.settle=0")
    run = make_run(tmp_path, str(scene), f"circuit.save={json.dumps(words)}", *short)
    data = xarray.load_dataset(run / "waveforms.nc")
    with (run / "waveforms.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert {len(row) for row in rows} == {len(head)}
    (place,) = (k for k, cell in enumerate(head) if cell.startswith("v(out,c1) ["))
    np.testing.assert_allclose([float(row[place]) for row in rows], data["v(out,c1)"], rtol=1e-9)
    export(run, "mat,raw", tmp_path)
    made = loadmat(tmp_path / "waveforms.mat")
    names = [name for name, of in made.items() if np.shape(of) == (len(rows), 1)]
    assert len(names) == len(head) and all(re.fullmatch(r"[A-Za-z]\w{0,62}", x) for x in names)
    np.testing.assert_array_equal(made["v_out__v_c1__2"][:, 0], data["v(out)+v(c1)"])
    head = (tmp_path / "waveforms.raw").read_bytes().partition(b"Binary:")[0].decode()
    assert "\tv(out)*i(Vemf)\t" in head


def test_hdf5_and_its_readers(run: Path, tmp_path: Path) -> None:
    export(run, "hdf5", tmp_path)
    path, scene = tmp_path / "waveforms.h5", (run / "scene.toml").read_text(encoding="utf-8")
    with h5py.File(path) as file:
        same(
            {name: np.asarray(file[name]) for name in sorted(file, key=list(truth(run)).index)}, run
        )
        assert {name: dataset.attrs["units"] for name, dataset in file.items()} == units(run)
        scale = file["z_part"]
        assert isinstance(scale, h5py.Dataset) and scale.dims[0][0] == file["time"]
        assert file.attrs["scene"] == scene
    with netCDF4.Dataset(path) as data:
        same({name: np.array(variable[:]) for name, variable in data.variables.items()}, run)
        assert list(data.dimensions) == ["time"] and data.scene == scene
        assert data["v_part"].units == "m/s"
    with xarray.open_dataset(path, engine="netcdf4") as labelled:
        assert labelled["z_part"].dims == ("time",)
        same({name: labelled[name].values for name in truth(run)}, run)


# Loads a raw file into ngspice and writes what ngspice then holds: types, names and numbers.
NGSPICE = r"""
import ctypes, os, sys
import numpy as np
class Complex(ctypes.Structure):
    _fields_ = [("real", ctypes.c_double), ("imaginary", ctypes.c_double)]
class Vector(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("kind", ctypes.c_int), ("flags", ctypes.c_short),
                ("real", ctypes.POINTER(ctypes.c_double)), ("complex", ctypes.POINTER(Complex)),
                ("length", ctypes.c_int)]
ngspice = ctypes.CDLL(os.environ["NGSPICE_LIBRARY_PATH"])
ngspice.ngSpice_CurPlot.restype = ctypes.c_char_p
ngspice.ngSpice_AllVecs.restype = ctypes.POINTER(ctypes.c_char_p)
ngspice.ngGet_Vec_Info.restype = ctypes.POINTER(Vector)
nothing = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_void_p)
silent = nothing(lambda text, number, user: 0)
ended = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_bool, ctypes.c_bool, ctypes.c_int,
                         ctypes.c_void_p)(lambda *a: os._exit(1))
ngspice.ngSpice_Init(silent, None, ended, None, None, None, None)
ngspice.ngSpice_Command(b"load " + sys.argv[1].encode())
plot, found, kinds = ngspice.ngSpice_CurPlot(), {}, {}
names = ngspice.ngSpice_AllVecs(plot)
for i in range(1000):
    if names[i] is None:
        break
    vector = ngspice.ngGet_Vec_Info(plot + b"." + names[i]).contents
    name = names[i].decode()
    found[name] = np.ctypeslib.as_array(vector.real, (vector.length,)).copy()
    kinds[name] = vector.kind
np.savez(sys.argv[2], **found)
print(plot.decode(), *(f"{name}={kind}" for name, kind in kinds.items()))
sys.stdout.flush()
os._exit(0)
"""
NO_TYPE, TIME, VOLTAGE, CURRENT = 0, 1, 3, 4  # ngspice's numbers for them


def in_ngspice(raw: Path) -> tuple[str, dict[str, int], dict[str, Array]]:
    """The plot, the type of each vector, and its numbers, as ngspice has them in its memory."""
    done = subprocess.run(
        [sys.executable, "-c", NGSPICE, raw.name, "found.npz"],
        cwd=raw.parent,
        env={**os.environ, "NGSPICE_LIBRARY_PATH": LIBRARY or "", "HOME": str(raw.parent)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    plot, *kinds = done.stdout.splitlines()[-1].split()
    with np.load(raw.parent / "found.npz") as data:
        found = {name: data[name] for name in data.files}
    pairs = (kind.rsplit("=", 1) for kind in kinds)
    return plot, {name: int(kind) for name, kind in pairs}, found


def test_ngspice_loads_its_raw_file(run: Path, tmp_path: Path) -> None:
    export(run, "raw", tmp_path)
    plot, kinds, found = in_ngspice(tmp_path / "waveforms.raw")
    assert plot.startswith("tran")
    names = {"time": "time", "current": "i(current)"}
    names |= {column: f"v({column})" for column in ("command", "coil_voltage", "back_emf")}
    same({column: found[names.get(column, column)] for column in truth(run)}, run)
    assert len(found) == 1 + len(ELECTRIC) + len(MECHANIC)
    assert kinds == {
        "time": TIME,
        "i(current)": CURRENT,
        **{f"v({column})": VOLTAGE for column in ("command", "coil_voltage", "back_emf")},
        **dict.fromkeys(MECHANIC, NO_TYPE),
    }


def test_no_title_is_a_command_to_ngspice(tmp_path: Path) -> None:
    """ngspice takes what lies beyond 511 bytes of a line for the next line."""
    words = "€" * 168 + "command: shell touch done"
    scene = tmp_path / "scene.toml"
    scene.write_text(f'base = "held"\ndescription = "{words}"\n', encoding="utf-8")
    run = make_run(tmp_path / "run", str(scene), "run.duration=0.01")
    assert main(["export", str(run), "--as", "raw"]) == 0
    _, _, found = in_ngspice(run / "waveforms.raw")
    same(found, run)
    assert not (run / "done").exists()


def sound(path: Path, said: str) -> tuple[Array, float]:
    """Velocities in m/s as the command tells how to make them, and the step of their rounding."""
    with wave.open(str(path)) as file:
        assert file.getparams()[:3] == (1, 2, 48000)
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")
    factor = float(said.partition("= sample * ")[2].split()[0])
    return samples * factor, factor


@pytest.mark.parametrize("step", [5e-5, 1e-4, 1e-5, 1 / 48000])
def test_the_sound_is_the_surfaces_velocity(
    sine: Path, step: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if step != 5e-5:
        settings = [f"run.output_step={step!r}", "drive.waveform=sine", "run.duration=0.5"]
        settings += [f"drive.frequency={FREQUENCY}", f"drive.velocity_amplitude={SPEED}"]
        sine = make_run(tmp_path / "run", "optimal", *settings)
    export(sine, "wav", tmp_path)
    heard, place = sound(tmp_path / "surface.wav", capsys.readouterr().out)
    time = np.arange(len(heard)) / 48000
    assert time[-1] == pytest.approx(0.5, abs=2 / 48000)
    assert place == pytest.approx(SPEED / 32767, rel=1e-3)
    spoken = SPEED * np.sin(2 * math.pi * FREQUENCY * time)
    far = slice(400, -400)  # from the ends, where the filter has to guess
    assert np.abs(heard - spoken)[far].max() < 0.5 * place + 4e-6 * SPEED
    assert np.abs(heard - spoken).max() < 0.02 * SPEED


def test_a_surface_at_rest_is_silent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = make_run(tmp_path / "run", "held", "run.duration=0.05")
    assert main(["export", str(run), "--as", "wav"]) == 0
    heard, _ = sound(run / "surface.wav", capsys.readouterr().out)
    assert len(heard) == 2401 and not heard.any()


TRIAL = "t,xp,zp,vxp,vzp,axp,azp,xo,zo,vxo,vzo,axo,azo,xs,zs,vxs,vzs,axs,azs"
ENTRY = re.compile(r"-?\d+\.\d{8}|\ufffd")


def test_a_run_as_a_tracked_trial(run: Path, tmp_path: Path) -> None:
    export(run, "tracker", tmp_path)
    text = (tmp_path / "tracker.csv").read_bytes().decode()
    lines = text.split("\r\n")
    assert lines[0] == TRIAL and not text.endswith("\n") and text.count("\n") == len(lines) - 1
    rows = list(csv.reader(lines[1:]))
    assert all(len(row) == 19 and all(map(ENTRY.fullmatch, row)) for row in rows)
    frames = {
        name: np.array([math.nan if cell == "\ufffd" else float(cell) for cell in cells])
        for name, cells in zip(TRIAL.split(","), zip(*rows, strict=True), strict=True)
    }
    waves, n = truth(run), len(rows)
    assert n == round((0.3 - SETTLE) * 960) + 1
    np.testing.assert_allclose(frames["t"], np.arange(n) / 960, atol=5.1e-9, rtol=5e-7)
    window = np.arange(-2, 3) / 960
    for body, column in (("p", "z_surface"), ("o", "z_part"), ("s", None), ("x", None)):
        if body == "x":
            assert not frames["xp"].any() and not np.nansum(np.abs(frames["vxo"])) > 0
            continue
        mm = 1e3 * waves[column][24 * ROWS_A_FRAME :: ROWS_A_FRAME] if column else np.zeros(n)
        np.testing.assert_allclose(frames[f"z{body}"], mm, rtol=5.1e-7, atol=5.1e-9)
        velocity = np.convolve(mm, [480.0, 0.0, -480.0], "valid")
        # The tracker's second difference is that of the parabola through five frames.
        parabolas = [2 * np.polyfit(window, mm[k - 2 : k + 3], 2)[0] for k in range(2, n - 2)]
        v, a = frames[f"vz{body}"], frames[f"az{body}"]
        np.testing.assert_allclose(v[1:-1], velocity, rtol=5.1e-7, atol=1e-6)
        np.testing.assert_allclose(a[2:-2], parabolas, rtol=6e-7, atol=1e-2)
        assert np.isnan(v[[0, -1]]).all() and np.isnan(a[[0, 1, -2, -1]]).all()
    trial = read(tmp_path / "tracker.csv")
    assert trial.plate is not None and not trial.plate.z.any()
    np.testing.assert_array_equal(trial.part.z, frames["zo"] * 1e-3)
    digits = [cell.lstrip("-0.").replace(".", "").rstrip("0") for row in rows for cell in row]
    assert max(map(len, digits)) == 7


@pytest.mark.parametrize("name", ["Trial #1.csv", "Trial #5.csv", "Trial #10.csv"])
def test_the_published_trials_have_this_form(name: str, trials: Path) -> None:
    """Their header, their digits, and velocities and accelerations by the same differences."""
    text = (trials / name).read_bytes().decode()
    header, *lines = text.split("\r\n")
    assert header == TRIAL and lines[-1]
    columns = zip(*csv.reader(lines), strict=True)
    frames: dict[str, tuple[str, ...]] = dict(zip(TRIAL.split(","), columns, strict=True))
    # Tracker differences heights of more digits than it writes.
    for quantity, differenced, unsure in (
        ("v", lambda z: velocities(frame_times(0.0, len(z)), z), 1e-3),
        ("a", accelerations, 1.0),
    ):
        for body in ("zp", "zo", "xo", "zs"):
            mm = np.array(frames[body], float)
            for made, there in zip(differenced(mm), frames[quantity + body], strict=True):
                assert ENTRY.fullmatch(there)
                assert (number(made) == "\ufffd") == (there == "\ufffd")
                if there != "\ufffd":
                    assert made == pytest.approx(float(there), rel=2e-6, abs=unsure)
    for cell in (*frames["t"], *frames["zp"], *frames["azp"]):
        assert cell == "\ufffd" or number(float(cell)) == cell


def compare(run: Path, trial: Path, out: Path) -> dict[str, float]:
    assert main(["compare", str(run), str(trial), "--out", str(out)]) == 0
    return json.loads((out / "compare.json").read_text())


def test_a_run_compared_with_itself_is_off_by_the_digits_of_the_file(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(run, "tracker", tmp_path)
    trial = tmp_path / "tracker.csv"
    numbers = compare(run, trial, tmp_path)
    assert "This trial is the run's own" in capsys.readouterr().out
    with open(trial, encoding="utf-8", newline="") as file:
        frames = np.array([float(row["zo"]) for row in csv.DictReader(file)])
    # Through the same camera: nothing but the digits of the file is left.
    mm = 1e3 * truth(run)["z_part"][24 * ROWS_A_FRAME :: ROWS_A_FRAME]
    rounding = np.abs((mm - mm[0]) - (frames - frames[0]))
    assert numbers["mean_error_mm"] == pytest.approx(rounding.mean(), rel=0.02)
    assert 0 < numbers["mean_error_mm"] < 1e-5
    assert numbers["start"] == SETTLE


def test_another_trial_is_not_taken_for_the_runs_own(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(run, "tracker", tmp_path)
    header, *rows = (tmp_path / "tracker.csv").read_bytes().decode().split("\r\n")
    cells = [row.split(",") for row in rows[:200]]
    height = TRIAL.split(",").index("zo")
    cells[100][height] = f"{float(cells[100][height]) + 1e-4:.8f}"  # mm
    other = tmp_path / "other.csv"
    other.write_text("\n".join([header, *map(",".join, cells)]), encoding="utf-8")
    capsys.readouterr()
    compare(run, other, tmp_path / "out")
    assert "own" not in capsys.readouterr().out


def test_a_run_on_a_trial_is_known_by_its_own_export(sine: Path, tmp_path: Path) -> None:
    surface = sine / "waveforms.csv"
    run = make_run(tmp_path / "run", "trial", f"drive.file={surface}", "run.duration=0.4")
    export(run, "tracker", tmp_path)
    numbers = compare(run, tmp_path / "tracker.csv", tmp_path / "out")
    assert numbers["start"] == 0.0
    assert numbers["mean_error_mm"] < 1e-5


def test_compare_refuses_a_trial_in_which_nothing_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = make_run(tmp_path / "run", "held", "run.duration=0.1")
    assert main(["export", str(run), "--as", "tracker"]) == 0
    trial = str(run / "tracker.csv")
    assert main(["compare", str(run), trial, "--out", str(tmp_path / "out")]) == 2
    assert "the height of the surface does not change" in capsys.readouterr().err


def test_all_forms_of_a_part_alone(
    sine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a circuit and a ram there are fewer columns, and no command; nothing else changes."""
    before = {path.name for path in sine.iterdir()}
    lists = ["--as", "csv,mat, hdf5", "--as", "nc,wav,raw,tracker"]
    assert main(["export", str(sine), *lists, "--out", str(tmp_path)]) == 0
    names = {form.file for name, form in formats().items() if name not in ("codes", "pwl")}
    assert {path.name for path in tmp_path.iterdir()} == names
    said = capsys.readouterr().out
    assert all(name in said for name in names)
    assert {path.name for path in sine.iterdir()} == before
    with h5py.File(tmp_path / "waveforms.h5") as file:
        assert not {"current", "z_ram"} & set(file)


def test_the_same_run_gives_the_same_bytes(run: Path, tmp_path: Path) -> None:
    for out in ("once", "again"):
        export(run, ",".join(formats()), tmp_path / out)
    for name in (format.file for format in formats().values()):
        once, again = ((tmp_path / out / name).read_bytes() for out in ("once", "again"))
        assert once == again, name


@pytest.mark.parametrize(
    "arguments, told",
    [
        (["run", "--as", "xls"], r'"xls".*codes, csv, hdf5, mat, nc, pwl, raw, tracker, wav'),
        (["run", "--as", "csv,,mat"], r'of a run "" must be one of codes, csv, '),
        (["run", "--as", "mat,csv,mat"], "--as: mat must be named once"),
        (["run", "--as", "mat", "--as", "mat"], "--as: mat must be named once"),
        (["run"], "--as"),
        (["gone", "--as", "csv"], "gone: there is no such folder"),
        (["empty", "--as", "csv"], r"empty: there is no run .*waveforms\.nc"),
        (["cut", "--as", "csv"], r"cut/waveforms\.nc: this is not a whole"),
        (["garbage", "--as", "csv"], r"garbage/waveforms\.nc: this is not a whole"),
        (["short", "--as", "csv,tracker"], r"short: tracker needs 8 to .* 5 of this run"),
        (["rare", "--as", "mat,wav"], r"rare: wav needs a run\.output_step of at most 0.01 s"),
        (["bare", "--as", "mat,tracker"], r"bare/scene\.toml"),
        (["lacks", "--as", "mat,tracker"], r"lacks/waveforms\.nc: tracker needs the column z_surf"),
        (["lacks", "--as", "mat,wav"], r"lacks/waveforms\.nc: wav needs the column v_surface"),
        (["run", "--as", "csv,mat", "--out", "full"], r"full/waveforms\.mat: this is a directory"),
        (["run", "--as", "csv", "--out", "file"], "file: this is a file"),
    ],
)
def test_bad_input(
    run: Path,
    arguments: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = (run / "waveforms.nc").read_bytes()
    for name in ("empty", "cut", "garbage", "bare"):
        (tmp_path / name).mkdir()
    (tmp_path / "cut" / "waveforms.nc").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "garbage" / "waveforms.nc").write_bytes(b"no such thing")
    (tmp_path / "bare" / "waveforms.nc").write_bytes(whole)
    (tmp_path / "file").touch()
    (tmp_path / "full" / "waveforms.mat").mkdir(parents=True)
    (tmp_path / "lacks").mkdir()
    (tmp_path / "lacks" / "scene.toml").write_bytes((run / "scene.toml").read_bytes())
    lacks = re.sub(rb"(?<=\0\0\0\x09)(.)_surface(?=\0)", rb"\1_plinths", whole)
    (tmp_path / "lacks" / "waveforms.nc").write_bytes(lacks)
    (tmp_path / "run").symlink_to(run)
    if arguments[0] == "short":
        make_run(tmp_path / "short", "held", "run.duration=0.01", "run.settle=0.005")
    if arguments[0] == "rare":
        make_run(tmp_path / "rare", "held", "run.duration=0.05", "run.output_step=0.02")
    before = sorted(tmp_path.rglob("*"))
    capsys.readouterr()
    assert main(["export", *arguments]) == 2
    said = capsys.readouterr().err
    assert re.search(told, said.strip()) and said.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_without_h5py(
    run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert main(["export", str(run), "--as", "csv,hdf5", "--out", str(tmp_path / "out")]) == 2
    assert "h5py" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
