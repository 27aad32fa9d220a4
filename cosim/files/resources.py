"""The data folders that stand beside the package in a checkout and inside it in a wheel."""

from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path

from cosim.errors import BadInput

REPOSITORY = Path(__file__).resolve().parents[2]


def fmu_sources() -> Path:
    """The folder of the FMU's C sources."""
    return _folder("cosim._fmu", "fmu", "src/physics/model.h")


def circuits() -> Path:
    """The folder of the netlists."""
    return _folder("cosim._circuits", "circuits", ".")


def licence() -> Path:
    """The text of the licence."""
    try:
        installed = [file for file in files("cosim") or [] if file.name == "LICENSE"]
    except PackageNotFoundError:
        installed = []
    for path in [*(Path(str(file.locate())) for file in installed), REPOSITORY / "LICENSE"]:
        if path.is_file():
            return path
    raise BadInput("The file LICENSE is missing from this installation of cosim.")


def _folder(package: str, name: str, known: str) -> Path:
    # Not importlib.resources.files: for a folder without __init__.py it is not a path.
    spec = find_spec(package)
    inside = list(spec.submodule_search_locations or []) if spec else []
    for folder in [*map(Path, inside), REPOSITORY / name]:
        if (folder / known).exists():
            return folder.resolve()
    raise BadInput(f"The folder {name}/ is missing from this installation of cosim.")
