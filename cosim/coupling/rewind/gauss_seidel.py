"""Gauss-Seidel: the first side steps ahead, the second follows with what the first has done.

Order k + 1 with the first side's inputs extrapolated by polynomials of degree k (Busch 2016, as in
:mod:`cosim.coupling.rewind.jacobi`). What the second side is fed is a choice of its own: ``feed``
0, the value at the step's end; 1, linear between its ends; 2, the parabola through one point more;
``"mean"``, the mean over the step, which carries the exact charge. The feed limits the order to 1
for 0, and to 2 for 1 and ``"mean"``. Known limits: stable up to about twice Jacobi's step; nothing
restarts the extrapolation at an event.
"""

from typing import Literal

from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import History
from cosim.coupling.rewind.joint import Joint

Feed = Literal[0, 1, 2, "mean"]


class GaussSeidel(Joint):
    """Joins two participants; ``first`` goes first."""

    def __init__(
        self,
        first: Participant,
        second: Follower,
        order: int = 0,
        feed: Feed | None = None,
        slopes: bool = False,
        refreshed: bool = True,
    ) -> None:
        """As :class:`cosim.coupling.rewind.jacobi.Jacobi`; ``feed`` is ``order`` unless given."""
        self.order = order
        self._feed = order if feed is None else feed
        super().__init__(first, second, History(2, False), History(order, slopes), refreshed)

    def step(self, h: float) -> None:
        self.for_first = self.of_second.polynomial(self.time)
        self.first.advance(h, self.for_first)
        self.for_second = self.fed(h, self._feed)
        self.second.advance(h, self.for_second)
        self.time += h
        self.meet()
