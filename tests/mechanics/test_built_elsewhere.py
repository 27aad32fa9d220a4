"""The FMU's sources, compiled by others: FMPy's own build, and a plain call of the compiler."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.model_description import read_build_description

from build_c import FLAGS, FMU, PLAIN_NAMES, compiler
from cosim.mechanics import package as fmu

# Impacts on rigid walls, stick and slip, and the source at its limits, in 500 steps.
SIMULATE = """
import sys
import fmpy
import numpy as np

signals = np.zeros(1001, [("time", float), ("command", float)])
signals["time"] = np.linspace(0.0, 0.1, 1001)
signals["command"] = 9.0 * (signals["time"] * 25.0 % 1.0 - 0.5)
rows = fmpy.simulate_fmu(
    sys.argv[1],
    stop_time=0.1,
    output_interval=2e-4,
    start_values={"source": 1, "contact": 2, "output_high": 8.0, "output_low": -8.0},
    input=signals,
    output=["z_part", "z_ram", "coil_current", "energy_friction", "impacts",
            "stick_slip_events", "output_high_time"],
)
assert rows["impacts"][-1] > 3
assert rows["stick_slip_events"][-1] > 3
assert rows["output_high_time"][-1] > 0.0
sys.stdout.buffer.write(rows.tobytes())
"""


def simulated(path: Path) -> bytes:
    """All rows of a run in a process of its own, since what is linked wrongly can hang."""
    command = [sys.executable, "-c", SIMULATE, str(path)]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    return fmu.pack(tmp_path_factory.mktemp("packed"))


@pytest.fixture(scope="module")
def shipped(packed: dict[int, Path]) -> bytes:
    """The rows of the binary that is shipped; both files hold the same."""
    return simulated(packed[2])


def exported(library: Path) -> set[str]:
    """What a library offers to others, without what the linker adds."""
    nm = shutil.which("nm")
    if not nm or fmpy.system != "linux":
        pytest.skip("needs nm on Linux")
    listing = subprocess.run(
        [nm, "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True
    )
    return {line.split()[-1] for line in listing.stdout.splitlines()}


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_compile_gives_the_same_bits(
    packed: dict[int, Path], shipped: bytes, version: int, tmp_path: Path
) -> None:
    if not (os.environ.get("CXX") or shutil.which("c++") or shutil.which("clang++")):
        pytest.skip("fmpy compile needs a C++ compiler beside that of C")
    path = tmp_path / "own.fmu"
    shutil.copy(packed[version], path)
    tools = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        [sys.executable, "-m", "fmpy", "compile", str(path)],
        capture_output=True,
        text=True,
        env=os.environ | {"PATH": tools},
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    folder = Path(fmpy.extract(str(path), str(tmp_path / "own")))
    library = next(folder.glob("binaries/*/*"))
    assert library.read_bytes() != next(fmu.unpacked(version).glob("binaries/*/*")).read_bytes()
    assert simulated(path) == shipped
    assert {name for name in exported(library) if not name.startswith(f"fmi{version}")} == set()


def test_what_is_internal_stays_inside_without_flags(
    packed: dict[int, Path], tmp_path: Path
) -> None:
    sources = Path(fmpy.extract(str(packed[3]), str(tmp_path / "fmu"))) / "sources"
    files = sorted(map(str, sources.glob("*/*.c")))
    library = tmp_path / "own.so"
    subprocess.run([*compiler(), "-shared", "-fPIC", *files, "-lm", "-o", str(library)], check=True)
    names = exported(library)
    assert len(names) > 50
    assert {name for name in names if not name.startswith("stickslip_fmi3")} == set()


@pytest.fixture(scope="module")
def objects(
    packed: dict[int, Path], tmp_path_factory: pytest.TempPathFactory
) -> dict[int, list[Path]]:
    """Of each file's sources, compiled with the Modelica Association's headers."""
    made = {}
    for version, path in packed.items():
        folder = tmp_path_factory.mktemp(f"fmi{version}")
        fmpy.extract(str(path), str(folder))
        for header in folder.glob("sources/fmi/fmi*.h"):
            header.unlink()  # an importer uses its own
        sources = sorted(map(str, folder.glob("sources/*/*.c")))
        headers = f"-I{FMU / 'include'}"
        subprocess.run([*compiler(), headers, "-c", *sources], cwd=folder, check=True)
        made[version] = sorted(folder.glob("*.o"))
    return made


def test_internal_names_have_one_prefix(objects: dict[int, list[Path]]) -> None:
    """So that they meet no other's where an FMU is linked statically."""
    nm = shutil.which("nm")
    if not nm:
        pytest.skip("needs nm")
    listing = subprocess.run(
        [nm, "-g", "--defined-only", *map(str, objects[2])],
        capture_output=True,
        text=True,
        check=True,
    )
    words = [line.split() for line in listing.stdout.splitlines()]
    names = {word[-1].removeprefix("_") for word in words if len(word) == 3}
    assert len(names) > 80
    assert {name for name in names if not name.startswith("stickslip_")} == set()


@pytest.mark.skipif(fmpy.system != "linux", reason="libraries are linked otherwise there")
def test_both_link_statically_beside_others(
    packed: dict[int, Path], objects: dict[int, list[Path]], tmp_path: Path
) -> None:
    """As libraries of the standard's name."""
    description = fmpy.read_model_description(str(packed[2]))
    references = {v.name: str(v.valueReference) for v in description.modelVariables}
    arguments = [references[name] for name in ("current", "contact", "z_part", "z_ram")]
    headers = f"-I{FMU / 'include'}"
    libraries = []
    for version, compiled in objects.items():
        libraries.append(tmp_path / f"fmi{version}" / "libstickslip.a")
        libraries[-1].parent.mkdir()
        subprocess.run(["ar", "rc", str(libraries[-1]), *map(str, compiled)], check=True)

    def printed(name: str, *inputs: str) -> str:
        program = tmp_path / name
        source = Path(__file__).with_name("fmu_host.c")
        command = [*compiler(), *FLAGS, headers, str(source), *inputs, "-lm", "-o", str(program)]
        subprocess.run(command, check=True)
        done = subprocess.run(
            [str(program), fmu.token(), *arguments], capture_output=True, text=True, timeout=60
        )
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout

    binary = next(fmu.unpacked(2).glob("binaries/*/*"))
    shared = printed("shared", *PLAIN_NAMES, str(binary))
    assert printed("static", *map(str, libraries)) == shared
    rows = [[float.fromhex(number) for number in line.split()] for line in shared.splitlines()]
    assert len(rows) == 500
    assert all(row[:2] == row[2:] for row in rows)
    assert max(row[1] for row in rows) - min(row[1] for row in rows) > 1e-3


def test_the_build_description_names_what_is_linked(packed: dict[int, Path]) -> None:
    for version, path in packed.items():
        with zipfile.ZipFile(path) as archive:
            text = archive.read("sources/buildDescription.xml")
        assert len(read_build_description(str(path), validate=True)) == 1
        build = ElementTree.fromstring(text)
        (library,) = build.findall("BuildConfiguration/Library")
        assert (library.get("name"), library.get("external")) == ("m", "true")
        (definition,) = build.iter("PreprocessorDefinition")
        assert definition.get("name") == f"FMI{version}_OVERRIDE_FUNCTION_PREFIX"
        assert definition.get("optional") == "true"
