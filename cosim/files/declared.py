"""Finds the modules of a package, so that a new file alone registers an addition."""

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def modules(package: str) -> list[ModuleType]:
    """The modules of ``package``, by name."""
    folder = import_module(package).__path__
    return [import_module(f"{package}.{found.name}") for found in iter_modules(folder)]
