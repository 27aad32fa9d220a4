"""The points that searches of the unit cube have run, for several quantities at once."""

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.turns import TURN

Feasible = NDArray[np.bool_]
"""Of points (rows): whether they are allowed."""

Evaluate = Callable[[Array], tuple[Array, Feasible]]
"""The scores (a row for each point, a column for each quantity) of points (rows) that are to be
run, and which of these are feasible."""

NEAR, FEWEST, MOST = 1.5 * TURN, 5, 100
"""What is known of a point's surroundings: how far they reach, from how many points at least, and
of how many of the best points they are looked at."""


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
    left = np.ones(len(points), bool)  # those that are far enough from all that are kept
    while left.any() and len(kept) != count:
        kept.append(int(left.argmax()))
        left &= np.abs(points - points[kept[-1]]).max(axis=1) >= distance
    return kept


class Known:
    """Runs points, each once, and keeps their scores, -inf where they are not feasible. Only
    multiples of 1/``steps`` can be set."""

    def __init__(self, keys: int, quantities: int, steps: int, evaluate: Evaluate) -> None:
        self._steps, self._evaluate = steps, evaluate
        self._rows: dict[bytes, int] = {}
        self.points, self.scores = np.empty((0, keys)), np.empty((0, quantities))
        self.feasible: Feasible = np.empty(0, bool)
        self._tree: KDTree | None = None

    def rows(self, points: Array) -> list[int]:
        """The rows here of the nearest points that can be set, which are run if not known."""
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
        """Let searches, by the number of the quantity that each is for, ask for ``runs`` points
        each, side by side, so that many workers have something to do."""
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
                # The rows stand in the order in which the searches were asked.
                mine, rows = rows[: len(points)], rows[len(points) :]
                left[quantity] -= len(points)
                searches[quantity].tell(points, self.scores[mine, quantity], self.feasible[mine])

    def tops(self) -> Array:
        """The best score of each quantity; -inf where there is none."""
        top: Array = self.scores.max(axis=0, initial=-inf)
        return top

    def ranked(
        self, quantity: int, distance: float, count: int, among: Sequence[int] | None = None
    ) -> Array:
        """Feasible points with a score, the best first, each ``distance`` from those before it; of
        all, or of the rows ``among`` them."""
        order = self._order(quantity)
        best = self.points[order if among is None else order[np.isin(order, among)]]
        return best[apart(best, distance, count)]

    def steady(self, quantity: int, distance: float, count: int) -> Array:
        """The same among the best ones by the lower quartile of what is known about them, as far as
        that tells: those that are likely to be robust."""
        order = self._order(quantity)[:MOST]
        self._tree = self._tree or KDTree(self.points)
        column = self.scores[:, quantity]
        # The cube about a point, not the ball: each key is turned by itself. The quartile is one of
        # the scores and no mean of two, since those that are not feasible have -inf.
        near = self._tree.query_ball_point(self.points[order], NEAR, p=inf)
        quartile = [
            np.sort(column[rows])[(len(rows) - 1) // 4] if len(rows) >= FEWEST else -inf
            for rows in near
        ]
        best = self.points[order[np.argsort(-np.array(quartile), kind="stable")]]
        return best[apart(best, distance, count)]

    def _order(self, quantity: int) -> NDArray[np.intp]:
        column = self.scores[:, quantity]
        order = np.argsort(-column, kind="stable")
        return order[np.isfinite(column[order])]
