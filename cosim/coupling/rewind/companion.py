"""Motional capacitor: the circuit carries the mechanics' local inertia itself.

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

from typing import Literal

import numpy as np

from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import History
from cosim.coupling.rewind.joint import Joint


class Companion(Joint):
    """Joins a circuit (first, output: current) and mechanics (second, output: back-EMF)."""

    def __init__(
        self, first: Participant, second: Follower, feed: Literal[1, "mean"] = "mean"
    ) -> None:
        """``feed``: what the mechanics take, as in :mod:`cosim.coupling.rewind.gauss_seidel`."""
        self.order = 1
        self._feed = feed
        super().__init__(first, second, History(1, False), History(1, True))

    def step(self, h: float) -> None:
        gain = self.second.gain()
        emf, slope, current = self.of_second.value, self.of_second.slope, self.of_first.value
        self.for_first = np.array([emf, slope - gain * current])
        self.first.advance(h, self.for_first, gain)
        self.for_second = self.fed(h, self._feed)
        self.second.advance(h, self.for_second)
        self.time += h
        self.meet()
