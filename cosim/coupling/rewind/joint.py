"""Masters between two participants that can both go back to a saved state.

:class:`EventAware` ends a macro step at a stick-slip or impact event and restarts the
extrapolation there. A step in which the mechanics met an event is undone and repeated, shortened by
bisection, until it ends just behind the event. So the method keeps its order across events; without
this the order falls to one or less (measured 0.5 to 1.6 at stick-slip), since extrapolating across
an event is wrong. Handling of events by step localisation: Gomes et al., "Co-simulation: a survey",
ACM Comput. Surv. 51 (2018) 49, section on hybrid co-simulation. Known limits: ngspice cannot take
part, since it cannot repeat a step; an event costs some 20 repeated steps.

A side may be a linear system solved exactly, the FMU, or a behavioural circuit.
"""

from typing import Any, Protocol

import numpy as np

from cosim.coupling.method import Method, Past
from cosim.coupling.polynomials import Array, Polynomial, Signal


class Participant(Protocol):
    """One side of a coupling, with its own present time; signals are arrays, SI."""

    mean: Array
    """Mean of the output over the last advance."""

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        """Advance by ``h`` (s) with an input polynomial whose origin is the present time.

        With ``gain`` the input is the polynomial plus ``gain`` times the integral of the own output
        since the start of the step: a capacitor 1/gain in series with a circuit whose output is its
        current.
        """
        ...

    def outputs(self, inputs: Signal | None = None) -> Signal:
        """Value and slope of the output now.

        With ``inputs`` (value and slope) they are *refreshed*: calculated for this input. Without,
        they are *stale*: those for the input at the end of the last step.
        """
        ...

    def save(self) -> Any:
        """Everything that ``restore`` needs to come back to this moment."""
        ...

    def restore(self, saved: Any) -> None:
        """Back to a saved moment."""
        ...


class Follower(Participant, Protocol):
    """The mechanical side, with two functions that only some methods need."""

    def gain(self) -> float:
        """Derivative of the output's slope with respect to the input, now: Bl²/m_eff in V/(A s)."""
        ...

    def events(self) -> int:
        """Number of events (stick, slip, impact) so far."""
        ...


class Joint:
    """Takes macro steps of a method with a circuit (``first``) and mechanics (``second``)."""

    cuts = 0
    """Number of macro steps that were cut short at an event so far."""

    def __init__(self, first: Participant, second: Follower, method: Method) -> None:
        self.first, self.second, self.method = first, second, method
        self.time = 0.0
        """s since the two were joined."""
        self.past = Past(method)
        self.meet()
        self.for_first: Array = np.array([self.past.emf.value])
        """The input polynomial of the circuit in the last step, with its origin at the start."""
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
        """Advance the circuit by ``h`` (s) with this back-EMF (V), then the mechanics."""
        self.for_first = np.array(emf)
        self.first.advance(h, self.for_first, gain)
        self.past.stepped(self.time + h, self.first.outputs()[0], self.first.mean)
        self.for_second = np.array(self.method.current(self.past))
        self.second.advance(h, self.for_second)

    def meet(self) -> None:
        """Exchange the outputs at a communication point.

        The mechanics' output is refreshed with the circuit's, then the circuit's with that of the
        mechanics: with direct feedthrough a stale output would belong to the input before.
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
    """Cuts macro steps at the mechanics' events, which it locates to ``within`` seconds."""

    within = 1e-8

    def step(self, h: float) -> None:
        """Advance by ``h`` seconds, in one macro step more than there are events in them."""
        end = self.time + h
        while (left := end - self.time) > 1e-12 * max(end, h):
            saved, count = self.save(), self.second.events()
            super().step(left)
            if self.second.events() == count:
                return
            # Bisection between a step length without an event and one with at least one.
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
