"""The coupling methods, one a file; a file in this folder is a method."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from cosim.coupling.method import Method


@cache
def methods() -> dict[str, type[Method]]:
    """Each method by its name, as ``coupling.method`` has it."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    return {kind.name: kind for kind in _kinds(Method)}


def _kinds(base: type[Method]) -> list[type[Method]]:
    return [found for kind in base.__subclasses__() for found in (kind, *_kinds(kind))]
