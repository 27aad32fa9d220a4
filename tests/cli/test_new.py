"""What is there to begin with: new scenes, a schema for editors, what is in a built-in scene."""

import json
import os
import tomllib
from pathlib import Path

import jsonschema
import pytest

from cosim.cli.main import main
from cosim.mechanics import package
from cosim.scene import list_scenes, load
from cosim.scene.loading import groups
from cosim.scene.model import schema
from cosim.toolchain.processes import in_place

LIBRARY = Path(load.__code__.co_filename).with_name("library")
SHORT = ["--set=run.duration=0.06", "--set=run.settle=0.01"]


@pytest.mark.parametrize("kind", ["machine", "circuit", "fmu"])
def test_a_new_scene_runs_as_it_is(kind: str, tmp_path: Path) -> None:
    scene = tmp_path / "own" / "my-own.toml"
    assert main(["new", str(scene), "--kind", kind]) == 0
    text = scene.read_text(encoding="utf-8")
    told = json.loads((scene.parent / "scene.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(tomllib.loads(text), told)
    assert text.startswith("#:schema ./scene.schema.json\n")  # where editors look for it
    with in_place():
        assert main(["run", str(scene), *SHORT, "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "waveforms.csv").exists()


def test_a_new_machine_is_the_scene_that_it_starts_from(tmp_path: Path) -> None:
    """Every key stands in it as a comment: with all of them it is the same scene, too."""
    scene = tmp_path / "mine.toml"
    assert main(["new", str(scene), "--base", "gripper"]) == 0
    text = scene.read_text(encoding="utf-8")
    own = load("gripper")
    assert load(scene).model_copy(update={"name": own.name}) == own
    lines = text.splitlines()
    keys = [line[2:] for line in lines if line.startswith("# ") and " = " in line]
    assert len(keys) > 60
    given = {line.split(" = ")[0] for line in keys if not line.split(" = ")[1].startswith("  #")}
    assert {"frequency", "force_factor", "travel", "normal_force", "duration"} <= given


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["x.txt"], "must end in .toml"),
        (["a b.toml"], "letters, digits"),
        (["x.toml", "--base", "papr"], "did you mean paper"),
        (["there.toml"], "is there already"),
        (["link.toml"], "link.toml: is there already"),
        (["there.toml/x.toml"], "there.toml: this is a file, not a directory"),
    ],
)
def test_what_cannot_be_made_is_told(
    words: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.toml").write_text("")
    Path("link.toml").symlink_to("nowhere")
    assert main(["new", *words]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"there.toml", "link.toml"}


def test_anothers_schema_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    theirs = tmp_path / "scene.schema.json"
    theirs.write_text('{"title": "mine"}')
    assert main(["new", str(tmp_path / "a.toml")]) == 2
    assert "scene.schema.json: is there already" in capsys.readouterr().err
    assert theirs.read_text() == '{"title": "mine"}' and [*tmp_path.iterdir()] == [theirs]
    os.truncate(theirs, 1 << 40)  # a file without end, but for its blocks
    assert main(["new", str(tmp_path / "a.toml")]) == 2
    assert "scene.schema.json: cannot be read (it is larger than" in capsys.readouterr().err
    theirs.unlink()
    for name in ("a.toml", "b.toml"):
        assert main(["new", str(tmp_path / name)]) == 0


def test_nothing_is_half_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoilt(path: Path, version: int) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(package, "write", spoilt)
    assert main(["new", str(tmp_path / "mine.toml"), "--kind", "fmu"]) == 2
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("path", sorted(LIBRARY.glob("*.toml")), ids=lambda path: path.stem)
def test_the_schema_takes_every_built_in_scene(path: Path) -> None:
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), schema())


@pytest.mark.parametrize(
    "text",
    [
        "[drive]\nfrequncy = 1",
        "[drive]\nfrequency = -1",
        '[run]\nduration = "1"',
        "[drive]\ntable = [[0.5]]",
        '[circuit]\nmodel = "ful"',
    ],
)
def test_the_schema_tells_what_is_wrong(text: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(text), schema())


def test_every_scene_is_listed_once(capsys: pytest.CaptureFixture[str]) -> None:
    listed = [name for names in groups().values() for name in names]
    assert sorted(listed) == sorted(name for name, _ in list_scenes())
    assert main(["scenes"]) == 0
    told = capsys.readouterr().out
    assert "paper-limited" in told and "cosim new" in told


def test_what_is_in_a_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "gripper"]) == 0
    told = capsys.readouterr().out
    found = tomllib.loads(told.partition("\n")[2])
    assert found["coil"]["count"] == 2 and found["drive"]["amplitude"] == 10.0
    assert "waveform" not in found["drive"] and "part_mass = 0.05  # kg; " in told
