"""Gauss-Seidel: the circuit steps ahead, the mechanics follow with what it has done.

Order k + 1 with the back-EMF extrapolated by polynomials of degree k (Busch 2016, as in
:mod:`cosim.coupling.methods.jacobi`). The current that the mechanics are fed is a polynomial of
the same degree that ends with the circuit's step: 0, the value there; 1, linear between its ends;
2, the parabola through one point more. Known limits: stable up to about twice Jacobi's step;
nothing restarts the extrapolation at an event.
"""

from functools import partial

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Polynomial


class GaussSeidel(Method):
    """The circuit goes first."""

    name = "gauss-seidel"

    @property
    def order(self) -> int:
        return self.degree + 1

    def current(self, past: Past) -> Polynomial:
        return past.current.polynomial_to(past.h, past.end, self.degree)


GaussSeidel.variants = {
    f"Gauss-Seidel k = {k}": partial(GaussSeidel, k, slopes=False) for k in range(3)
}
