"""Jacobi: both sides take a macro step at once, each with what was known of the other before.

Order k + 1 with inputs extrapolated by polynomials of degree k (Busch, "Continuous approximation
techniques for co-simulation methods", ZAMM 96 (2016) 1061; Kübler and Schiehlen, "Two methods of
simulator coupling", Math. Comp. Model. Dyn. Syst. 6 (2000) 93). Known limits: stable only up to a
macro step of about m R/Bl² for a ram on a voltage-driven coil, less with higher k; nothing restarts
the extrapolation at an event (see :class:`cosim.coupling.rewind.joint.EventAware`).
"""

from functools import partial

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Polynomial


class Jacobi(Method):
    """Both sides could step in parallel."""

    name = "jacobi"

    @property
    def order(self) -> int:
        return self.degree + 1

    def current(self, past: Past) -> Polynomial:
        return past.current.polynomial(self.degree)


Jacobi.variants = {f"Jacobi k = {k}": partial(Jacobi, k, slopes=False) for k in range(3)}
