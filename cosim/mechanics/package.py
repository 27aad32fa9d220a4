"""Builds, checks and unpacks the FMU files of the mechanics.

One C compiler run makes one library with both interfaces; `stickslip-fmi2.fmu` and
`stickslip-fmi3.fmu` wrap it with the XML and the sources. The same sources give the same bytes.
"""

import hashlib
import math
import re
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from cosim.errors import BadInput
from cosim.files.resources import fmu_sources, licence
from cosim.toolchain.compiler import (
    COMPILE_FLAGS,
    LIBRARY_FLAGS,
    build_directory,
    compiler,
    execute,
)

MODEL = "stickslip"
VERSIONS = (2, 3)
HOST_TOOL = "fmi/describe.c"
LARGEST_FILE = 50_000_000  # bytes, when unpacking


def build(force: bool = False, out_dir: Path | None = None) -> dict[int, Path]:
    """Build both FMU files, unless they are up to date; give their paths by FMI version."""
    out = out_dir or build_directory()
    paths = {version: out / f"{MODEL}-fmi{version}.fmu" for version in VERSIONS}
    if not force and all(_is_current(path, version) for version, path in paths.items()):
        return paths
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out, prefix=".build-") as name:
            work = Path(name)
            library = _compile_library(work)
            for version, path in paths.items():
                packed = work / path.name
                _pack(packed, _contents(version, library, work))
                packed.replace(path)
    except OSError as error:
        raise BadInput(f"Cannot write the FMU files to {out}: {error.strerror}.") from error
    for folder in out.glob("fmi[23]-*"):
        # An unforced build leaves those of this token alone: other processes may be loading them.
        if force or not folder.name.endswith(token()):
            shutil.rmtree(folder, ignore_errors=True)
    return paths


def unpacked(version: int = 2) -> Path:
    """The absolute path of the unpacked FMU, built and unpacked where that is still to do."""
    out = build_directory().absolute()
    folder = out / f"fmi{version}-{token()}"
    if folder.is_dir():
        return folder
    path = build()[version]
    with tempfile.TemporaryDirectory(dir=out, prefix=".unpack-") as name:
        extract(path, Path(name) / "fmu")
        try:
            (Path(name) / "fmu").rename(folder)
        except OSError:
            if not folder.is_dir():  # else another process was first
                raise
    return folder


def check() -> list[str]:
    """Validate and run both FMU files, print a line each, and list the problems found."""
    problems = []
    heights = []
    for version, path in build().items():
        found = [f"{path.name}: {problem}" for problem in validate_fmu(str(path))]
        try:
            heights.append(_trial_run(version))
            result = f"1000 steps, z_part = {heights[-1]:.9g} m"
        except Exception as error:
            found.append(f"{path.name}: {error}")
            result = "does not run"
        print(f"{path}: {f'{len(found)} problems' if found else 'valid'}; {result}")
        problems += found
    if len(set(heights)) > 1:
        problems.append(f"the two files disagree: z_part = {heights[0]!r} and {heights[1]!r} m")
    for problem in problems:
        print(problem)
    return problems


def _trial_run(version: int) -> float:
    """Height of the part after 0.1 s of a constant current."""
    folder = unpacked(version)
    description = fmpy.read_model_description(str(folder))
    places = {v.name: v.valueReference for v in description.modelVariables}
    kind = FMU2Slave if version == 2 else FMU3Slave
    fmu = kind(
        instanceName="check", guid=token(), modelIdentifier=MODEL, unzipDirectory=str(folder)
    )
    fmu.instantiate()
    try:
        set_reals, get_reals = (
            (fmu.setReal, fmu.getReal)
            if isinstance(fmu, FMU2Slave)
            else (fmu.setFloat64, fmu.getFloat64)
        )
        if isinstance(fmu, FMU2Slave):
            fmu.setupExperiment()
        fmu.enterInitializationMode()
        set_reals([places["current"]], [0.1])
        fmu.exitInitializationMode()
        for i in range(1000):
            fmu.doStep(i * 1e-4, 1e-4)
        z_part, z_surface, time = get_reals([places[n] for n in ("z_part", "z_surface", "time")])
        fmu.terminate()
    finally:
        fmu.freeInstance()
    if not (math.isfinite(z_part) and math.isfinite(z_surface) and math.isclose(time, 0.1)):
        raise ValueError(f"it gives z_part = {z_part} m, z_surface = {z_surface} m at {time} s")
    return z_part


