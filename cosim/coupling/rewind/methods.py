"""The methods between participants that can go back, as the studies compare them, by name."""

from collections.abc import Callable
from typing import Any

from cosim.coupling.method import Method
from cosim.coupling.methods import methods
from cosim.coupling.rewind.iterated import Iterated
from cosim.coupling.rewind.joint import Joint

Make = Callable[[Any, Any], Joint]


def _joint(make: Callable[[], Method]) -> Make:
    return lambda first, second: Joint(first, second, make())


_VARIANTS = {name: make for kind in methods().values() for name, make in kind.variants.items()}

METHODS: dict[str, Make] = {name: _joint(make) for name, make in _VARIANTS.items()} | {
    "iterated, plain": lambda a, b: Iterated(a, b, "plain", tolerance=1e-9),
    "iterated, Newton": lambda a, b: Iterated(a, b, "newton", tolerance=1e-9),
}
"""Makers of a method between circuit and mechanics."""

ORDERS = {name: make().order for name, make in _VARIANTS.items()} | {
    "iterated, plain": 2,
    "iterated, Newton": 2,
}
"""Orders where nothing jumps."""
