"""Builds and loads the compiled routines in ``cosim/native``, with the C compiler of the machine.

The library lies beside the FMU files; its name holds a hash of what it is made of, so that it is
never out of date. It appears whole or not at all, and is built again if it cannot be loaded.
"""

import ctypes
import hashlib
import platform
import sys
import tempfile
from functools import cache
from pathlib import Path

from cosim.compiler import COMPILE_FLAGS, LIBRARY_FLAGS, build_directory, compiler, execute
from cosim.errors import BadInput

SOURCE = Path(__file__).with_name("native") / "part.c"
FLAGS = (*COMPILE_FLAGS, *LIBRARY_FLAGS)
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

_POINTER, _LONG, _REAL = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
_SURFACE = (_LONG, _POINTER, _POINTER, _LONG, _POINTER, _REAL, _REAL)
_RESULT = (_POINTER, _POINTER, _POINTER)
_ARGUMENTS = {
    "part_exact": (*_SURFACE, _LONG, _POINTER, *_RESULT),
    "part_threshold": (*_SURFACE, _REAL, _REAL, _LONG, *_RESULT),
    "part_moreau": (*_SURFACE, _REAL, _LONG, *_RESULT),
    "part_errors": (
        *(_LONG, _POINTER, _POINTER, _REAL),
        *(_LONG, _POINTER, _REAL, _REAL),
        *(_LONG, _POINTER, _POINTER, _POINTER, _POINTER),
    ),
}


@cache
def part_library() -> ctypes.CDLL:
    """The routines of ``part.c``, built where that is still to do."""
    path = library_path()
    if not path.exists():
        build(path)
    try:
        library = ctypes.CDLL(str(path))
    except OSError:  # damaged
        build(path)
        try:
            library = ctypes.CDLL(str(path))
        except OSError as error:
            raise BadInput(f"The compiled library {path} cannot be loaded: {error}.") from error
    for name, arguments in _ARGUMENTS.items():
        function = getattr(library, name)
        function.argtypes = arguments
        function.restype = None if name == "part_errors" else _LONG
    return library


def library_path() -> Path:
    """Where the library of these sources, for this machine, lies once it is built."""
    made_of = (FLAGS, sys.platform, platform.machine(), sys.maxsize)
    digest = hashlib.sha256(repr(made_of).encode() + _source()).hexdigest()[:16]
    return build_directory() / f"part-{digest}{SUFFIX}"


def build(path: Path) -> None:
    """Compile ``part.c`` into ``path``."""
    command = compiler()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".build-") as name:
            target = Path(name) / path.name
            execute([*command, *FLAGS, str(SOURCE), "-o", str(target), "-lm"], SOURCE.name)
            target.replace(path)
    except OSError as error:
        reason = error.strerror or error
        raise BadInput(f"Cannot write the compiled library to {path.parent}: {reason}.") from error


def _source() -> bytes:
    try:
        return SOURCE.read_bytes()
    except OSError as error:
        raise BadInput(f"{SOURCE} is missing from this installation of cosim.") from error
