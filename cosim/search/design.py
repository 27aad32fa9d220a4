"""Points that fill what is feasible of the unit cube."""

import numpy as np
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.known import Feasible

SCREENED = 64
"""Batches of the sequence that are screened, at most."""


class Design:
    """A Sobol sequence of ``count`` points. A quarter of them fills the cube; of those after it
    only such count whose nearest point that is known is feasible.

    ``ends`` makes them dense where a key is near an end of its range, by the arcsine law.
    """

    def __init__(self, keys: int, count: int, seed: int | list[int], ends: bool = False) -> None:
        from scipy.stats import qmc

        self._sequence = qmc.Sobol(keys, rng=np.random.default_rng(seed))
        self._count, self._ends = count, ends
        # A Sobol sequence is even over powers of two.
        self._batch = 1 << (max(count // 4, 1).bit_length() - 1)
        self._batches = SCREENED
        self._points, self._feasible = np.empty((0, keys)), np.empty(0, bool)

    def ask(self) -> Array:
        """The next points (rows); none where all were asked for."""
        left = self._count - len(self._points)
        while left > 0 and self._batches:
            self._batches -= 1
            points = self._sequence.random(self._batch)
            if self._ends:
                points = np.sin(0.5 * np.pi * points) ** 2
            if self._feasible.any():
                points = points[self._feasible[KDTree(self._points).query(points)[1]]]
            if len(points):
                return points[:left]
        return self._points[:0]

    def tell(self, points: Array, scores: Array, feasible: Feasible) -> None:
        """Which points (rows) are feasible; they count among the design's own."""
        self._points = np.vstack([self._points, points])
        self._feasible = np.concatenate([self._feasible, feasible])
