"""A search of the unit cube that asks for points and is told their costs: a design of the whole
cube, then CMA-ES from the best of what is known, again and again.

The objective of a study jumps where a mode of motion ends, is ragged where motion is chaotic, and
is missing where a scene cannot be run: no method that trusts a slope finds its way there. Its
heights are narrow ridges aslant to the keys, which the covariance of CMA-ES learns.

N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772 (2016), as the package cmaes
has it.
"""

from typing import TYPE_CHECKING

import numpy as np

from cosim.arrays import Array

if TYPE_CHECKING:
    from cmaes import CMA

POPULATION = 10
"""Points of a generation."""

STEP = 0.06
"""First standard deviation of a climb, of the cube's edge."""

NARROW = 5e-3
"""The standard deviation at which a climb ends; the next one begins elsewhere."""

APART = 0.1
"""How far the start of a climb is from those of all before it, as the greatest difference."""


class Climb:
    """A search in ``keys`` dimensions that fills the cube with ``explored`` points, what it is told
    before counting among them, and climbs then. The same for the same seed and costs."""

    def __init__(self, keys: int, explored: int, seed: int) -> None:
        self._keys, self._explored = keys, explored
        self._random = np.random.default_rng(seed)
        self._points, self._costs = np.empty((0, keys)), np.empty(0)
        self._starts = np.empty((0, keys))
        self._climb: CMA | None = None
        self._asked = np.empty((0, keys))

    def ask(self, most: int) -> Array:
        """The next points (rows), ``most`` of them at most."""
        left = min(self._explored - len(self._points), most)
        if left > 0:
            from scipy.stats import qmc

            return qmc.LatinHypercube(self._keys, rng=self._random).random(left)
        if self._climb is None or self._climb._sigma < NARROW:
            self._climb = self._next()
        self._asked = np.array([self._climb.ask() for _ in range(POPULATION)])
        return self._asked[:most, : self._keys]

    def tell(self, points: Array, costs: Array) -> None:
        """The costs of points (rows), asked for or not; inf where there is none."""
        self._points = np.vstack([self._points, points])
        self._costs = np.concatenate([self._costs, costs])
        if self._climb is not None and len(points) == POPULATION:
            self._climb.tell([*zip(self._asked, costs.tolist(), strict=True)])

    def _next(self) -> "CMA":
        """A climb from the best point that is apart from where all others began."""
        from cmaes import CMA

        every = np.vstack([self._starts, self._points[np.argsort(self._costs, kind="stable")]])
        self._starts = every[apart(every, APART, len(self._starts) + 1)]
        # The package asks for two dimensions at least: costs do not depend on the second one.
        spare = max(2 - self._keys, 0)
        return CMA(
            mean=np.clip([*self._starts[-1], *[0.5] * spare], 1e-3, 1.0 - 1e-3),
            sigma=STEP,
            bounds=np.tile([0.0, 1.0], (self._keys + spare, 1)),
            population_size=POPULATION,
            seed=int(self._random.integers(1 << 31)),
        )


def apart(points: Array, distance: float, count: int) -> list[int]:
    """The first of ``points`` (rows), and those after it that are ``distance`` from all before them
    that count: ``count`` numbers of rows at most."""
    kept: list[int] = []
    left = np.ones(len(points), bool)
    while left.any() and len(kept) != count:
        kept.append(int(left.argmax()))
        left &= np.abs(points - points[kept[-1]]).max(axis=1) >= distance
    return kept
