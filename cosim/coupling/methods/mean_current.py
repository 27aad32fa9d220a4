"""Mean current: as Gauss-Seidel, but the mechanics are fed the mean of the circuit's current.

The mean over the step carries its exact charge, so nothing that the circuit does between two
communication points is lost to the mechanics (exchange of integrals: Benedikt and Hofer,
"Guidelines for the application of a coupling method for non-iterative co-simulation", EUROSIM
2013). Order 1 with the back-EMF held, 2 with its slope or more. Known limits: those of
Gauss-Seidel.
"""

from functools import partial

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Polynomial


class MeanCurrent(Method):
    """The circuit goes first; the mechanics take its charge."""

    name = "mean-current"

    @property
    def order(self) -> int:
        return min(self.degree + 1, 2)

    def current(self, past: Past) -> Polynomial:
        return (past.mean,)


MeanCurrent.variants = {
    "held EMF, mean current": partial(MeanCurrent, 0),
    "EMF's slope, mean current": partial(MeanCurrent, 1),
}
