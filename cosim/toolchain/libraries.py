"""Builds and loads the compiled routines in ``cosim/native``, with the C compiler of the machine.

The libraries lie beside the FMU files; the name of each holds a hash of what it is made of, so that
it is never out of date. It appears whole or not at all, and is built again if it cannot be loaded.
"""

import ctypes
import hashlib
import platform
import sys
import tempfile
from functools import cache
from pathlib import Path

from cosim.errors import BadInput
from cosim.toolchain.compiler import (
    COMPILE_FLAGS,
    LIBRARY_FLAGS,
    build_directory,
    compiler,
    execute,
)

PACKAGE = Path(__file__).resolve().parents[1]
LOOP = PACKAGE / "coupling" / "loop"
SOURCES = {
    "part": (PACKAGE / "mechanics" / "part.c",),
    "loop": (
        *(LOOP / f"{name}.c" for name in ("fmu", "recorder", "lead")),
        PACKAGE / "drive" / "command.c",
        LOOP / "loop.h",
        PACKAGE / "drive" / "command.h",
    ),
}
"""The libraries, and the files that each is made of."""
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
    library = _loaded("part")
    for name, arguments in _ARGUMENTS.items():
        function = getattr(library, name)
        function.argtypes = arguments
        function.restype = None if name == "part_errors" else _LONG
    return library


@cache
def library(name: str) -> ctypes.CDLL:
    """A compiled library."""
    return _loaded(name)


def library_path(name: str) -> Path:
    """Where the library of these sources, for this machine, lies once it is built."""
    made_of = (FLAGS, sys.platform, platform.machine(), sys.maxsize)
    digest = hashlib.sha256(repr(made_of).encode())
    for source in SOURCES[name]:
        try:
            digest.update(source.read_bytes())
        except OSError as error:
            raise BadInput(f"{source} is missing from this installation of cosim.") from error
    return build_directory() / f"{name}-{digest.hexdigest()[:16]}{SUFFIX}"


def build(name: str, path: Path) -> None:
    """Compile the sources of a library into ``path``."""
    command = compiler()
    sources = [str(source) for source in SOURCES[name] if source.suffix == ".c"]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".build-") as folder:
            target = Path(folder) / path.name
            execute([*command, *FLAGS, *sources, "-o", str(target), "-lm"], f"{name} (C)")
            target.replace(path)
    except OSError as error:
        reason = error.strerror or error
        raise BadInput(f"Cannot write the compiled library to {path.parent}: {reason}.") from error


def _loaded(name: str) -> ctypes.CDLL:
    path = library_path(name)
    if not path.exists():
        build(name, path)
    try:
        return ctypes.CDLL(str(path))
    except OSError:  # damaged
        build(name, path)
        try:
            return ctypes.CDLL(str(path))
        except OSError as error:
            raise BadInput(f"The compiled library {path} cannot be loaded: {error}.") from error
