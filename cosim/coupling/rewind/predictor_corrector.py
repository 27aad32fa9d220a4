"""Predictor-corrector: a step-locked macro step, taken once more with the end that it found.

The first try extrapolates the back-EMF with its slope; the second is given the line to the back-EMF
that the first ended with, and is kept: one turn of the iteration of
:mod:`cosim.coupling.rewind.iterated`, at a fixed cost of two tries. Order 2 where smooth. Known
limits: needs participants that can repeat a step, so ngspice cannot take part; conditionally
stable, like every method without iteration.
"""

from cosim.coupling.rewind.iterated import Iterated


class PredictorCorrector(Iterated):
    """Joins two participants that can both repeat a step."""

    def step(self, h: float) -> None:
        start = (self.first.save(), self.second.save())
        end = self.past.emf.value + h * self.past.emf.slope
        for _ in range(2):
            end = self.attempt(h, start, end)
        self.time += h
        self.meet()
