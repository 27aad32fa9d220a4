"""Companion, or motional capacitor: the circuit carries the mechanics' local inertia itself.

To a circuit, a mass m on a coil is a capacitor m/Bl² (Beranek, "Acoustics", 1954, mobility
analogy). Over a macro step the circuit solves e(t) = e_n + (ė_n - g i_n)(t - t_n) + g ∫ i dt with
g = Bl²/m_eff from the FMU's directional derivative, so that m_eff follows stick, slip and contact;
only what springs, dampers and friction add is extrapolated. The mechanics then take the mean of the
current, which is its exact charge. It is the linearly implicit stabilisation of Arnold, "Stability
of sequential modular time integration methods for coupled multibody system models", J. Comput.
Nonlinear Dyn. 5 (2010) 031003, with the circuit's solver doing the implicit part.

Order 2 where smooth. Known limits: unlike an extrapolated current force, the inertia no longer
limits the macro step; what is left does, as do stiff springs or dampers of the mechanics where they
couple back; an event within the step is noticed at its end.
"""

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Polynomial


class Companion(Method):
    """The mechanics' inertia is a capacitor of the circuit."""

    name = "companion"
    carries_inertia = True

    @property
    def order(self) -> int:
        return 2

    def emf(self, past: Past) -> Polynomial:
        return (past.emf.value - past.carried, past.emf.slope - past.carried_slope)

    def current(self, past: Past) -> Polynomial:
        return (past.mean,)


Companion.variants = {"companion": Companion}
