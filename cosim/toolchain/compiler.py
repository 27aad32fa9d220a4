"""The C compiler of the machine, and the folder for what it makes."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from cosim.errors import BadInput
from cosim.files.resources import REPOSITORY, fmu_sources

# Without contraction every platform computes the same bits.
COMPILE_FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-Wall", "-Wextra")
LIBRARY_FLAGS = ("-fPIC", "-shared", "-fvisibility=hidden")


def compiler() -> list[str]:
    """The command in CC, or the machine's cc, gcc or clang. Raises BadInput without any."""
    chosen = shlex.split(os.environ.get("CC", ""))
    if chosen:
        return chosen
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    raise BadInput("No C compiler was found; install gcc or clang, or name one in CC.")


def execute(command: list[str], what: str) -> bytes:
    """Run a command that builds ``what``; gives its output, or BadInput with its first error."""
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError as error:
        raise BadInput(f"{command[0]} cannot be run: {error.strerror}.") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").splitlines()
        first = next((line for line in lines if "error" in line), lines[0] if lines else "")
        raise BadInput(f"{command[0]} failed while building {what}: {first}")
    return done.stdout


def build_directory() -> Path:
    """`fmu/build` in a checkout that may be written to, else a folder of the user's cache."""
    checkout = REPOSITORY / "fmu"
    if fmu_sources() == checkout and os.access(checkout, os.W_OK):
        return checkout / "build"
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "cosim" / "fmu"
