"""How circuit and mechanics are solved together: one method a file, behind one protocol.

A method is told of each accepted step of the circuit and gives the back-EMF as a pure function of
time, so that a step that the circuit rejects needs nothing undone in the mechanics.
"""

from typing import Protocol


class Coupling(Protocol):
    """What the circuit knows of everything else."""

    def back_emf(self, time: float) -> float:
        """Back-EMF of the coil, V, at ``time`` (s), at or after the last accepted step."""
        ...

    def accepted(self, time: float, current: float) -> float:
        """The circuit has accepted a step to ``time`` (s), where one coil carries ``current`` (A).

        Returns the longest step that the circuit may try next, s.
        """
        ...
