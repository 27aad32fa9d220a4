"""Iterated (implicit): a macro step is repeated until both sides agree on the values at its end.

Both participants return to the step's start each time. The circuit's back-EMF is linear over the
step, from its known start to an unknown end x; the mechanics are fed the current as the line
between its two ends, and give a new x. The fixed point in x is found by: ``"plain"`` iteration;
``"Aitken"`` (Küttler and Wall, "Fixed-point fluid-structure interaction solvers with dynamic
relaxation", Comput. Mech. 43 (2008) 61); ``"Anderson"`` (Walker and Ni, SIAM J. Numer. Anal. 49
(2011) 1715); ``"Newton"`` with the interface's Jacobian, by differences (Busch and Schweizer,
ECCOMAS Multibody Dynamics 2011).

Order 2 where smooth. Known limits: needs participants that can repeat a step, so ngspice cannot
take part; plain iteration converges only up to about the macro step at which Gauss-Seidel is stable
(about twice Jacobi's); the accelerated iterations have no such limit.

:class:`PredictorCorrector` repeats a macro step once, with the end of the first try: one plain
iteration at the fixed cost of two tries, conditionally stable like every method without iteration.

:func:`variants` are all methods between participants that can repeat a step, for the studies.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np

from cosim.coupling.methods import methods
from cosim.coupling.methods.gauss_seidel import GaussSeidel
from cosim.coupling.polynomials import Array
from cosim.coupling.rewind.joint import EventAware, Follower, Joint, Participant
from cosim.errors import SimulationFailed

Acceleration = Literal["plain", "Aitken", "Anderson", "Newton"]
_DEPTH = 3  # differences of former iterates that Anderson's method combines
_MOST_TRIES = 60  # iterations in one macro step


class Iterated(Joint):
    """Joins two participants that can both repeat a step."""

    def __init__(
        self,
        first: Participant,
        second: Follower,
        acceleration: Acceleration = "Newton",
        tolerance: float = 1e-10,
    ) -> None:
        """``tolerance`` is relative to the largest back-EMF so far."""
        self._acceleration = acceleration
        self._tolerance = tolerance
        self._size = 0.0
        super().__init__(first, second, GaussSeidel())

    def step(self, h: float) -> None:
        start = (self.first.save(), self.second.save())
        emf = self.past.emf
        self.solve(lambda end: self._answer(h, start, end), emf.value + h * emf.slope)
        self.time += h
        self.meet()

    def _answer(self, h: float, start: tuple[Any, Any], end: Array) -> Array:
        """The mechanics' back-EMF at the step's end, if the circuit assumed ``end`` there, V."""
        self.first.restore(start[0])
        self.second.restore(start[1])
        begin = self.past.emf.value
        self.advance(h, (begin, (end - begin) / h))
        return self.second.outputs()[0]

    def solve(self, answer: Callable[[Array], Array], x: Array) -> None:
        """Find the fixed point of ``answer`` from ``x`` on. Both sides stay where the last call of
        ``answer`` has left them."""
        guesses: list[Array] = []
        residuals: list[Array] = []
        relaxation, jacobian = 1.0, None
        for _ in range(_MOST_TRIES):
            with np.errstate(all="ignore"):
                residual = answer(x) - x
            off = float(np.abs(residual).max())
            self._size = max(self._size, float(np.abs(x).max()))
            if off <= self._tolerance * self._size + 1e-300:
                return
            if not np.isfinite(off) or off > 1e30:
                break
            guesses.append(x)
            residuals.append(residual)
            if self._acceleration == "Newton":
                if jacobian is None:
                    jacobian = _jacobian(answer, x, residual, off)
                x = x - np.linalg.solve(jacobian, residual)
            elif self._acceleration == "Aitken" and len(residuals) > 1:
                change = residuals[-1] - residuals[-2]
                relaxation *= -float(np.sum(residuals[-2] * change) / np.sum(change * change))
                x = x + relaxation * residual
            elif self._acceleration == "Anderson" and len(residuals) > 1:
                x = _mixed(guesses[-_DEPTH - 1 :], residuals[-_DEPTH - 1 :])
            else:
                x = x + residual
        raise SimulationFailed(
            f"The iteration of the coupling did not converge at t = {self.time:.6g} s; try a "
            "smaller macro step or another acceleration."
        )


class PredictorCorrector(Iterated):
    """The first try extrapolates the back-EMF with its slope; the second assumes its end."""

    def solve(self, answer: Callable[[Array], Array], x: Array) -> None:
        answer(answer(x))


def _jacobian(answer: Callable[[Array], Array], x: Array, residual: Array, off: float) -> Array:
    """The Jacobian (n × n) of the residual by the unknown end ``x`` (n, or n × columns), by finite
    differences of size ``off``; averaged over columns, since they share one linear system."""
    n = len(x)
    jacobian = np.empty((n, n))
    for k in range(n):
        moved = x.copy()
        moved[k] = moved[k] + off
        change = (answer(moved) - moved - residual) / off
        jacobian[:, k] = change.reshape(n, -1).mean(axis=1)
    return jacobian


def _mixed(guesses: list[Array], residuals: list[Array]) -> Array:
    """Anderson's next guess: the combination of guesses with the least residual, plus this."""
    # Values × differences of successive iterates.
    steps = np.array([(b - a).ravel() for a, b in pairwise(guesses)]).T
    changes = np.array([(b - a).ravel() for a, b in pairwise(residuals)]).T
    weights, *_ = np.linalg.lstsq(changes, residuals[-1].ravel(), rcond=1e-12)
    moved = (steps + changes) @ weights
    return guesses[-1] + residuals[-1] - moved.reshape(guesses[-1].shape)


@dataclass(frozen=True)
class Variant:
    """``make`` joins circuit and mechanics; ``order`` is the order of convergence where smooth."""

    make: Callable[[Any, Any], Joint]
    order: int


def variants(tolerance: float = 1e-9) -> dict[str, Variant]:
    """All variants by name; ``tolerance`` is the relative one of iterated methods."""
    found: dict[str, Variant] = {}
    for kind in methods().values():
        for name, method in kind.variants.items():
            found[name] = Variant(lambda a, b, make=method: Joint(a, b, make()), method().order)
    locked = methods()["step-locked"]
    cut = Variant(lambda a, b: EventAware(a, b, locked()), locked().order)
    found |= {"event-aware": cut, "predictor-corrector": Variant(PredictorCorrector, 2)}
    for acceleration in get_args(Acceleration):
        make = partial(Iterated, acceleration=acceleration, tolerance=tolerance)
        found[f"iterated, {acceleration}"] = Variant(make, 2)
    return found
