"""The master between two participants that can both go back to a moment before."""

from typing import Any

import numpy as np

from cosim.coupling.method import Method, Past
from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import Array


class Joint:
    """Takes macro steps of a method with a circuit (``first``) and mechanics (``second``)."""

    def __init__(self, first: Participant, second: Follower, method: Method) -> None:
        self.first, self.second, self.method = first, second, method
        self.time = 0.0
        """s since the two were joined."""
        self.past = Past(method)
        self.meet()
        self.for_first: Array = np.array([self.past.emf.value])
        """The input polynomial of the last step, about its start."""
        self.for_second: Array = np.array([self.past.current.value])

    def step(self, h: float) -> None:
        """One macro step of ``h`` seconds."""
        past, gain = self.past, 0.0
        if self.method.carries_inertia:
            past.gain = gain = self.second.gain()
            past.carried_slope = gain * past.current.value
        self.for_first = np.array(self.method.emf(past))
        self.first.advance(h, self.for_first, gain)
        past.stepped(self.time + h, self.first.outputs()[0], self.first.mean)
        self.for_second = np.array(self.method.current(past))
        self.second.advance(h, self.for_second)
        self.time += h
        self.meet()

    def meet(self) -> None:
        """Exchange the outputs at a communication point.

        The second side answers to the first one's new output, and the first to that answer: where
        a side has direct feedthrough, an output not calculated anew is one of the step before.
        """
        answer = self.second.outputs(self.first.outputs())
        self.past.met(self.time, *self.first.outputs(answer), *answer)

    def restart(self) -> None:
        """Forget what lies before an event."""
        self.past.restart()

    def save(self) -> Any:
        """Everything that ``restore`` needs to come back to this moment."""
        return (self.time, self.first.save(), self.second.save(), self.past.save())

    def restore(self, saved: Any) -> None:
        """Back to a saved moment."""
        self.time = saved[0]
        self.first.restore(saved[1])
        self.second.restore(saved[2])
        self.past.restore(saved[3])
