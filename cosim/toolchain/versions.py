"""What made a result: the versions of Python and of the packages that compute."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """The version of each by its name."""
    packages = ("cosim", "fmpy", "PySpice", "numpy")
    return {"python": platform.python_version()} | {name: _version(name) for name in packages}


@cache  # a look-up of all takes longer than a short run of the part alone
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
