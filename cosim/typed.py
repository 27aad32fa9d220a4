"""What a caller gives a function of the library is of the types that it declares, or is refused."""

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import wraps
from inspect import signature
from numbers import Real
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin

import numpy as np

from cosim.errors import BadInput

_F = TypeVar("_F", bound=Callable[..., Any])

_NO_LIST = str, bytes, np.ndarray
_KINDS: dict[Any, tuple[str, Callable[[Any], bool]]] = {
    float: ("a number", lambda x: isinstance(x, Real) and not isinstance(x, bool)),
    bool: ("True or False", lambda x: x in (0, 1)),
    str: ("a text", lambda x: isinstance(x, str) and "\0" not in x),
    os.PathLike: ("a path", lambda x: isinstance(x, os.PathLike)),
    Callable: ("a function", callable),
    Mapping: ("a mapping", lambda x: isinstance(x, Mapping)),
    Sequence: ("a list", lambda x: isinstance(x, Collection) and not isinstance(x, _NO_LIST)),
    NoneType: ("None", lambda x: x is None),
}
"""Words for types, and whether a value is of them."""


def typed(function: _F) -> _F:
    """The function, which refuses arguments of other types than it declares by BadInput. Scenes and
    whole numbers, whose range tells more, are left to the function itself."""
    declared = signature(function)

    @wraps(function)
    def called(*given: Any, **named: Any) -> Any:
        for name, value in declared.bind(*given, **named).arguments.items():
            kinds = _kinds(declared.parameters[name].annotation)
            if kinds and not any(_is(value, kind) for kind in kinds):
                from cosim.scene.messages import shown

                words = f"{name} = {shown(value)} must be {' or '.join(map(_words, kinds))}"
                raise BadInput(f"{function.__qualname__}: {words}.")
        return function(*given, **named)

    return cast(_F, called)


def _kinds(declared: Any) -> tuple[Any, ...]:
    """The types of a union, or the one; none where one of them is not known."""
    kinds = get_args(declared) if get_origin(declared) in (Union, UnionType) else (declared,)
    return kinds if all((get_origin(kind) or kind) in (Literal, *_KINDS) for kind in kinds) else ()


def _is(value: Any, kind: Any) -> bool:
    of, inner = get_origin(kind) or kind, get_args(kind)
    if of is Literal:
        return isinstance(value, str) and value in inner
    fits = getattr(value, "ndim", 0) == 0 and _KINDS[of][1](value)  # no array of NumPy
    each = inner[0] if fits and of is Sequence and _kinds(inner[0]) else None
    return fits and (each is None or all(_is(one, each) for one in value))


def _words(kind: Any) -> str:
    of, inner = get_origin(kind) or kind, get_args(kind)
    if of is Literal:
        return " or ".join(f'"{word}"' for word in inner)
    plural = {"a text": " of texts"}.get(_words(inner[0]), "") if of is Sequence and inner else ""
    return _KINDS[of][0] + plural if of in _KINDS else ""
