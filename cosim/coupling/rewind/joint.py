"""Masters between two participants that can both go back to a moment before.

:class:`EventAware` ends a macro step at a stick-slip or impact event, and begins its extrapolation
anew. A step in which the second side has met an event is put back and repeated, shortened by
bisection, until it ends just behind the event. Where nothing jumps the method keeps its own order;
without this, events leave first order or less (measured 0.5 to 1.6 at stick-slip: extrapolating
across an event does harm). Handling of events by step localisation: Gomes et al., "Co-simulation:
a survey", ACM Comput. Surv. 51 (2018) 49, section on hybrid co-simulation. Known limits: ngspice
cannot take part, since it cannot repeat a step; costs some 20 repeated steps an event.

A side may be a linear system solved exactly, the FMU, or a behavioural circuit.
"""

from typing import Any, Protocol

import numpy as np

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Array, Polynomial, Signal


class Participant(Protocol):
    """One side of a coupling, at a time of its own; signals are arrays, SI."""

    mean: Array
    """Mean of the output over the last advance."""

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        """Go on by ``h`` (s) with an input polynomial about the present time.

        With ``gain`` the input is the polynomial plus ``gain`` times the integral of the own output
        since the start of the step: a capacitor 1/gain in series with a circuit whose output is its
        current.
        """
        ...

    def outputs(self, inputs: Signal | None = None) -> Signal:
        """Value and slope of the output now.

        With ``inputs`` they are *refreshed*: calculated after that input is set. Without, they are
        *stale*: those of the input that the last step ended with.
        """
        ...

    def save(self) -> Any:
        """Everything that ``restore`` needs to come back to this moment."""
        ...

    def restore(self, saved: Any) -> None:
        """Back to a saved moment."""
        ...


class Follower(Participant, Protocol):
    """The mechanical side, with what only some methods ask for."""

    def gain(self) -> float:
        """Derivative of the output's slope with respect to the input, now: Bl²/m_eff in V/(A s)."""
        ...

    def events(self) -> int:
        """Number of events (stick, slip, impact) so far."""
        ...


class Joint:
    """Takes macro steps of a method with a circuit (``first``) and mechanics (``second``)."""

    cuts = 0
    """Macro steps that were cut short so far."""

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
        self.advance(h, self.method.emf(past), gain)
        self.time += h
        self.meet()

    def advance(self, h: float, emf: Polynomial, gain: float = 0.0) -> None:
        """Both sides go on by ``h`` (s), the circuit with this back-EMF (V)."""
        self.for_first = np.array(emf)
        self.first.advance(h, self.for_first, gain)
        self.past.stepped(self.time + h, self.first.outputs()[0], self.first.mean)
        self.for_second = np.array(self.method.current(self.past))
        self.second.advance(h, self.for_second)

    def meet(self) -> None:
        """Exchange the outputs at a communication point.

        The second side answers to the first one's new output, and the first to that answer: where
        a side has direct feedthrough, an output not calculated anew is one of the step before.
        """
        answer = self.second.outputs(self.first.outputs())
        self.past.met(self.time, *self.first.outputs(answer), *answer)

    def save(self) -> Any:
        """Everything that ``restore`` needs to come back to this moment."""
        return (self.time, self.first.save(), self.second.save(), self.past.save())

    def restore(self, saved: Any) -> None:
        """Back to a saved moment."""
        self.time = saved[0]
        self.first.restore(saved[1])
        self.second.restore(saved[2])
        self.past.restore(saved[3])


class EventAware(Joint):
    """Cuts macro steps at the events of its second side, which it meets to ``within`` seconds."""

    within = 1e-8

    def step(self, h: float) -> None:
        """Go on by ``h`` seconds, in as many macro steps as there are events in it, and one."""
        end = self.time + h
        while (left := end - self.time) > 1e-12 * max(end, h):
            saved, count = self.save(), self.second.events()
            super().step(left)
            if self.second.events() == count:
                return
            # The step that ends before the first event, and the one that ends behind it.
            before, behind = 0.0, left
            while behind - before > self.within:
                middle = 0.5 * (before + behind)
                self.restore(saved)
                super().step(middle)
                if self.second.events() == count:
                    before = middle
                else:
                    behind = middle
            if left > self.within:
                self.restore(saved)
                super().step(behind)
            self.past.restart()
            self.cuts += 1
