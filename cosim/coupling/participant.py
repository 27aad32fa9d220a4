"""What a coupling method knows of each of the two sides that it joins.

A method is written once against this; the sides may be linear systems solved exactly, the FMU, or
a behavioural circuit. ngspice is none of them: it leads, and cannot repeat what it has accepted.
"""

from typing import Any, Protocol

from cosim.coupling.polynomials import Array, Signal


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
