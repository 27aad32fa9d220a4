"""What the modules of a package declare, so that a new file is all that an addition takes."""

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any


def modules(package: str) -> list[ModuleType]:
    """The modules of ``package``, by name."""
    folder = import_module(package).__path__
    return [import_module(f"{package}.{found.name}") for found in iter_modules(folder)]


def declared(package: str, attribute: str) -> dict[str, Any]:
    """The objects called ``attribute`` in the modules of ``package``, by and in order of their
    ``name``. A module without one declares nothing."""
    found = (module for module in modules(package) if hasattr(module, attribute))
    objects = [getattr(module, attribute) for module in found]
    return {one.name: one for one in sorted(objects, key=lambda one: one.name)}
