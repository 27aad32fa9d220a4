"""The package's compiled C libraries, built when the package was installed.

The build records each library's functions and structures, as its C declares them, and each file's
size and hash. Files are checked against these before they are loaded: a damaged library, or one of
another build, could end the process or compute wrong results.
"""

import ctypes
import hashlib
import json
import os
import sys
from ctypes.util import find_library
from functools import cache, reduce
from operator import mul
from pathlib import Path
from typing import Any

from cosim.errors import BadInput

FOLDER = Path(__file__).resolve().parents[1] / "_compiled"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

_AGAIN = "install it again (in a checkout, with `make setup`)"
_OTHERS = 0o002
"""The permission bit by which every user may write a file or folder."""


CALLBACK = ctypes.CFUNCTYPE(None)

_TYPES: dict[str, Any] = {
    **{f"{name}_t": getattr(ctypes, f"c_{name}") for name in ("int32", "int64")},
    **{name: getattr(ctypes, f"c_{name}") for name in ("char", "bool", "int", "long", "double")},
    **{"void": None, "*": ctypes.c_void_p, "()": CALLBACK},
}
"""ctypes' types by the build's words for them."""


@cache
def library(name: str) -> ctypes.CDLL:
    """The shared library ``name``, whose functions take pointers as addresses; BadInput if it is
    missing, damaged or cannot be loaded."""
    path = compiled(name + SUFFIX)
    try:
        found = ctypes.CDLL(str(path))
    except OSError as error:
        raise BadInput(f"The compiled library {path} cannot be loaded: {error}.") from error
    for function, (result, arguments) in _built(name)["interfaces"][name]["functions"].items():
        entry = getattr(found, function)
        entry.restype, entry.argtypes = _TYPES[result], [_TYPES[kind] for kind in arguments]
    return found


@cache
def structures(name: str) -> dict[str, type[ctypes.Structure]]:
    """The structures that the library ``name`` declares, pointers as addresses. Raises BadInput."""
    known = dict(_TYPES)
    declared = _built(name)["interfaces"][name]["structures"]
    for structure, fields in declared.items():
        # An array of several dimensions is an array of arrays: the last length is innermost.
        kinds = [
            (field, reduce(mul, reversed(lengths), known[kind])) for field, kind, lengths in fields
        ]
        body = {"_fields_": kinds, "__slots__": ()}  # no other names are taken
        known[structure] = type(structure, (ctypes.Structure,), body)
    return {structure: known[structure] for structure in declared}


def _built(name: str) -> dict[str, Any]:
    """The build's record, with the shared library ``name`` checked against it."""
    path = compiled(name + SUFFIX)
    return json.loads((path.parent / "build.json").read_bytes())


def ngspice_library() -> str:
    """The path or name of libngspice on this machine. Raises BadInput where it is missing."""
    name = os.environ.get("NGSPICE_LIBRARY_PATH") or _found_library(sys.prefix)
    if name is None:
        raise BadInput(
            "libngspice was not found; install it (Debian and Ubuntu: libngspice0, macOS: brew "
            "install libngspice) or name it in NGSPICE_LIBRARY_PATH."
        )
    return os.path.abspath(name) if os.sep in name else name  # a worker has another folder


@cache
def _found_library(prefix: str) -> str | None:
    """The library of Python's environment (as conda's have), of the system, or of Homebrew.
    ``find_library`` starts programs, which takes some milliseconds."""
    own = (f"{prefix}/lib/libngspice{SUFFIX}", f"{prefix}/Library/bin/ngspice.dll")
    brewed = (f"{folder}/libngspice.dylib" for folder in ("/opt/homebrew/lib", "/usr/local/lib"))
    # Debian's runtime package has only the versioned name, which the loader's own search finds.
    found = next(filter(os.path.exists, own), None) or find_library("ngspice")
    return found or next(filter(os.path.exists, brewed), None)


def digest(name: str) -> str:
    """The hash of the shared library ``name`` in the build's record."""
    return _built(name)["files"][name + SUFFIX][1]


def compiled(name: str) -> Path:
    """The absolute path of a compiled file or folder; BadInput if it is missing, differs from the
    build's record, or can be written by every user."""
    _check(FOLDER, name)
    return FOLDER / name


@cache
def _check(folder: Path, name: str) -> None:
    """Check a file, or all in a folder, once in a process."""
    path = folder / name
    try:
        os.stat(path)
        known = json.loads((folder / "build.json").read_bytes())["files"]
        files = {file: known[file] for file in known if file == name or file.startswith(f"{name}/")}
        for file, (size, digest) in files.items():
            path = folder / file
            content = path.read_bytes()
            if len(content) != size or hashlib.sha256(content).hexdigest() != digest:
                raise BadInput(f"{path} is damaged, or of another build of cosim: {_AGAIN}.")
    except FileNotFoundError as error:
        path = error.filename
        raise BadInput(f"{path} is missing from this installation of cosim: {_AGAIN}.") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        files = {}
    if not files and name != "build.json":
        raise BadInput(f"{path} is not what was built with this installation of cosim: {_AGAIN}.")
    _check_writers(folder, [folder, *(folder / file for file in files)])


def _check_writers(folder: Path, paths: list[Path]) -> None:
    """Refuse paths that every user may write, unless this very module can be written by them."""
    ours = Path(__file__).stat().st_mode | folder.parent.stat().st_mode
    if os.name != "posix" or ours & _OTHERS:
        return
    between = {above for path in paths for above in path.parents if above.is_relative_to(folder)}
    for path in sorted({*paths, *between}):
        if path.stat().st_mode & _OTHERS:
            raise BadInput(
                f"{path} can be written by every user of this machine, so it is not loaded: take "
                f"that right away, and {_AGAIN}."
            )
