"""Loading what was compiled: from the installation, or told in words."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import build_c
from cosim.errors import BadInput
from cosim.toolchain import libraries
from tests.helpers import needs


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


def _cut(content: bytes) -> bytes:
    return content[:-100]


def _flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def _zeros(content: bytes) -> bytes:
    return bytes(len(content))


FMU = f"fmi2/binaries/*/stickslip{libraries.SUFFIX}"
FILES = [f"part{libraries.SUFFIX}", FMU, "fmi2/modelDescription.xml"]


@pytest.mark.parametrize("pattern", FILES)
@pytest.mark.parametrize("harm", [_cut, _flipped, _zeros])
def test_what_is_damaged_is_not_loaded(
    pattern: str, harm: Callable[[bytes], bytes], own_folder: Path
) -> None:
    """A library that is cut off, or has zeros where a page was lost, would end the process."""
    (path,) = own_folder.glob(pattern)
    content = path.read_bytes()
    path.unlink()  # not written over: it may be loaded
    path.write_bytes(harm(content))
    with pytest.raises(BadInput, match=r"is damaged, or of another build.*install it again"):
        libraries.compiled(pattern.partition("/")[0])


def test_a_foreign_library_is_not_loaded(own_folder: Path) -> None:
    path = own_folder / f"part{libraries.SUFFIX}"
    path.unlink()
    shutil.copy(own_folder / f"loop{libraries.SUFFIX}", path)
    with pytest.raises(BadInput, match="is damaged, or of another build"):
        libraries.library.__wrapped__("part")


@pytest.mark.parametrize("content", [b"", b"{", b"3", b'{"files": {}}', b'{"files": 3}', b"\xff"])
def test_what_the_build_wrote_down_is_lost(content: bytes, own_folder: Path) -> None:
    (own_folder / "build.json").write_bytes(content)
    with pytest.raises(BadInput, match="is not what was built"):
        libraries.library.__wrapped__("part")


@needs.posix
@pytest.mark.parametrize("place", [".", f"part{libraries.SUFFIX}"])
def test_what_others_can_write_is_not_loaded(place: str, own_folder: Path) -> None:
    (own_folder / place).chmod(0o777)
    with pytest.raises(BadInput, match="can be written by every user"):
        libraries.library.__wrapped__("part")
    (own_folder / place).chmod(0o755)
    assert libraries.library.__wrapped__("part")


@needs.posix
def test_a_damaged_fmu_ends_a_command_in_a_sentence(own_folder: Path, tmp_path: Path) -> None:
    for path in own_folder.glob(FMU.replace("fmi2", "fmi?")):
        os.truncate(path, 4096)
    program = (
        "import sys; from pathlib import Path; from cosim.toolchain import libraries; "
        f"libraries.FOLDER = Path({str(own_folder)!r}); from cosim.cli.main import main; "
        "sys.exit(main(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "run", "held", f"--out={tmp_path / 'out'}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2 and "is damaged" in done.stderr and done.stderr.count("\n") == 1


@needs.posix
def test_a_worker_loads_nothing_from_the_working_folder(tmp_path: Path) -> None:
    """Which may be a folder of downloads, or one that others write."""
    for name in ("multiprocessing", "signal", "numpy"):
        (tmp_path / f"{name}.py").write_text(f"open('{name} was run', 'w')\nraise SystemExit\n")
    program = (
        "from cosim.evaluate.evaluator import Evaluator\n"
        "from cosim.scene import load\n"
        "scene = load('paper', ['run.duration=0.01', 'run.settle=0'])\n"
        "with Evaluator(scene, workers=1) as bench:\n"
        "    print(*bench.run([(0, {})]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=100,
        env=os.environ | {"PYTHONPATH": str(build_c.ROOT)},
    )  # fmt: skip
    assert not list(tmp_path.glob("* was run")), done.stderr
    assert "v_average" in done.stdout and done.returncode == 0, done.stderr


@needs.ngspice_library
def test_the_ngspice_of_pythons_own_environment_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Conda's loader does not know the folder of an environment's libraries."""
    monkeypatch.delenv("NGSPICE_LIBRARY_PATH", raising=False)
    of_system = libraries.ngspice_library()
    own = tmp_path / "lib" / f"libngspice{libraries.SUFFIX}"
    own.parent.mkdir()
    own.touch()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert libraries.ngspice_library() == str(own) != of_system
