"""The coupling methods: each value of ``coupling.method``, declared once.

What a method computes is in ``cosim/coupling``.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class CouplingMethod:
    """One value of ``coupling.method``."""

    name: str
    text: str
    keys: frozenset[str] = frozenset()
    """The keys of ``[coupling]`` that act, besides ``method``."""
    chooses: frozenset[str] = frozenset()
    """The keys of ``[circuit]`` that the method chooses itself."""


_STEP, _ORDER = "macro_step", "order"

METHODS: dict[str, CouplingMethod] = {
    method.name: method
    for method in (
        CouplingMethod("step-locked", "mechanics follow each accepted step of ngspice"),
        CouplingMethod(
            "jacobi",
            "macro steps, both sides extrapolated",
            frozenset({_STEP, _ORDER}),
        ),
        CouplingMethod(
            "gauss-seidel",
            "macro steps, mechanics take the circuit's current as a line",
            frozenset({_STEP, _ORDER}),
        ),
        CouplingMethod(
            "mean-current",
            "macro steps, mechanics take the circuit's mean current",
            frozenset({_STEP, _ORDER}),
        ),
        CouplingMethod(
            "companion",
            "macro steps, circuit carries the inertia of the mechanics",
            frozenset({_STEP}),
        ),
        CouplingMethod(
            "auto",
            "cheapest method and steps of ngspice within coupling.tolerance",
            frozenset({"tolerance"}),
            chooses=frozenset({"reltol", "max_step"}),
        ),
    )
}
"""Every method by its name; the order is that in which messages list them."""
