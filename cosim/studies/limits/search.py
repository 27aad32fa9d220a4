"""The frontiers of one machine: the best settings of the knobs for several quantities at once, and
those that are the best when a hand is a turn off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from cosim.arrays import Array
from cosim.search.design import Design
from cosim.search.known import Known
from cosim.search.local import STEADY_APART, Local, grown_from
from cosim.search.protocol import Evaluate, apart
from cosim.search.turns import corners, faces
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES, STEPS

APART, LEADS = 0.06, 3
"""How far apart the points of a quantity are that are tried on other machines, and how many."""

LOOKED_AT = 2
"""Points of each quantity whose turns are run, beside the best one, since their surroundings seem
to be the best."""

BETTER, ABOUT, SAMPLES = 2, 0.003, 8
"""Warm starts that beat the incumbent: try 2 with 8 Gaussian neighbours each, σ = 0.003."""

NOWHERE: Array = np.empty((0, KNOB_COUNT))
"""No points."""


@dataclass(frozen=True)
class Effort:
    """What the search of a machine may cost."""

    design: int
    """Runs that fill what is feasible of the knobs' range, before anything else."""
    first: int
    """Patience of the samples about the best after that, in batches."""
    later: int
    """The same, after each round in which the best of other machines was tried."""
    rounds: int
    looks: int = 1
    """At surroundings, each time at those that seem the best by then."""


@dataclass(frozen=True)
class Leads:
    """Points (rows) that do well on a machine, and their scores there (rows)."""

    points: Array
    scores: Array


@dataclass(frozen=True)
class Setting:
    """A point of the unit cube for one quantity, SI: the score there, and over the knobs' turns.

    The turns are judged by their motion, not by their heat: a hand that is off turns back.
    """

    point: tuple[float, ...]
    value: float
    median: float
    worst: float

    @property
    def firm(self) -> bool:
        """Whether all turns lead to what is achievable, too."""
        return self.worst > 0.0


@dataclass(frozen=True)
class Best:
    """Settings for a quantity, those of the greatest value first."""

    settings: tuple[Setting, ...]

    @property
    def robust(self) -> tuple[Setting, ...]:
        """Those that may be turned, the greatest median first."""
        firm = (one for one in self.settings if one.firm)
        return tuple(sorted(firm, key=lambda one: -one.median))

    @property
    def tops(self) -> tuple[Setting, ...]:
        """The best one, and the best of those that may be turned, as far as there are any."""
        return (*self.settings[:1], *self.robust[:1])


Bests = tuple[Best, ...]
"""For each quantity."""


class Frontiers:
    """The search of one machine, whose runs ``evaluate`` makes."""

    def __init__(
        self, evaluate: Evaluate, seed: Sequence[int], quantities: int = len(QUANTITIES)
    ) -> None:
        self.known = Known(KNOB_COUNT, quantities, STEPS, evaluate)
        self._random = np.random.default_rng(seed)
        self._climbed = np.full(quantities, -inf)
        self._turned: list[dict[tuple[float, ...], Setting]] = [{} for _ in range(quantities)]

    def fill(self, count: int) -> None:
        """Run ``count`` points that fill what is feasible."""
        design = Design(KNOB_COUNT, count, int(self._random.integers(1 << 31)), ends=True)
        self.known.search({0: design}, count)

    def heed(self, leads: Leads) -> None:
        """Run the leads of another machine, and what is close to those that do better there than
        all that is known here: on this machine the ridge may run a few steps beside."""
        rows = self.known.rows(leads.points)
        least, every = grown_from(self.known.tops()), [NOWHERE]
        there = np.where(self.known.feasible[rows, None], leads.scores, -inf)
        for column, limit in zip(there.T, least, strict=True):
            order = np.argsort(-column, kind="stable")
            better = leads.points[order[column[order] > limit]]
            for point in better[apart(better, APART, BETTER)]:
                every.append(point + self._random.normal(0.0, ABOUT, (SAMPLES, KNOB_COUNT)))
        self.known.rows(np.vstack(every))

    def climb(self, spread: float, patience: int) -> None:
        """Sample about the best of each quantity that has grown since this was asked last, from a
        standard deviation of ``spread`` down to a step of the knobs."""
        grown = np.flatnonzero(self.known.tops() > grown_from(self._climbed)).tolist()
        self._climbed = self.known.tops()
        seeds = self._random.integers(1 << 31, size=len(self._climbed)).tolist()
        locals_ = {n: Local(self.known, n, seeds[n], spread, 1.0 / STEPS, patience) for n in grown}
        self.known.search(locals_)

    def leads(self) -> Leads:
        """What to try on other machines: for each quantity some of the best points, and that whose
        surroundings seem the best."""
        every = [NOWHERE]
        for quantity in range(self.known.scores.shape[1]):
            every.append(self.known.ranked(quantity, APART, LEADS))
            every.append(self.known.steady(quantity, STEADY_APART, 1))
        points = np.unique(np.vstack(every), axis=0)
        return Leads(points, self.known.own(points))

    def found(self, quantity: int, also: Array = NOWHERE, looks: int = 1) -> Best:
        """The best setting of a quantity, those whose surroundings seem the best, ``also`` those at
        points (rows) that are the best elsewhere, and all that were found before."""
        points = [*self.known.ranked(quantity, STEADY_APART, 1), *also]
        settings = self._turned[quantity]
        for _ in range(looks):
            # What is known of surroundings changes with each look at them.
            points += [*self.known.steady(quantity, STEADY_APART, LOOKED_AT)]
            for setting in self.settings(np.array(points).reshape(-1, KNOB_COUNT), quantity):
                settings[setting.point] = setting
        return Best(tuple(sorted(settings.values(), key=lambda one: -one.value)))

    def bests(self, looks: int = 1, also: Sequence[Array] | None = None) -> Bests:
        """What was found for each quantity; ``also`` has further points (rows) for each."""
        every = also or [NOWHERE] * self.known.scores.shape[1]
        return tuple(self.found(quantity, points, looks) for quantity, points in enumerate(every))

    def distinct(self, quantity: int, count: int) -> Array:
        """The best ``count`` points (rows) that are apart from each other, and as many whose
        surroundings seem the best."""
        best = self.known.ranked(quantity, STEADY_APART, count)
        return np.vstack([best, self.known.steady(quantity, STEADY_APART, count)])

    def settings(self, points: Array, quantity: int, most: int | None = None) -> list[Setting]:
        """Points (rows) with their turns, the best ``most`` of them first, without what is not
        feasible or achieves nothing."""
        points = np.unique(self.known.set_at(points), axis=0)
        rows = self.known.rows(points)
        scores = self.known.scores[rows, quantity]
        order = np.argsort(-scores, kind="stable")
        good = [points[row] for row in order if scores[row] > 0.0]
        return [
            self._turned[quantity].get(tuple(point.tolist())) or self._around(point, quantity)
            for point in good[:most]
        ]

    def _around(self, point: Array, quantity: int) -> Setting:
        every = np.vstack([point, faces(point), corners(point)])
        scores = self.known.own(every)[:, quantity]
        return Setting(
            tuple(point.tolist()), float(scores[0]), float(np.median(scores)), float(scores.min())
        )
