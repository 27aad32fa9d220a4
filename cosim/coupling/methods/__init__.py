"""The coupling methods, one a file; a file in this folder is a method."""

from functools import cache

from cosim.coupling.method import Method
from cosim.files.declared import modules


@cache
def methods() -> dict[str, type[Method]]:
    """Each method by its name, as ``coupling.method`` has it."""
    modules(__name__)
    return {kind.name: kind for kind in _kinds(Method)}


def _kinds(base: type[Method]) -> list[type[Method]]:
    return [found for kind in base.__subclasses__() for found in (kind, *_kinds(kind))]
