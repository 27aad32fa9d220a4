"""Points of the unit cube that were run, with their scores for several quantities."""

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.turns import TURN

Feasible = NDArray[np.bool_]
"""For each point (row) whether it is feasible."""

Evaluate = Callable[[Array], tuple[Array, Feasible]]
"""Runs points (rows); gives their scores (points × quantities), and which points are feasible."""

NEAR, FEWEST, MOST = 1.5 * TURN, 5, 100
"""For ``Known.steady``: how far a point's neighbours are at most, how many it needs, and how many
of the best points are considered."""


class Search(Protocol):
    """A search for the largest score. The same for the same seed and scores."""

    def ask(self) -> Array:
        """The next points (rows) of the unit cube; no rows once the search has ended."""
        ...

    def tell(self, points: Array, scores: Array, feasible: Feasible) -> None:
        """Take the scores of points (rows), whether asked for or not; -inf where infeasible."""
        ...


def apart(points: Array, distance: float, count: int) -> list[int]:
    """Row numbers of points chosen in order: each whose distance (largest difference of a
    coordinate) from all chosen before is at least ``distance``; at most ``count``, -1: all."""
    kept: list[int] = []
    left = np.ones(len(points), bool)  # those that are far enough from all that are kept
    while left.any() and len(kept) != count:
        kept.append(int(left.argmax()))
        left &= np.abs(points - points[kept[-1]]).max(axis=1) >= distance
    return kept


class Known:
    """Runs points, each once, and keeps their scores, -inf for infeasible ones. Coordinates are
    rounded to multiples of 1/``steps``, since only these can be set."""

    def __init__(self, keys: int, quantities: int, steps: int, evaluate: Evaluate) -> None:
        self._steps, self._evaluate = steps, evaluate
        self._rows: dict[bytes, int] = {}
        self.points, self.scores = np.empty((0, keys)), np.empty((0, quantities))
        self.feasible: Feasible = np.empty(0, bool)
        self._tree: KDTree | None = None

    def rows(self, points: Array) -> list[int]:
        """The row numbers in ``self.points`` of the given points, rounded; unknown ones are run."""
        points = np.round(np.clip(points, 0.0, 1.0) * self._steps) / self._steps
        # Rounded alike, equal points have equal bytes; one that is asked for twice is run once.
        keys = [point.tobytes() for point in points]
        new = [n for n, key in enumerate(keys) if key not in self._rows]
        new = [n for n in new if keys.index(keys[n]) == n]
        if new:
            found, feasible = self._evaluate(points[new])
            first = len(self.points)
            self._rows |= {keys[n]: first + k for k, n in enumerate(new)}
            self.points = np.vstack([self.points, points[new]])
            self.feasible = np.concatenate([self.feasible, feasible])
            self.scores = np.vstack([self.scores, np.where(feasible[:, None], found, -inf)])
            self._tree = None
        return [self._rows[key] for key in keys]

    def search(self, searches: Mapping[int, Search], runs: int) -> None:
        """Let searches, by the index of the quantity that each maximises, ask for ``runs`` points
        each. The points of all searches are run together, to keep many workers busy."""
        for quantity, search in searches.items():
            search.tell(self.points, self.scores[:, quantity], self.feasible)
        left = dict.fromkeys(searches, runs)
        while asked := {
            quantity: points
            for quantity, search in searches.items()
            if left[quantity] > 0 and len(points := search.ask()[: left[quantity]])
        }:
            rows = self.rows(np.vstack([*asked.values()]))
            for quantity, points in asked.items():
                mine, rows = rows[: len(points)], rows[len(points) :]  # stacked in this order
                left[quantity] -= len(points)
                searches[quantity].tell(points, self.scores[mine, quantity], self.feasible[mine])

    def tops(self) -> Array:
        """The best score of each quantity; -inf without any."""
        top: Array = self.scores.max(axis=0, initial=-inf)
        return top

    def ranked(
        self, quantity: int, distance: float, count: int, among: Sequence[int] | None = None
    ) -> Array:
        """Feasible points with a score, the best first, each at least ``distance`` from those
        before it: at most ``count`` of all points, or of the rows ``among``."""
        order = self._order(quantity)
        best = self.points[order if among is None else order[np.isin(order, among)]]
        return best[apart(best, distance, count)]

    def steady(self, quantity: int, distance: float, count: int) -> Array:
        """Points that are likely to be robust: the MOST best ones, ranked by the lower quartile of
        the known scores in their neighbourhood, chosen as in ``ranked``."""
        order = self._order(quantity)[:MOST]
        self._tree = self._tree or KDTree(self.points)
        column = self.scores[:, quantity]
        # Neighbours are those in a cube (p = inf), since each key turns by itself. The quartile is
        # one of the scores, not an interpolation: infeasible points have -inf.
        near = self._tree.query_ball_point(self.points[order], NEAR, p=inf)
        quartile = [
            np.sort(column[rows])[(len(rows) - 1) // 4] if len(rows) >= FEWEST else -inf
            for rows in near
        ]
        best = self.points[order[np.argsort(-np.array(quartile), kind="stable")]]
        return best[apart(best, distance, count)]

    def _order(self, quantity: int) -> NDArray[np.intp]:
        """The rows that have a score, the best first."""
        column = self.scores[:, quantity]
        order = np.argsort(-column, kind="stable")
        return order[np.isfinite(column[order])]
