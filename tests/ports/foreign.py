"""A stranger's FMU, compiled by the machine's own compiler; foreign.c says what it computes."""

import subprocess
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import platform, sharedLibraryExtension

_REALS = (
    ("u", 0, "input", 'start="0"', ""),
    ("omega", 1, "output", "", "rad/s"),
    ("J", 2, "parameter", 'start="2e-4"', "kg.m2"),
    ("B", 3, "parameter", 'start="1e-4"', ""),
    ("D", 4, "parameter", 'start="1"', ""),
    ("alpha", 5, "output", "{derivative}", "rad/s2"),
    ("y", 6, "output", "", ""),
    ("crash_at", 7, "parameter", 'start="1e9"', "s"),
    ("fail_at", 8, "parameter", 'start="1e9"', "s"),
    ("v", 12, "output", "", "m/s"),
    ("drop", 13, "parameter", 'start="0.01"', "m"),
)


def build(
    folder: Path,
    name: str,
    version: int = 2,
    saves: bool = True,
    through: bool = False,
    derivative: bool = False,
    fixed: bool = False,
    slopes: bool = False,
    discrete: str = "",
) -> Path:
    """An FMU of FMI 2.0 or 3.0; what it says of itself: whether it saves its state, that y depends
    on u at once, that alpha is the derivative of omega, that its steps are fixed, that it tells
    slopes, and the name of an output that changes at events alone."""
    library = folder / f"foreign{sharedLibraryExtension}"
    if not library.exists():
        library.write_bytes(_library())
    describe = _two if version == 2 else _three
    place = platform if version == 2 else {"linux64": "x86_64-linux"}.get(platform, platform)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        text = describe(saves, through, derivative, fixed)
        if slopes:
            text = text.replace("<CoSimulation ", '<CoSimulation maxOutputDerivativeOrder="1" ')
        if discrete:
            text = text.replace(f'name="{discrete}"', f'name="{discrete}" variability="discrete"')
        archive.writestr("modelDescription.xml", text)
        archive.write(library, f"binaries/{place}/foreign{sharedLibraryExtension}")
    return path


def reworded(path: Path, *changes: tuple[str, str]) -> None:
    """Change what an FMU says of itself."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    about = files["modelDescription.xml"].decode()
    for old, new in changes:
        assert old in about
        about = about.replace(old, new)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (files | {"modelDescription.xml": about}).items():
            archive.writestr(name, content)


@cache
def _library() -> bytes:
    """Compiled once for all tests of a process."""
    with TemporaryDirectory() as folder:
        return recompiled(Path(folder)).read_bytes()


def recompiled(folder: Path, *changes: tuple[str, str]) -> Path:
    """The library with a changed source, in the folder in which an FMU is built of it later."""
    text = Path(__file__).with_name("foreign.c").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    source, library = folder / "foreign.c", folder / f"foreign{sharedLibraryExtension}"
    source.write_text(text)
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O2", "-w", "-o", library, source, "-lm"], check=True
    )
    return library


def _abilities(saves: bool, fixed: bool, word: str) -> str:
    return (
        f'<CoSimulation modelIdentifier="foreign" canGet{"AndSet"}{word}="{str(saves).lower()}" '
        f'canHandleVariableCommunicationStepSize="{str(not fixed).lower()}"/>'
    )


def _two(saves: bool, through: bool, derivative: bool, fixed: bool) -> str:
    own = 'derivative="2"' if derivative else ""
    rows = [
        f'<ScalarVariable name="{name}" valueReference="{place}" causality="{causality}"'
        + (' variability="fixed"' if causality == "parameter" else "")
        + f"><Real {start.format(derivative=own)}"
        + (f' unit="{unit}"' if unit else "")
        + "/></ScalarVariable>"
        for name, place, causality, start, unit in _REALS
    ]
    rows += [
        '<ScalarVariable name="off" valueReference="20" causality="input" variability="discrete">'
        '<Boolean start="false"/></ScalarVariable>',
        '<ScalarVariable name="steps" valueReference="21" causality="output" '
        'variability="discrete"><Integer/></ScalarVariable>',
    ]
    depends = ' dependencies="1"' if through else ""
    return (
        '<fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="{1}">'
        + _abilities(saves, fixed, "FMUstate")
        + f"<ModelVariables>{''.join(rows)}</ModelVariables><ModelStructure><Outputs>"
        + f'<Unknown index="2"/><Unknown index="6"/><Unknown index="7"{depends}/>'
        + '<Unknown index="10"/><Unknown index="13"/></Outputs>'
        + "</ModelStructure></fmiModelDescription>"
    )


def _three(saves: bool, through: bool, derivative: bool, fixed: bool) -> str:
    own = 'derivative="1"' if derivative else ""
    rows = [
        f'<Float64 name="{name}" valueReference="{place}" causality="{causality}"'
        + (' variability="fixed"' if causality == "parameter" else "")
        + f" {start.format(derivative=own)}"
        + (f' unit="{unit}"' if unit else "")
        + "/>"
        for name, place, causality, start, unit in _REALS
    ]
    rows += [
        '<Boolean name="off" valueReference="20" causality="input" start="false"/>',
        '<Int32 name="steps" valueReference="21" causality="output"/>',
        '<Float64 name="x" valueReference="30" causality="input" start="0 0">'
        '<Dimension start="2"/></Float64>',
        '<Float64 name="xs" valueReference="31" causality="output">'
        '<Dimension start="2"/></Float64>',
    ]
    depends = ' dependencies="0"' if through else ""
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="foreign" instantiationToken="{1}">'
        + _abilities(saves, fixed, "FMUState")
        + f"<ModelVariables>{''.join(rows)}</ModelVariables><ModelStructure>"
        + '<Output valueReference="1"/><Output valueReference="5"/>'
        + f'<Output valueReference="6"{depends}/><Output valueReference="21"/>'
        + '<Output valueReference="12"/><Output valueReference="31"/>'
        + "</ModelStructure></fmiModelDescription>"
    )
