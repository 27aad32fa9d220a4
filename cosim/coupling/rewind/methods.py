"""The fixed-step methods that the studies compare, by name."""

from collections.abc import Callable
from typing import Any

from cosim.coupling.rewind.companion import Companion
from cosim.coupling.rewind.gauss_seidel import GaussSeidel
from cosim.coupling.rewind.iterated import Iterated
from cosim.coupling.rewind.jacobi import Jacobi
from cosim.coupling.rewind.joint import Joint

METHODS: dict[str, Callable[[Any, Any], Joint]] = {
    "Jacobi k = 0": lambda a, b: Jacobi(a, b, 0),
    "Jacobi k = 1": lambda a, b: Jacobi(a, b, 1),
    "Jacobi k = 2": lambda a, b: Jacobi(a, b, 2),
    "Gauss-Seidel k = 0": lambda a, b: GaussSeidel(a, b, 0),
    "Gauss-Seidel k = 1": lambda a, b: GaussSeidel(a, b, 1),
    "Gauss-Seidel k = 2": lambda a, b: GaussSeidel(a, b, 2),
    "held EMF, mean current": lambda a, b: GaussSeidel(a, b, 0, "mean"),
    "EMF's slope, mean current": lambda a, b: GaussSeidel(a, b, 1, "mean", True),
    "EMF's slope, linear current": lambda a, b: GaussSeidel(a, b, 1, 1, True),
    "companion": Companion,
    "iterated, plain": lambda a, b: Iterated(a, b, "plain", tolerance=1e-9),
    "iterated, Newton": lambda a, b: Iterated(a, b, "newton", tolerance=1e-9),
}
"""Makers of a method between circuit and mechanics. ``EMF's slope, linear current`` is the default
method, step-locked, whose steps are otherwise those of ngspice."""

ORDERS = {
    "Jacobi k = 0": 1,
    "Jacobi k = 1": 2,
    "Jacobi k = 2": 3,
    "Gauss-Seidel k = 0": 1,
    "Gauss-Seidel k = 1": 2,
    "Gauss-Seidel k = 2": 3,
    "held EMF, mean current": 1,
    "EMF's slope, mean current": 2,
    "EMF's slope, linear current": 2,
    "companion": 2,
    "iterated, plain": 2,
    "iterated, Newton": 2,
}
"""Orders where nothing jumps."""
