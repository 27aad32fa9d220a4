"""Jacobi: both sides take a macro step at once, each with what was known of the other before.

Order k + 1 with inputs extrapolated by polynomials of degree k (Busch, "Continuous approximation
techniques for co-simulation methods", ZAMM 96 (2016) 1061; Kübler and Schiehlen, "Two methods of
simulator coupling", Math. Comp. Model. Dyn. Syst. 6 (2000) 93). Known limits: stable only up to a
macro step of about m R/Bl² for a ram on a voltage-driven coil, less with higher k; nothing restarts
the extrapolation at an event (see :mod:`cosim.coupling.rewind.event_aware`).
"""

from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import History
from cosim.coupling.rewind.joint import Joint


class Jacobi(Joint):
    """Joins two participants; they could step in parallel."""

    def __init__(
        self,
        first: Participant,
        second: Follower,
        order: int = 0,
        slopes: bool = False,
        refreshed: bool = True,
    ) -> None:
        """``order`` 0, 1 or 2 of the extrapolation; with ``slopes`` it uses the outputs' true
        slopes instead of values one step older. ``refreshed``: see :meth:`Joint.meet`.
        """
        self.order = order
        super().__init__(first, second, History(order, slopes), History(order, slopes), refreshed)

    def step(self, h: float) -> None:
        self.for_first = self.of_second.polynomial(self.time)
        self.for_second = self.of_first.polynomial(self.time)
        self.first.advance(h, self.for_first)
        self.second.advance(h, self.for_second)
        self.time += h
        self.meet()
