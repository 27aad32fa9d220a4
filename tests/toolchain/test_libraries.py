"""Building and loading the compiled routines: whole, once, again if damaged, or told in words."""

import ctypes
from pathlib import Path

import pytest

from cosim.errors import BadInput
from cosim.toolchain import libraries as native


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache é" / "build"
    monkeypatch.setattr(native, "build_directory", lambda: folder)
    return folder


def load() -> ctypes.CDLL:
    return native.part_library.__wrapped__()


def test_it_is_built_once_and_leaves_nothing_else(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch
):
    assert load().part_exact
    assert list(own_folder.iterdir()) == [native.library_path("part")]
    monkeypatch.setenv("CC", "/does/not/exist")  # and needs no compiler from now on
    assert load().part_moreau


def test_other_sources_make_another_library(
    own_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    before = native.library_path("part")
    changed = tmp_path / "part.c"
    changed.write_bytes(native.SOURCES["part"][0].read_bytes() + b"\n")
    monkeypatch.setitem(native.SOURCES, "part", (changed,))
    assert native.library_path("part") != before
    changed.unlink()
    with pytest.raises(BadInput, match="is missing"):
        native.library_path("part")


def test_a_damaged_library_is_built_again(own_folder: Path):
    own_folder.mkdir(parents=True)
    native.library_path("part").write_bytes(b"cut off")
    assert load().part_exact


@pytest.mark.parametrize(
    ("compiler", "words"),
    [("/does/not/exist", "cannot be run"), ("false", "failed while building")],
)
def test_a_compiler_that_fails(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch, compiler: str, words: str
):
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(BadInput, match=words):
        load()
    assert list(own_folder.iterdir()) == []


def test_no_compiler(own_folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(BadInput, match="No C compiler"):
        load()


def test_a_folder_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(native, "build_directory", lambda: tmp_path / "file" / "build")
    with pytest.raises(BadInput, match="Cannot write"):
        load()
