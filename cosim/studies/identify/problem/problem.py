"""What an identification is of: numbers that all trials share, and numbers of each trial alone."""

from typing import Protocol

from cosim.arrays import Array


class Box(Protocol):
    """Numbers that are sought: their names, in the order in which a row holds them."""

    @property
    def names(self) -> list[str]: ...


class Problem(Protocol):
    """A model of several trials: the rig with its drives, or the friction of the part alone.

    Half the sum of the squared residuals of all trials, each over its own deviation, is the
    negative log-likelihood but for a constant.
    """

    @property
    def shared(self) -> Box:
        """Numbers that belong to all trials."""
        ...

    @property
    def own(self) -> Box:
        """Nuisance parameters: each trial has its own."""
        ...

    def residuals(self, trial: int, shared: Array, own: Array) -> Array:
        """Of trial number ``trial``, with values of the shared and of its own numbers."""
        ...
