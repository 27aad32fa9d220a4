"""The coupling methods: each value of ``coupling.method``, declared once.

What a method computes is in ``cosim/coupling``.
"""

from collections.abc import Set
from dataclasses import dataclass


@dataclass(frozen=True)
class CouplingMethod:
    """One value of ``coupling.method``."""

    name: str
    text: str
    keys: Set[str] = frozenset()
    """The keys of ``[coupling]`` that act, besides ``method``."""
    chooses: Set[str] = frozenset()
    """The keys of ``[circuit]`` that the method chooses itself."""


_STEP = {"macro_step"}
_SHAPE = _STEP | {"order"}

_ALL = (
    CouplingMethod("step-locked", "mechanics follow each accepted step of ngspice"),
    CouplingMethod("jacobi", "macro steps, both sides extrapolated", _SHAPE),
    CouplingMethod("gauss-seidel", "macro steps, mechanics take the current as a line", _SHAPE),
    CouplingMethod("mean-current", "macro steps, mechanics take the mean current", _SHAPE),
    CouplingMethod("companion", "macro steps, circuit carries the inertia of the mechanics", _STEP),
    CouplingMethod("macro-steps", "explicit macro steps of the scene's own FMUs", _STEP),
    CouplingMethod("redo", "own FMUs and ngspice repeat each step until they agree"),
    CouplingMethod(
        "auto",
        "cheapest method and steps of ngspice within coupling.tolerance",
        {"tolerance"},
        chooses={"reltol", "max_step"},
    ),
)

OF_PORTS = ("auto", "step-locked", "macro-steps", "redo")
"""Those for a scene with its own ports; of them the last two are for no other."""

METHODS = {method.name: method for method in _ALL}
"""Every method by its name; the order is that in which messages list them."""
