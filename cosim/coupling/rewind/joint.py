"""What all methods with macro steps share: the two sides, and what they have exchanged."""

from typing import Any

import numpy as np

from cosim.coupling.participant import Follower, Participant
from cosim.coupling.polynomials import Array, History


class Joint:
    """Two participants at one time, with the histories of their outputs.

    ``for_first`` and ``for_second`` are the input polynomials of the last step, about its start.
    """

    def __init__(
        self,
        first: Participant,
        second: Follower,
        of_first: History,
        of_second: History,
        refreshed: bool = True,
    ) -> None:
        self.first, self.second = first, second
        self.of_first, self.of_second = of_first, of_second
        self.time = 0.0
        """s since the two were joined."""
        self._refreshed = refreshed
        self.meet()
        self.for_first: Array = np.array([self.of_second.value])
        self.for_second: Array = np.array([self.of_first.value])

    def step(self, h: float) -> None:
        """One macro step of ``h`` seconds."""
        raise NotImplementedError

    def meet(self) -> None:
        """Exchange the outputs at a communication point.

        Refreshed, the second side answers to the first one's new output, and then the first to
        that; stale, each gives what it has with the input that its last step ended with. The order
        decides: where a side has direct feedthrough, a stale output is one of the step before.
        """
        given = self.first.outputs()
        answer = self.second.outputs(given if self._refreshed else None)
        if self._refreshed:
            given = self.first.outputs(answer)
        self.of_first.add(self.time, *given)
        self.of_second.add(self.time, *answer)

    def fed(self, h: float, feed: Any) -> Array:
        """What the second side takes of the first one's step over ``h`` s that was just taken:
        the mean, or a polynomial of degree ``feed`` through its end and older points."""
        if feed == "mean":
            return np.array([self.first.mean])
        known = self.of_first.save()
        self.of_first.add(self.time + h, *self.first.outputs())
        polynomial = self.of_first.polynomial(self.time, feed)
        self.of_first.restore(known)
        return polynomial

    def restart(self) -> None:
        """Forget what lies before an event."""
        self.of_first.restart()
        self.of_second.restart()

    def save(self) -> Any:
        """Everything that ``restore`` needs to come back to this moment."""
        return (
            self.time,
            self.first.save(),
            self.second.save(),
            self.of_first.save(),
            self.of_second.save(),
        )

    def restore(self, saved: Any) -> None:
        """Back to a saved moment."""
        self.time = saved[0]
        self.first.restore(saved[1])
        self.second.restore(saved[2])
        self.of_first.restore(saved[3])
        self.of_second.restore(saved[4])
