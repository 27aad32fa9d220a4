"""Searches of the unit cube: a design that fills its feasible part, and CMA-ES restarted from the
best known points.

The objective of a study jumps where a mode of motion ends, is ragged where motion is chaotic, and
is undefined where a scene cannot be run: methods that need a gradient fail. Its maxima are narrow
ridges oblique to the keys, which the covariance of CMA-ES learns.

N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772 (2016), by the package cmaes.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.known import Feasible, apart
from cosim.toolchain.interrupts import deferred

if TYPE_CHECKING:
    from cmaes import CMA

SCREENED = 64
"""Most batches of the Sobol sequence that are drawn; infeasible regions may discard all of one."""

POPULATION = 10
"""Points of a generation."""

NARROW = 5e-3
"""Standard deviation at which a climb ends."""

APART = 0.1
"""Least distance (largest difference of a coordinate) of a climb's start from all earlier ones."""


class Design:
    """A Sobol sequence of ``count`` points. The first quarter fills the cube; of later points only
    those whose nearest known point is feasible are asked for.

    ``ends`` makes points denser near the ends of each key's range, by the arcsine distribution.
    """

    def __init__(self, keys: int, count: int, seed: int | list[int], ends: bool = False) -> None:
        from scipy.stats import qmc

        with deferred():  # the first reads a table, and would keep half of one
            self._sequence = qmc.Sobol(keys, rng=np.random.default_rng(seed))
        self._count, self._ends = count, ends
        # A Sobol sequence is balanced in batches whose size is a power of two.
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
        """Take which points (rows) are feasible; they count towards ``count``."""
        self._points = np.vstack([self._points, points])
        self._feasible = np.concatenate([self._feasible, feasible])


class Climb:
    """A sequence of climbs by CMA-ES in ``keys`` dimensions. Each starts from the best known point
    that is APART from all earlier starts, with the standard deviation ``step``, and ends when that
    falls below NARROW (both in edges of the cube). ``tell`` must be called before ``ask``."""

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
        """Take the scores of points (rows), whether asked for or not; those of a generation that
        was asked for also update CMA-ES."""
        self._points = np.vstack([self._points, points])
        self._scores = np.concatenate([self._scores, scores])
        if self._climb and np.array_equal(points, self._asked[:, : self._keys]):
            self._climb.tell([*zip(self._asked, (-scores).tolist(), strict=True)])

    def _next(self) -> "CMA":
        """A climb from the best known point that is APART from all earlier starts."""
        from cmaes import CMA

        # Earlier starts come first, so ``apart`` chooses all of them and one new point behind.
        ranked = np.vstack([self._starts, self._points[np.argsort(-self._scores, kind="stable")]])
        self._starts = ranked[apart(ranked, APART, len(self._starts) + 1)]
        # The package needs two dimensions at least: a spare one has no effect on the scores.
        spare = max(2 - self._keys, 0)
        return CMA(
            mean=np.clip([*self._starts[-1], *[0.5] * spare], 1e-3, 1.0 - 1e-3),
            sigma=self._step,
            bounds=np.tile([0.0, 1.0], (self._keys + spare, 1)),
            population_size=POPULATION,
            seed=int(self._random.integers(1 << 31)),
        )
