"""Samples about the best of what is known, ever closer.

For objectives that are ragged, and for many quantities at once: it trusts no average over a
generation, as CMA-ES does, and what was run for one quantity serves all.
"""

import numpy as np

from cosim.arrays import Array
from cosim.search.known import Known
from cosim.search.protocol import Feasible

SAMPLES = 4
"""About each point; every other one lies along the ridge that it is on."""

STARTS, APART = 200.0, 0.06
"""Points about which samples lie, for a standard deviation of 1, one at least; how far apart."""

ELITE, NEAR, INFLATION = 6, 0.1, 2.0
"""The ridge is the covariance of so many best points near by, from within this distance, blown up
by this factor."""

STEADY_APART = 0.015
"""How far apart points with good surroundings are."""

RUGGED, FEW = 0.05, 0.3
"""If fewer than 30 % of the samples are feasible and within 5 % of the best, sample again: a lone
maximum on a rugged objective is unreliable."""

GROWN = 0.003
"""Relative growth of the best that counts."""


class Local:
    """Samples about the best points of a quantity and that with the best surroundings. Their
    standard deviation is halved from ``spread`` to ``least``, each time where the best has not
    grown and is not rugged, or after ``patience`` batches; the widest ones are asked for once."""

    def __init__(
        self,
        known: Known,
        quantity: int,
        seed: int | list[int],
        spread: float,
        least: float,
        patience: int,
    ) -> None:
        self._known, self._quantity = known, quantity
        self._random = np.random.default_rng(seed)
        self._spread, self._least = spread, least
        self._patience, self._left = patience, min(patience, 1)
        self._asked, self._top = False, -np.inf

    def ask(self) -> Array:
        """The next points (rows); none at the end."""
        nothing = self._known.points[:0]
        if not self._left or self._spread < self._least:
            return nothing
        self._asked, self._top = True, float(self._known.tops()[self._quantity])
        count = max(1, round(STARTS * self._spread))
        starts = [
            *self._known.ranked(self._quantity, APART, count),
            *self._known.steady(self._quantity, STEADY_APART, 1),
        ]
        return np.vstack([nothing, *map(self._about, starts)])

    def tell(self, points: Array, scores: Array, feasible: Feasible) -> None:
        """The scores of points (rows); what is known has those that were not asked for, too."""
        if not self._asked:
            return
        best = scores.max(initial=self._top)
        grown = best > grown_from(np.array(self._top))
        nearly = (scores >= best - RUGGED * abs(best)) & feasible
        self._asked = False
        self._left -= 1
        if not self._left or not (grown or np.mean(nearly) < FEW):
            self._spread /= 2.0
            self._left = self._patience

    def _about(self, start: Array) -> Array:
        """Samples about a point, half of them along its ridge."""
        known, keys = self._known, len(start)
        column = known.scores[:, self._quantity]
        near = np.abs(known.points - start).max(axis=1) <= NEAR
        order = np.argsort(-column[near], kind="stable")[:ELITE]
        round_ = self._spread**2 * np.eye(keys)
        ridge = round_ / 16.0
        if len(order) > keys:
            ridge += INFLATION * np.cov(known.points[near][order].T)
        steps = [
            self._random.multivariate_normal(np.zeros(keys), spread, SAMPLES // 2)
            for spread in (round_, ridge)
        ]
        return np.clip(start + np.vstack(steps), 0.0, 1.0)


def grown_from(heights: Array) -> Array:
    """What the best scores must exceed to have grown from ``heights``."""
    finite = np.where(np.isfinite(heights), heights, 0.0)
    return np.where(np.isfinite(heights), finite + GROWN * np.abs(finite), -np.inf)
