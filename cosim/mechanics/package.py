"""The FMU of the mechanics: where it lies unpacked, and the .fmu files that others can use.

`stickslip-fmi2.fmu` and `stickslip-fmi3.fmu` hold the same library, which has both interfaces, with
the XML and the sources. The same installation gives the same bytes.
"""

import math
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
from fmpy.validation import validate_fmu

from cosim.files.atomic import whole
from cosim.toolchain.libraries import compiled

MODEL = "stickslip"
VERSIONS = (2, 3)


def unpacked(version: int = 2) -> Path:
    """The absolute path of the unpacked FMU; BadInput if the installation has none."""
    return compiled(f"fmi{version}")


@cache
def token() -> str:
    """A hash of all that the FMU is made of: its GUID and instantiation token."""
    description = unpacked(3) / "modelDescription.xml"
    return ElementTree.parse(description).getroot().attrib["instantiationToken"]


def pack(folder: Path) -> dict[int, Path]:
    """Write both .fmu files to ``folder``; gives their paths by FMI version."""
    paths = {version: folder / f"{MODEL}-fmi{version}.fmu" for version in VERSIONS}
    for version, path in paths.items():
        write(path, version)
    return paths


def write(path: Path, version: int) -> None:
    """Write the .fmu file of one FMI version to ``path``."""
    with whole(path) as target:
        zipped(unpacked(version), target)


def check() -> list[str]:
    """Validate and run both .fmu files, print a line each, and list the problems found."""
    problems = []
    heights = []
    with tempfile.TemporaryDirectory() as folder:
        for path in pack(Path(folder)).values():
            found = [f"{path.name}: {problem}" for problem in validate_fmu(str(path))]
            try:
                heights.append(_trial_run(path))
                result = f"1000 steps, z_part = {heights[-1]:.9g} m"
            except Exception as error:
                found.append(f"{path.name}: {error}")
                result = "does not run"
            print(f"{path.name}: {f'{len(found)} problems' if found else 'valid'}; {result}")
            problems += found
    if len(set(heights)) > 1:
        problems.append(f"the two files disagree: z_part = {heights[0]!r} and {heights[1]!r} m")
    for problem in problems:
        print(problem)
    return problems


def _trial_run(path: Path) -> float:
    """Height of the part after 0.1 s of a constant current, in 1000 steps."""
    names = ("z_part", "z_surface", "time")
    end: Any = fmpy.simulate_fmu(
        str(path),
        stop_time=0.1,
        output_interval=1e-4,
        start_values={"current": 0.1},
        output=names[:2],
    )[-1]
    z_part, z_surface, time = (float(end[name]) for name in names)
    if not (math.isfinite(z_part) and math.isfinite(z_surface) and math.isclose(time, 0.1)):
        raise ValueError(f"it gives z_part = {z_part} m, z_surface = {z_surface} m at {time} s")
    return z_part


def zipped(folder: Path, target: Path) -> None:
    """Pack the folder of an FMU; the same files give the same bytes."""
    with zipfile.ZipFile(target, "w") as archive:
        for file in sorted(path for path in folder.rglob("*") if path.is_file()):
            # Dated 1980, so that the same files give the same bytes.
            info = zipfile.ZipInfo(file.relative_to(folder).as_posix())
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, file.read_bytes())
