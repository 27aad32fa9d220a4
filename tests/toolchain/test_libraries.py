"""Loading what was compiled: from the installation, or told in words."""

import shutil
from pathlib import Path

import pytest

import build_c
from cosim.errors import BadInput
from cosim.toolchain import libraries


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "an é" / "_compiled"
    shutil.copytree(libraries.FOLDER, folder)
    monkeypatch.setattr(libraries, "FOLDER", folder)
    return folder


@pytest.mark.parametrize("name", build_c.LIBRARIES)
def test_each_library_is_there(name: str) -> None:
    path = libraries.compiled(name + libraries.SUFFIX)
    assert libraries.library(name)._name == str(path)


def test_a_missing_library_is_one_sentence(own_folder: Path) -> None:
    (own_folder / f"part{libraries.SUFFIX}").unlink()
    with pytest.raises(BadInput, match=r"part\.\w+ is missing from this installation") as caught:
        libraries.library.__wrapped__("part")
    assert caught.value.exit_code == 2


def test_a_damaged_library_is_one_sentence(own_folder: Path) -> None:
    path = own_folder / f"part{libraries.SUFFIX}"
    path.unlink()  # not written over: it may be loaded
    path.write_bytes(b"cut off")
    with pytest.raises(BadInput, match="cannot be loaded"):
        libraries.library.__wrapped__("part")
