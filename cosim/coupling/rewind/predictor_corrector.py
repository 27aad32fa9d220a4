"""Predictor-corrector: a Gauss-Seidel step with the slope, taken once more with the end it found.

The first try extrapolates the back-EMF with its slope; the second is given the line to the back-EMF
that the first ended with, and is kept: one turn of the iteration of
:mod:`cosim.coupling.rewind.iterated`, at a fixed cost of two tries. Order 2 where smooth. Known
limits: needs participants that can repeat a step, so ngspice cannot take part; conditionally
stable, like every method without iteration.
"""

import numpy as np

from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import History
from cosim.coupling.rewind.joint import Joint


class PredictorCorrector(Joint):
    """Joins two participants that can both repeat a step."""

    def __init__(self, first: Participant, second: Follower) -> None:
        self.order = 1
        super().__init__(first, second, History(1, False), History(1, True))

    def step(self, h: float) -> None:
        start = (self.first.save(), self.second.save())
        begin = self.of_second.value
        self.for_first = np.array([begin, self.of_second.slope])
        self._try(h)
        end = self.second.outputs()[0]
        self.first.restore(start[0])
        self.second.restore(start[1])
        self.for_first = np.array([begin, (end - begin) / h])
        self._try(h)
        self.time += h
        self.meet()

    def _try(self, h: float) -> None:
        self.first.advance(h, self.for_first)
        self.for_second = self.fed(h, 1)
        self.second.advance(h, self.for_second)
