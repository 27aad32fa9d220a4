"""Compiling the C: the same sources give the same bytes, and a failure leaves what was there."""

import json
import os
import shlex
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

import build_c
from cosim.toolchain import libraries

posix = pytest.mark.skipif(os.name != "posix", reason="a compiler that is a shell script")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of what is compiled, which a test may spoil."""
    folder = tmp_path / "sources é"
    for path in build_c.sources():
        target = folder / path.relative_to(build_c.ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return folder


WITHOUT_FMU = "build_c._make_fmu = lambda *_: None"
WITHOUT_MODELS = "build_c._make_thin = lambda *_: None"
WITHOUT_LIBRARIES = "build_c.LIBRARIES = {}"


def make(copy: Path, *before: str, **environment: str) -> subprocess.CompletedProcess:
    """Compile the copy in place, without what a test does not look at."""
    program = ("import build_c", *before, "build_c.make(build_c.ROOT / 'cosim/_compiled')")
    return subprocess.run(
        [sys.executable, "-c", "; ".join(program)],
        capture_output=True,
        text=True,
        cwd=copy,
        env=os.environ | environment,
        check=False,
    )


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.slow
def test_the_same_sources_give_the_same_bytes(copy: Path) -> None:
    done = make(copy)
    assert done.returncode == 0, done.stderr
    assert contents(copy / "cosim/_compiled") == contents(libraries.FOLDER)
    assert [path.name for path in (copy / "cosim").glob(".*")] == []


def test_what_is_made_is_not_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """But where a file is damaged, or the compiler or its flags are others."""
    folder = shutil.copytree(libraries.FOLDER, tmp_path / "compiled")
    assert build_c.made(folder) and not build_c.made(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(build_c, "FLAGS", (*build_c.FLAGS, "-g"))
        assert not build_c.made(folder)
    monkeypatch.setattr(build_c, "compiler_version", lambda: "another")
    assert not build_c.made(folder)
    monkeypatch.undo()
    library = folder / f"loop{build_c.SUFFIX}"
    library.write_bytes(library.read_bytes()[:-1] + b"?")
    assert not build_c.made(folder)


@pytest.fixture
def hasty(tmp_path: Path) -> str:
    """The compiler, in a hurry: where what it makes is not run."""
    script = tmp_path / "hasty"
    script.write_text(f'#!/bin/sh\nexec {shlex.join(build_c.compiler())} "$@" -O0\n')
    script.chmod(0o755)
    return str(script)


@posix
def test_hardening_where_the_compiler_has_it(copy: Path, tmp_path: Path) -> None:
    """One that does not know a flag builds without it."""
    flags = json.loads((libraries.FOLDER / "build.json").read_text())["flags"]
    assert flags == [*build_c.FLAGS, *build_c.hardening()]
    if sys.platform == "linux":
        assert {"-fstack-protector-strong", "-Wl,-z,relro,-z,now"} <= {*flags}
    old = tmp_path / "oldcc"
    old.write_text(
        '#!/bin/sh\ncase "$*" in *-strong*|*SOURCE=3*|*-Wl,*) echo "error: what?" >&2; exit 1;; '
        f'esac\nexec {shlex.join(build_c.compiler())} "$@" -O0\n'
    )
    old.chmod(0o755)
    # The same two functions compile and link everything.
    done = make(copy, WITHOUT_FMU, WITHOUT_MODELS, CC=str(old))
    assert done.returncode == 0, done.stderr
    made = json.loads((copy / "cosim/_compiled/build.json").read_text())["flags"]
    assert made[len(build_c.FLAGS) :] in ([], ["-U_FORTIFY_SOURCE", "-D_FORTIFY_SOURCE=2"])


@posix
@pytest.mark.slow
def test_changed_sources_are_another_fmu(copy: Path, hasty: str) -> None:
    definition = copy / "fmu/src/physics/variables.def"
    text = definition.read_text()
    definition.write_text(text.replace("Mass of the ram", r"\"A\" < B & C > 'D'"))
    assert make(copy, WITHOUT_MODELS, CC=hasty).returncode == 0
    tokens = set()
    for version in (2, 3):
        folder = str(copy / f"cosim/_compiled/fmi{version}")
        assert validate_fmu(folder) == []
        description = fmpy.read_model_description(folder)
        tokens.add(description.guid)
        texts = {v.name: v.description for v in description.modelVariables}
        assert texts["ram_mass"] == "\"A\" < B & C > 'D'"
    assert len(tokens) == 1
    assert tokens != {fmpy.read_model_description(str(libraries.compiled("fmi2"))).guid}
    made = json.loads((copy / "cosim/_compiled/build.json").read_text())
    assert made["sources"] != build_c.digest()


@posix
def test_a_failure_leaves_the_last_build(copy: Path, hasty: str) -> None:
    old = copy / "cosim/_compiled"
    old.mkdir()
    (old / "build.json").write_text("old")
    definition = copy / "fmu/src/physics/variables.def"
    definition.write_text(definition.read_text().replace('"kg"', '"lb"'))
    done = make(copy, WITHOUT_LIBRARIES, CC=hasty)
    assert done.returncode and "cannot read the unit lb" in done.stderr
    assert contents(copy / "cosim/_compiled") == {"build.json": b"old"}
    assert [path.name for path in (copy / "cosim").glob(".*")] == []


def test_without_a_compiler(copy: Path, tmp_path: Path) -> None:
    assert "No C compiler was found" in make(copy, CC="", PATH=str(tmp_path)).stderr
    assert "cannot be run" in make(copy, CC=str(tmp_path / "none")).stderr


@posix
def test_the_compiler_is_that_of_cc(copy: Path, tmp_path: Path) -> None:
    script = tmp_path / "my cc"
    script.write_text('#!/bin/sh\necho "x.c:1: error: not today" >&2\nexit 1\n')
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    assert "not today" in make(copy, CC=f"'{script}' -m64").stderr


@posix
def test_a_compiler_that_hangs_is_told(copy: Path, tmp_path: Path) -> None:
    """And what a build has left that was killed goes."""
    (copy / "cosim/.compile-left").mkdir()
    (copy / "cosim/.compile-left/part.o").touch()
    script = tmp_path / "cc"
    script.write_text("#!/bin/sh\nexec sleep 1000\n")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    program = "import build_c; build_c.PATIENCE = 1; build_c.make(build_c.ROOT / 'cosim/_compiled')"
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True, text=True, cwd=copy, env=os.environ | {"CC": str(script)}, timeout=100,
        check=False,
    )  # fmt: skip
    assert f"{script} did not end within 1 s" in done.stderr
    assert [path.name for path in (copy / "cosim").glob(".*")] == []
