"""What the modules of a package declare, so that a new file is all that an addition takes."""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any


def declared(package: str, attribute: str) -> dict[str, Any]:
    """The objects called ``attribute`` in the modules of ``package``, by and in order of their
    ``name``. A module without one declares nothing."""
    folder = import_module(package).__path__
    modules = [import_module(f"{package}.{found.name}") for found in iter_modules(folder)]
    objects = [getattr(module, attribute) for module in modules if hasattr(module, attribute)]
    return {one.name: one for one in sorted(objects, key=lambda one: one.name)}
