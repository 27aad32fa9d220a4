"""What every search of the unit cube does: it asks for points and is told how they did."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cosim.arrays import Array

Feasible = NDArray[np.bool_]
"""Of points (rows): whether they are allowed."""


class Search(Protocol):
    """A search for the largest score. The same for the same seed and scores."""

    def ask(self) -> Array:
        """The next points (rows) of the unit cube; none where the search has ended."""
        ...

    def tell(self, points: Array, scores: Array, feasible: Feasible) -> None:
        """The scores of points (rows), asked for or not; -inf where there is none."""
        ...


def apart(points: Array, distance: float, count: int) -> list[int]:
    """The first of ``points`` (rows), and those after it that are ``distance`` from all before them
    that count, as the greatest difference: ``count`` numbers of rows at most, all for -1."""
    kept: list[int] = []
    left = np.ones(len(points), bool)
    while left.any() and len(kept) != count:
        kept.append(int(left.argmax()))
        left &= np.abs(points - points[kept[-1]]).max(axis=1) >= distance
    return kept


Evaluate = Callable[[Array], tuple[Array, Feasible]]
"""The scores (a row for each point, a column for each quantity) of points (rows) that are to be
run, and which of these are feasible."""
