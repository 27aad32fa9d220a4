"""What made a result: the versions of Python and of the packages that compute."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """What made the result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    # Looked up once: it takes longer than a short run of the part alone.
    found = {"python": platform.python_version()}
    for package in ("cosim", "fmpy", "PySpice", "numpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found
