"""The FMU files as files: their table of variables, their contents, their bytes."""

import ctypes
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pytest

from build_c import PLAIN_NAMES, compiler
from cosim.errors import BadInput
from cosim.files.resources import REPOSITORY, circuits, fmu_sources
from cosim.mechanics import package as fmu

ROW = re.compile(r'^(INT_)?(PARAMETER|TUNABLE|INPUT|OUTPUT)\((\w+), (.*)"(.*)"\)$', re.MULTILINE)


def table() -> list[dict[str, Any]]:
    """variables.def, read by other means than the C compiler."""
    rows = []
    for integer, kind, name, fields, text in ROW.findall(
        (fmu_sources() / "src/physics/variables.def").read_text()
    ):
        values = [field.strip().strip('"') for field in fields.split(",") if field.strip()]
        unit = None if integer else values.pop(0)
        rows.append(
            {"name": name, "causality": kind.lower(), "unit": unit, "text": text}
            | dict(zip(("start", "min", "max"), map(float, values), strict=False))
        )
    return rows


def description_xml(path: Path) -> ElementTree.Element:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> int:
    return request.param


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    return fmu.pack(tmp_path_factory.mktemp("built"))


def test_the_description_is_the_table(built: dict[int, Path], version: int) -> None:
    description = fmpy.read_model_description(str(built[version]))
    time, *variables = description.modelVariables
    rows = table()
    assert (time.name, time.causality, time.valueReference) == ("time", "independent", 0)
    assert len(rows) > 50
    assert [v.name for v in variables] == [row["name"] for row in rows]
    for variable, row in zip(variables, rows, strict=True):
        causality, tunable = row["causality"], row["causality"] == "tunable"
        assert variable.causality == ("parameter" if tunable else causality)
        assert variable.unit == row["unit"]
        assert variable.description == row["text"]
        for key in ("start", "min", "max"):
            found = getattr(variable, key)
            assert (None if found is None else float(found)) == row.get(key)
        if variable.causality == "parameter":
            assert variable.variability == ("tunable" if tunable else "fixed")
    reals = [v.valueReference for v in variables if v.type in ("Real", "Float64")]
    integers = [v.valueReference for v in variables if v.type in ("Integer", "Int32")]
    assert reals == list(range(1, len(reals) + 1))
    assert integers == list(range(1001, 1001 + len(integers)))


# Bureau international des poids et mesures, The International System of Units, table 4.
@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("N/A", {"kg": 1, "m": 1, "s": -2, "A": -1}),
        ("N.s/m", {"kg": 1, "s": -1}),
        ("V/s", {"kg": 1, "m": 2, "s": -4, "A": -1}),
        ("J", {"kg": 1, "m": 2, "s": -2}),
        ("1/m2", {"m": -2}),
        ("1", {}),
    ],
)
def test_units_are_si(built: dict[int, Path], version: int, unit: str, expected: dict) -> None:
    description = fmpy.read_model_description(str(built[version]))
    found = {u.name: u.baseUnit for u in description.unitDefinitions}[unit]
    assert found is not None
    bases = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    assert {b: getattr(found, b) for b in bases if getattr(found, b)} == expected


def test_abilities(built: dict[int, Path], version: int) -> None:
    names = {
        2: ["canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"],
        3: ["canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives"],
    }
    ability = description_xml(built[version]).find("CoSimulation")
    assert ability is not None
    assert ability.get("modelIdentifier") == "stickslip"
    for name in ["canHandleVariableCommunicationStepSize", *names[version]]:
        assert ability.get(name) == "true"
    for name in ["needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess"]:
        assert ability.get(name) == "false"


def test_packing_again_gives_the_same_bytes(built: dict[int, Path], tmp_path: Path) -> None:
    again = fmu.pack(tmp_path / "elsewhere")
    for version, path in built.items():
        assert again[version].read_bytes() == path.read_bytes()
    leftovers = {path.name for path in (tmp_path / "elsewhere").iterdir()}
    assert leftovers == {"stickslip-fmi2.fmu", "stickslip-fmi3.fmu"}


