"""Searches of the unit cube: a design that fills what is feasible, and CMA-ES from the best of what
is known, again and again.

The objective of a study jumps where a mode of motion ends, is ragged where motion is chaotic, and
is missing where a scene cannot be run: no method that trusts a slope finds its way there. Its
heights are narrow ridges aslant to the keys, which the covariance of CMA-ES learns.

N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772 (2016), by the package cmaes.
"""

from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.known import Feasible, apart

if TYPE_CHECKING:
    from cmaes import CMA

SCREENED = 64
"""Batches of the sequence that are screened, at most."""

POPULATION = 10
"""Points of a generation."""

NARROW = 5e-3
"""Standard deviation at which a climb ends."""

APART = 0.1
"""How far the start of a climb is from those of all before it, as the greatest difference."""


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


class Climb:
    """Climbs in ``keys`` dimensions, each from the best point that is ``APART`` from where those
    before it began, with ``step`` as its first standard deviation, until that is ``NARROW``, both
    of the cube's edge. It is to be told of a point before it is asked for any."""

    def __init__(self, keys: int, seed: int | list[int], step: float = 0.06) -> None:
        self._keys, self._step = keys, step
        self._random = np.random.default_rng(seed)
        self._points, self._scores = np.empty((0, keys)), np.empty(0)
        self._starts = np.empty((0, keys))
        self._climb: CMA | None = None
        self._asked = np.empty((0, keys))

    def ask(self) -> Array:
        """The next generation (rows)."""
        if self._climb is None or self._climb._sigma < NARROW:
            self._climb = self._next()
        self._asked = np.array([self._climb.ask() for _ in range(POPULATION)])
        return self._asked[:, : self._keys]

    def tell(self, points: Array, scores: Array, feasible: Feasible) -> None:
        """The scores of points (rows), asked for or not."""
        scores = np.where(feasible, scores, -inf)
        self._points = np.vstack([self._points, points])
        self._scores = np.concatenate([self._scores, scores])
        if self._climb and np.array_equal(points, self._asked[:, : self._keys]):
            self._climb.tell([*zip(self._asked, (-scores).tolist(), strict=True)])

    def _next(self) -> "CMA":
        """A climb from the best point that is apart from where all others began."""
        from cmaes import CMA

        every = np.vstack([self._starts, self._points[np.argsort(-self._scores, kind="stable")]])
        self._starts = every[apart(every, APART, len(self._starts) + 1)]
        # The package asks for two dimensions at least: scores do not depend on the second one.
        spare = max(2 - self._keys, 0)
        return CMA(
            mean=np.clip([*self._starts[-1], *[0.5] * spare], 1e-3, 1.0 - 1e-3),
            sigma=self._step,
            bounds=np.tile([0.0, 1.0], (self._keys + spare, 1)),
            population_size=POPULATION,
            seed=int(self._random.integers(1 << 31)),
        )
