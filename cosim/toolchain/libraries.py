"""What the C of the package was compiled to when the package was installed."""

import ctypes
import sys
from functools import cache
from pathlib import Path

from cosim.errors import BadInput

FOLDER = Path(__file__).resolve().parents[1] / "_compiled"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


@cache
def library(name: str) -> ctypes.CDLL:
    """The shared library ``name``; BadInput if it is missing or cannot be loaded."""
    path = compiled(name + SUFFIX)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise BadInput(f"The compiled library {path} cannot be loaded: {error}.") from error


def compiled(name: str) -> Path:
    """The absolute path of one of the compiled files or folders; BadInput if it is missing."""
    path = FOLDER / name
    if not path.exists():
        raise BadInput(
            f"{path} is missing from this installation of cosim: install it again "
            "(in a checkout, with `make setup`)."
        )
    return path
