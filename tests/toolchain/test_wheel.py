"""A wheel made from the source distribution runs without a C compiler, to the same bits."""

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import build_c
from cosim.toolchain.libraries import FOLDER

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="the environment is laid out otherwise"),
]
SCENES = (("optimal",), ("paper", "--set", "run.duration=0.2"), ("paper-limited",))
FILES = [
    *("fmu/src/fmi/fmi3.c", "fmu/LICENSE", "circuits/full.cir", "tests/conftest.py", "Makefile"),
    *(".ci/run", "CHANGELOG.md", "CITATION.cff", "results/paper.png"),
]


def run(*command: object, cwd: Path, **environment: str) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    make = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    run(sys.executable, "-c", make, folder, cwd=build_c.ROOT)
    return next(folder.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    quiet = ("--no-index", "--no-deps", "--no-build-isolation", "--no-cache-dir")
    run(sys.executable, "-m", "pip", "wheel", *quiet, "-w", folder, sdist, cwd=folder)
    return next(folder.glob("*.whl"))


def test_the_source_distribution_is_complete(sdist: Path, tmp_path: Path) -> None:
    run("tar", "xzf", sdist, cwd=tmp_path)
    (unpacked,) = tmp_path.iterdir()
    code = [path.relative_to(build_c.ROOT) for path in build_c.sources()]
    assert [path for path in [*code, *map(Path, FILES)] if not (unpacked / path).is_file()] == []


def test_the_wheel_is_for_this_platform_and_any_python(wheel: Path) -> None:
    platform = sysconfig.get_platform().replace("-", "_").split("_")[0]
    assert wheel.name.startswith("ngcosim-")
    assert f"-py3-none-{platform}" in wheel.name


def test_the_wheel_holds_what_a_run_needs_and_nothing_of_the_checkout(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (licences,) = (
            [line for line in archive.read(name).decode().splitlines() if "License" in line]
            for name in names
            if name.endswith("METADATA")
        )
    folder = build_c.ROOT / "circuits"
    circuits = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    compiled = json.loads((FOLDER / "build.json").read_text())["files"]
    scenes = (build_c.ROOT / "cosim/scene/library").glob("*.*")
    wanted = {
        "cosim/py.typed",
        "cosim/trials/measured.csv",
        "cosim/_fmu/src/physics/variables.def",
        *(f"cosim/_circuits/{path.as_posix()}" for path in circuits),
        *(f"cosim/_compiled/{file}" for file in compiled),
        *(path.relative_to(build_c.ROOT).as_posix() for path in scenes),
    }
    assert len(compiled) > 50 and wanted - names == set()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"cosim", "ngcosim"}
    assert licences == [
        "License-Expression: GPL-3.0-or-later AND BSD-2-Clause",
        "License-File: LICENSE",
        "License-File: fmu/LICENSE",
    ]


def test_it_runs_without_a_compiler(wheel: Path, tmp_path: Path) -> None:
    environment, here, there, empty = (tmp_path / n for n in ("venv", "here", "there", "empty"))
    for folder in (here, there, empty):
        folder.mkdir()
    installed = {"PATH": str(empty), "CC": "", "PYTHONPATH": ""}
    venv.create(environment, with_pip=False)
    python = environment / "bin" / "python"
    site = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=here)
    Path(site.strip(), "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--no-index", "--no-deps")
    run(*pip, wheel, cwd=here, PYTHONPATH="")
    found = run(python, "-c", "import cosim; print(cosim.__file__)", cwd=there, **installed)
    assert Path(found).is_relative_to(environment)
    for scene, *options in SCENES:
        arguments = ("run", scene, *options)
        run(sys.executable, "-m", "cosim", *arguments, cwd=here)
        run(environment / "bin" / "cosim", *arguments, cwd=there, **installed)
        results = [folder / "results" / scene for folder in (here, there)]
        one, other = ((folder / "waveforms.csv").read_bytes() for folder in results)
        assert one == other
        one, other = (json.loads((folder / "summary.json").read_text()) for folder in results)
        assert one | {"wall_time": 0} == other | {"wall_time": 0}

    # what lies beside a run, and on the rungs without ngspice also without that
    bare = installed | {"NGSPICE_LIBRARY_PATH": str(empty / "none.so")}
    grid = ("--over", "drive.amplitude=6:8:2", "--set", "run.duration=0.2")
    for arguments in (
        ("sweep", "paper-limited", *grid, "--workers", "1"),
        ("export", "results/paper-limited", "--as", "raw,wav"),
        ("fmu", "build"),
        ("fmu", "check"),
    ):
        run(environment / "bin" / "cosim", *arguments, cwd=there, **bare)
    for name in ("paper-limited-sweep/sweep.nc", "fmu/stickslip-fmi3.fmu"):
        assert (there / "results" / name).stat().st_size > 1000


def test_what_builds_it_is_what_the_lock_has() -> None:
    (needed,) = tomllib.loads((build_c.ROOT / "pyproject.toml").read_text())["build-system"][
        "requires"
    ]
    lock = (build_c.ROOT / "requirements/run.lock").read_text().splitlines()
    assert "==" in needed and f"{needed} \\" in lock


def test_locks_are_hashed_agree_and_name_no_registry() -> None:
    texts = {path.stem: path.read_text() for path in (build_c.ROOT / "requirements").iterdir()}
    assert {*texts} == {"run", "test", "dev", "dist", "docs"}
    pins = {
        name: dict(re.findall(r"^([\w.-]+)==(\S+)", text, re.M)) for name, text in texts.items()
    }
    for name, text in texts.items():
        entries = re.split(r"\n(?=[^\s#])", text.partition("make lock\n")[2])
        assert all("==" in entry and "--hash=sha256:" in entry for entry in entries)
        assert "://" not in text
        if name != "docs":  # its environment is its own
            assert pins["run"].items() <= pins[name].items()
    assert pins["test"].items() <= pins["dev"].items()


def test_the_recipe_of_conda_needs_what_the_package_needs() -> None:
    project = tomllib.loads((build_c.ROOT / "pyproject.toml").read_text())["project"]
    recipe = (build_c.ROOT / "recipe/recipe.yaml").read_text()
    assert f'version: "{project["version"]}"' in recipe and f"name: {project['name']}\n" in recipe
    run = recipe.partition("  run:\n")[2].partition("    - if:")[0].replace("-base ", " ")
    needed = [f"python{project['requires-python']}", *project["dependencies"]]
    found = {line.strip(" -").replace(" ", "").lower() for line in run.splitlines()}
    assert found == {one.lower() for one in needed}


def test_actions_are_pinned() -> None:
    """By the hash of a commit, with its version beside it; no checkout keeps a password."""
    for path in (build_c.ROOT / ".github/workflows").glob("*.yml"):
        text = path.read_text()
        used = re.findall(r"uses: (.*)", text)
        assert used
        for one in used:
            assert re.fullmatch(r"[\w/-]+@[0-9a-f]{40} # v[\d.]+", one), one
        assert text.count("actions/checkout") == text.count("persist-credentials: false")
