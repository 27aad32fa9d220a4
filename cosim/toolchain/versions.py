"""What made a result: the versions of Python and of the packages that compute."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from cosim.version import __version__


def versions() -> dict[str, str]:
    """The version of each by its name."""
    own = {"python": platform.python_version(), "cosim": __version__}
    return own | {name: _version(name) for name in ("fmpy", "PySpice", "numpy")}


@cache  # a look-up of all takes longer than a short run of the part alone
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
