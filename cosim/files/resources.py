"""The data folders that stand beside the package in a checkout and inside it in a wheel."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

from cosim.errors import BadInput

REPOSITORY = Path(__file__).resolve().parents[2]


def fmu_sources() -> Path:
    """The folder whose ``src/physics/variables.def`` is the FMU's table of variables.

    In a checkout it holds all the FMU's sources, in a wheel only the table.
    """
    return _folder("cosim._fmu", "fmu", "src/physics/variables.def")


@cache
def circuits() -> Path:
    """The folder of the netlists."""
    return _folder("cosim._circuits", "circuits", ".")


def compiled_fmus() -> list[Path]:
    """The folders that hold the package's own FMUs, unpacked: ``gearbox``, ``fmi3``."""
    folder = Path(__file__).resolve().parents[1] / "_compiled"
    return [folder / "models", folder]


def _folder(package: str, name: str, known: str) -> Path:
    # Not importlib.resources.files: for a folder without __init__.py it is not a path.
    spec = find_spec(package)
    inside = list(spec.submodule_search_locations or []) if spec else []
    for folder in [*map(Path, inside), REPOSITORY / name]:
        if (folder / known).exists():
            return folder.resolve()
    raise BadInput(f"The folder {name}/ is missing from this installation of cosim.")
