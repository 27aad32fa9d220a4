"""The files of a run: all of one run, whatever ends the writing, and movable."""

import os
import shutil
from pathlib import Path

import pytest

import cosim
from cosim.waveforms.result import FILES

pytestmark = [pytest.mark.reliability, pytest.mark.usefixtures("undrawn")]

SHORT = {"run.duration": 0.02, "run.settle": 0.0}


@pytest.fixture(scope="module")
def older(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("older")
    cosim.run("ideal-current", SHORT).save(folder)
    return folder


@pytest.mark.parametrize("written", range(4))
def test_a_kill_leaves_files_of_one_run(
    written: int, older: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it ends the command once some files have got their names."""
    folder = tmp_path / "run"
    shutil.copytree(older, folder)
    result = cosim.run("held", {"run.duration": 0.02})
    moved, left = os.replace, iter(range(written))

    def replace(*paths: Path) -> None:
        if next(left, None) is None:
            raise KeyboardInterrupt
        moved(*paths)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(os, "replace", replace)
        result.save(folder)
    found = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert len(found) == written
    result.save(folder)
    assert all((folder / name).read_bytes() == content for name, content in found.items())


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


def test_a_kill_leaves_no_older_figure(
    older: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the data and the figure."""
    folder = tmp_path / "run"
    shutil.copytree(older, folder)
    result = cosim.run("held", {"run.duration": 0.02})
    monkeypatch.setattr(cosim.Result, "plot", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        result.save(folder)
    assert {path.name for path in folder.iterdir()} == {*FILES} - {"figure.png"}