def test_contents(built: dict[int, Path], version: int) -> None:
    with zipfile.ZipFile(built[version]) as archive:
        names = set(archive.namelist())
        sources = {name.removeprefix("sources/") for name in names if name.startswith("sources/")}
        text = archive.read("documentation/licenses/license.txt")
    assert text == (REPOSITORY / "fmu/LICENSE").read_bytes()
    assert {f"fmi/fmi{version}.c", f"fmi/fmi{version}Functions.h", "fmi/token.h"} <= sources
    assert not any(name.startswith(f"fmi/fmi{5 - version}") for name in sources)
    assert {"physics/model.c", "physics/variables.def"} <= sources
    assert "fmi/describe.c" not in sources
    assert "buildDescription.xml" in sources
    assert len([name for name in names if name.startswith("binaries/")]) == 1
    if version == 3:
        description = fmpy.read_model_description(str(built[version]))
        listed = description.buildConfigurations[0].sourceFileSets[0].sourceFiles
    else:
        files = description_xml(built[version]).findall("CoSimulation/SourceFiles/File")
        listed = [file.get("name") for file in files]
    assert set(listed) == {name for name in sources if name.endswith(".c")}


def test_the_sources_inside_build_by_themselves(built: dict[int, Path], tmp_path: Path) -> None:
    fmpy.extract(str(built[2]), str(tmp_path))
    library = tmp_path / "own.so"
    files = sorted(str(path) for path in (tmp_path / "sources").rglob("*.c"))
    command = [*compiler(), "-shared", "-fPIC", *PLAIN_NAMES, *files, "-lm", "-o", str(library)]
    subprocess.run(command, check=True)
    instantiate = ctypes.CDLL(str(library)).fmi2Instantiate
    instantiate.restype = ctypes.c_void_p
    arguments = (None, None, False, False)
    assert instantiate(b"own", 1, fmu.token().encode(), *arguments)
    assert not instantiate(b"own", 1, b"other", *arguments)


def test_only_fmi_functions_are_exported() -> None:
    nm = shutil.which("nm")
    if not nm or fmpy.system != "linux":
        pytest.skip("needs nm on Linux")
    library = next(fmu.unpacked(2).glob("binaries/*/*"))
    listing = subprocess.run(
        [nm, "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True
    )
    names = {line.split()[-1] for line in listing.stdout.splitlines()}
    assert {name for name in names if not name.startswith(("fmi2", "fmi3"))} == set()


def test_the_binary_lies_where_importers_look(version: int) -> None:
    assert fmpy.supported_platforms(str(fmu.unpacked(version)))[:1] == [fmpy.platform]
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    assert [path.name for path in (fmu.unpacked(version) / "binaries").iterdir()] == [platform]


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        fmu.pack(tmp_path / "file" / "out")


def test_data_folders_are_found() -> None:
    assert (fmu_sources() / "src" / "physics" / "variables.def").is_file()
    assert circuits().is_dir()


def test_the_physics_know_nothing_of_fmi() -> None:
    folder = fmu_sources() / "src" / "physics"
    text = "".join(path.read_text() for path in folder.iterdir())
    included = set(re.findall(r'#include "(.*)"', text))
    assert len(included) > 5
    assert included <= {path.name for path in folder.iterdir()}


def test_the_fmu_stands_under_a_licence_of_its_own(built: dict[int, Path], version: int) -> None:
    # What is BSD must not take anything from outside its folder, where all is GPL.
    files = [path for path in (REPOSITORY / "fmu/src").rglob("*") if path.is_file()]
    assert len(files) > 20
    for path in files:
        text = path.read_text("utf-8")
        assert text.startswith("/* SPDX-License-Identifier: BSD-2-Clause */\n"), path
        for name in re.findall(r'^#\s*include "(.+)"', text, re.MULTILINE):
            places = [path.parent / name, REPOSITORY / "fmu/include" / name]
            found = [place.resolve() for place in places if place.is_file()]
            assert name == "token.h" or found, f"{path} includes {name}"
            assert all(place.is_relative_to(REPOSITORY / "fmu") for place in found)
    assert description_xml(built[version]).get("license") == "BSD-2-Clause"
    for path in (REPOSITORY / "fmu/include").iterdir():
        assert "2-Clause BSD License" in path.read_text("utf-8"), path