@cache
def token() -> str:
    """A hash of all that the FMU files are made of: their GUID and instantiation token."""
    digest = hashlib.sha256(repr((COMPILE_FLAGS, LIBRARY_FLAGS)).encode())
    root = fmu_sources()
    for file in [*_sources(), root / "src" / HOST_TOOL, *_headers()]:
        data = file.read_bytes()
        digest.update(f"{_place(file)} {len(data)}\n".encode() + data)
    return digest.hexdigest()[:32]


def _sources() -> list[Path]:
    folder = fmu_sources() / "src"
    return sorted(file for file in folder.glob("*/*.c") if file != folder / HOST_TOOL)


def _headers() -> list[Path]:
    root = fmu_sources()
    return sorted([*root.glob("src/*/*.h"), *root.glob("src/*/*.def"), *root.glob("include/*.h")])


def _place(file: Path) -> str:
    """Where a file lies in sources/. The standard's headers lie beside what includes them."""
    root = fmu_sources()
    inside = (
        file.relative_to(root / "src") if root / "src" in file.parents else Path("fmi", file.name)
    )
    return inside.as_posix()


def _compile(sources: list[Path], target: Path, flags: tuple[str, ...] = ()) -> None:
    root = fmu_sources()
    includes = [f"-I{root / 'include'}", f"-DFMU_TOKEN={token()}"]
    files = [str(file) for file in sources]
    command = [*compiler(), *COMPILE_FLAGS, *flags, *includes, *files, "-o", str(target), "-lm"]
    execute(command, "the FMU")


def _compile_library(work: Path) -> bytes:
    target = work / (MODEL + fmpy.sharedLibraryExtension)
    _compile(_sources(), target, LIBRARY_FLAGS)
    return target.read_bytes()


def _describe(work: Path, *arguments: str) -> bytes:
    tool = work / ("describe.exe" if sys.platform == "win32" else "describe")
    if not tool.exists():
        _compile([*_sources(), fmu_sources() / "src" / HOST_TOOL], tool)
    return execute([str(tool), *arguments], "the FMU").replace(b"\r\n", b"\n")


def _library_place(version: int) -> str:
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    return f"binaries/{platform}/{MODEL}{fmpy.sharedLibraryExtension}"


def _contents(version: int, library: bytes, work: Path) -> Iterator[tuple[str, bytes]]:
    sources = [_place(file) for file in _sources()]
    yield "modelDescription.xml", _describe(work, str(version), *sources)
    yield _library_place(version), library
    yield "documentation/licenses/license.txt", licence().read_bytes()
    for file in [*_sources(), *_headers()]:
        yield f"sources/{_place(file)}", file.read_bytes()
    yield "sources/fmi/token.h", f"#define FMU_TOKEN {token()}\n".encode()
    if version == 3:
        yield "sources/buildDescription.xml", _describe(work, "build", *sources)


def _pack(target: Path, contents: Iterator[tuple[str, bytes]]) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in contents:
            info = zipfile.ZipInfo(name)  # dated 1980, so that the same files give the same bytes
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, data)


def _is_current(path: Path, version: int) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            text = archive.read("modelDescription.xml").decode()
            found = re.search(r' (?:guid|instantiationToken)="(\w+)"', text)
            present = _library_place(version) in archive.namelist()
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return False
    return present and found is not None and found[1] == token()


def extract(archive_path: Path, folder: Path) -> None:
    """Unpack an FMU below `folder`; refuse names that lead elsewhere and huge files."""
    with zipfile.ZipFile(archive_path) as archive:
        for info in archive.infolist():
            name = PurePosixPath(info.filename)
            bad = name.is_absolute() or ".." in name.parts or re.search(r"[\\:]", info.filename)
            if bad or info.file_size > LARGEST_FILE:
                raise BadInput(f"{archive_path} contains the unsafe entry {info.filename}.")
            archive.extract(info, folder)
