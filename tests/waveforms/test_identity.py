"""Files of different runs in one folder are told apart."""

import shutil
import warnings
from pathlib import Path

import pytest

import cosim
from cosim.errors import Note
from cosim.waveforms import formats
from cosim.waveforms.identity import FILES

pytestmark = [pytest.mark.reliability, pytest.mark.usefixtures("undrawn")]

SHORT = {"run.duration": 0.02, "run.settle": 0.0}


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folders = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("other")
    for folder, force in zip(folders, (0.5, 0.6), strict=True):
        cosim.run("ideal-current", {**SHORT, "friction.normal_force": force}).save(folder)
    return folders


@pytest.mark.parametrize("stale", FILES)
def test_a_file_of_an_older_run_is_told(stale: str, two: tuple[Path, Path], tmp_path: Path) -> None:
    for name in FILES:
        shutil.copy(two[name == stale] / name, tmp_path / name)
    with pytest.warns(Note) as told:
        formats.read(tmp_path)
    others = [name for name in FILES if name != stale]
    said = str(told[0].message)
    assert len(told) == 1
    expected = [stale] if stale != "waveforms.nc" else [n for n in others if n != "waveforms.nc"]
    assert all(name in said for name in expected)
    assert "run it again" in said


def test_a_whole_run_is_quiet(two: tuple[Path, Path], tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", Note)
        for folder in two:
            formats.read(folder)
        for name in FILES[:2]:  # others may be gone
            shutil.copy(two[0] / name, tmp_path / name)
        formats.read(tmp_path)


def test_equal_runs_are_one(two: tuple[Path, Path], tmp_path: Path) -> None:
    cosim.run("ideal-current", {**SHORT, "friction.normal_force": 0.5}).save(tmp_path)
    shutil.copy(two[0] / "summary.json", tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error", Note)
        formats.read(tmp_path)


@pytest.mark.filterwarnings("error::cosim.errors.NoEffect")
@pytest.mark.parametrize("link", [False, True])
def test_a_run_is_moved_with_the_files_beside_it(tmp_path: Path, link: bool) -> None:
    """From ``results`` that is a link, ``..`` would lead elsewhere: there the path stays whole."""
    home = tmp_path / "home"
    grip, folder = home / "own" / "grip.csv", home / "results" / "mine"
    grip.parent.mkdir(parents=True)
    grip.write_text("time [s],normal_force [N]\n0,0.5\n1,0.6\n")
    if link:
        (tmp_path / "disk").mkdir()
        (home / "results").symlink_to(tmp_path / "disk")
    run = cosim.run("ideal-current", {**SHORT, "friction.normal_force_file": str(grip)})
    run.save(folder)
    assert cosim.load(folder / "scene.toml") == run.scene
    if link:
        assert cosim.load(tmp_path / "disk" / "mine" / "scene.toml") == run.scene
        return
    home.rename(tmp_path / "moved")
    moved = tmp_path / "moved" / "results" / "mine"
    again = cosim.run(moved / "scene.toml")
    assert again.scene.friction.normal_force_file == str(tmp_path / "moved" / "own" / "grip.csv")
    assert again.columns["z_part"].tolist() == run.columns["z_part"].tolist()
    with warnings.catch_warnings():
        warnings.simplefilter("error", Note)
        formats.read(moved)


def test_a_kill_leaves_no_older_figure(
    two: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the data and the figure."""
    folder = tmp_path / "run"
    shutil.copytree(two[0], folder)
    result = cosim.run("held", {"run.duration": 0.02})
    monkeypatch.setattr(cosim.Result, "plot", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        result.save(folder)
    assert {path.name for path in folder.iterdir()} == {*FILES} - {"figure.png"}
