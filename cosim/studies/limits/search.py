"""Finds the best settings of the knobs for several quantities at once, from the same runs.

The heights are ragged and lie on narrow ridges, so nothing here trusts a slope: a design that fills
what can be borne of the space, then clouds that shrink about the best few settings of each
quantity, which are apart from each other, so that each quantity is climbed from several starts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.search.climb import apart
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES, TURN, corners, faces, rounded

APART = 0.06
"""How far apart the starts of a quantity are, as a share of a knob's turn."""

ELITE, NEAR, INFLATION = 6, 0.1, 2.0
"""The best settings near a start, along which half its cloud lies: how many, from how far, and by
how much their covariance is blown up."""

STEADY, STEADY_APART = 2, 0.015
"""Settings of each quantity whose surroundings are looked at beside those of the best one, and how
far apart. They stand in for one that is refuted, too."""

LEADS = 3
"""Places of each quantity that are tried on other machines."""

RUGGED, FEW = 0.05, 0.3
"""A quantity whose samples do worse than its best by the one, but for a share of the other, is
sampled once more: where heights are ragged the best is luck, and more samples have more of it."""

PROMISING, ABOUT, ABOUT_COUNT = 2, 0.003, 8
"""Of those that do better there than all that is known here, so many have their neighbours asked
for, too: their standard deviation, as a share of a knob's turn, and how many."""

CANDIDATES = 64
"""Times a quarter of the places that fill the cube: so many are looked at for the others."""

SETTLED = 0.003
"""Relative growth between two climbs, of a quantity's best, below which it is left alone."""

CLOSE, FEWEST = 1.5 * TURN, 5
"""What is known of a setting's surroundings: how far they reach, and from how many runs."""

MOST = 100
"""Best places among which those are picked whose surroundings seem the best."""

NOWHERE: Array = np.empty((0, KNOB_COUNT))
"""No places."""

Ask = Callable[[Array], tuple[Array, NDArray[np.bool_]]]
"""Scores (a row each, a column a quantity) of places (rows) in the cube, and which of these the
coil and the power amplifier bear."""


@dataclass(frozen=True)
class Clouds:
    """Samples about the best places of each quantity."""

    spread: float
    """Their standard deviation."""
    starts: int
    """Places of each quantity about which they lie."""
    samples: int
    """About each; even, since every other one lies along the best settings near by."""
    times: int = 1
    """At most, while the quantity grows or proves rugged."""


@dataclass(frozen=True)
class Effort:
    """How much a search may cost."""

    design: int
    """Places that fill the cube, and then what can be borne of it; a power of two, from 4."""
    first: tuple[Clouds, ...]
    """Of the first climb, one after the other: ever narrower, and about fewer starts."""
    next: tuple[Clouds, ...]
    """Of a later one."""
    rounds: int
    """In which what is best on one machine of a rig is tried on all, and climbed on from; after the
    first."""
    looks: int = 1
    """At surroundings, each time at those that seem the best by then."""


@dataclass(frozen=True)
class Leads:
    """Places (rows) that do well on a machine, and their scores there (rows)."""

    places: Array
    scores: Array


@dataclass(frozen=True)
class Setting:
    """A place in the cube for one quantity, SI: the score there, and over the turns of the knobs.

    The turns are judged by their motion, not by their heat: a hand that is off turns back.
    """

    place: tuple[float, ...]
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


class Search:
    """All places of a machine that have been asked for, with their scores."""

    def __init__(self, ask: Ask, seed: tuple[int, ...], quantities: int = len(QUANTITIES)) -> None:
        self._ask, self._random = ask, np.random.default_rng(seed)
        self._quantities = quantities
        self._known: dict[tuple[float, ...], Array] = {}
        self._borne: dict[tuple[float, ...], bool] = {}
        self._heights = np.full(quantities, -inf)
        self._turned: list[dict[tuple[float, ...], Setting]] = [{} for _ in range(quantities)]
        self._arrays: tuple[Array, Array] | None = None

    def scores(self, places: Array) -> Array:
        """The scores of places (rows), each asked for once."""
        rows = [tuple(row.tolist()) for row in places]
        new = [row for row in dict.fromkeys(rows) if row not in self._known]
        if new:
            self._arrays = None
            found, borne = self._ask(np.array(new))
            self._known.update(zip(new, found, strict=True))
            self._borne.update(zip(new, borne.tolist(), strict=True))
        return np.array([self._known[row] for row in rows]).reshape(-1, self._quantities)

    def fill(self, count: int) -> None:
        """Ask for ``count`` places that fill what can be borne of the cube: those of a sequence of
        which the nearest that is known can be. A quarter of them fills the cube."""
        from scipy.stats import qmc

        sequence, batch = qmc.Sobol(KNOB_COUNT, rng=self._random), max(count // 4, 1)
        self.scores(_to_the_stops(sequence.random(batch)))
        for _ in range(CANDIDATES):
            if len(self._known) >= count:
                break
            places = _to_the_stops(sequence.random(batch))
            borne, tree = np.array(list(self._borne.values())), KDTree(np.array(list(self._known)))
            near = borne[tree.query(places)[1]] if borne.any() else np.ones(batch, bool)
            self.scores(places[near][: count - len(self._known)])

    def climb(self, steps: Sequence[Clouds], hints: Leads) -> None:
        """Ask for ``hints``, and climb from the best of all that is known, but for the quantities
        that have not grown since the last climb began."""
        self.heed(hints)
        growing = self._growing()
        for clouds in steps:
            left = growing
            for _ in range(clouds.times):
                before = self._tops()
                every = {quantity: self._about(quantity, clouds) for quantity in left}
                self.scores(np.vstack([NOWHERE, *every.values()]))
                grown = _grown(before, self._tops())
                left = [q for q in left if grown[q] or self._rugged(q, every[q])]
                if not left:
                    break

    def _about(self, quantity: int, clouds: Clouds) -> Array:
        """Samples about the best places of a quantity, as far as they are not known."""
        starts = [*self.ranked(quantity, APART, clouds.starts), *self._steady(quantity, 1)]
        places = np.vstack([NOWHERE, *(self._cloud(place, quantity, clouds) for place in starts)])
        return np.array(
            [place for place in places if tuple(place.tolist()) not in self._known]
        ).reshape(-1, KNOB_COUNT)

    def _rugged(self, quantity: int, places: Array) -> bool:
        """Whether few of the places (rows) can be borne and do nearly as well as the best that is
        known; no place is not rugged."""
        best = self._column(quantity)[1].max()
        nearly = self.scores(places)[:, quantity] >= best - RUGGED * abs(best)
        return bool(len(places)) and bool(np.mean(nearly & self._are_borne(places)) < FEW)

    def _are_borne(self, places: Array) -> NDArray[np.bool_]:
        """Of known places (rows)."""
        return np.array([self._borne[tuple(place.tolist())] for place in places], bool)

    def heed(self, hints: Leads) -> None:
        """Ask for ``hints``, and for what is close to those that do better elsewhere than all that
        is known here: on this machine the ridge on which they lie may run a few steps beside."""
        self.scores(hints.places)
        every, least = [NOWHERE], _above(self._tops())
        borne = self._are_borne(hints.places)
        for quantity in range(self._quantities):
            there = np.where(borne, hints.scores[:, quantity], -inf)
            order = np.argsort(-there, kind="stable")
            promising = hints.places[order[there[order] > least[quantity]]]
            for place in promising[apart(promising, APART, PROMISING)]:
                steps = self._random.normal(0.0, ABOUT, (ABOUT_COUNT, KNOB_COUNT))
                every.append(rounded(place + steps))
        self.scores(np.vstack(every))

    def _growing(self) -> list[int]:
        """The quantities whose best has grown since this was asked last."""
        last, self._heights = self._heights, self._tops()
        return np.flatnonzero(_grown(last, self._heights)).tolist()

    def _tops(self) -> Array:
        """The best score of each quantity."""
        every = [self._column(quantity)[1].max() for quantity in range(self._quantities)]
        return np.array(every)

    def leads(self) -> Leads:
        """What to try on other machines: for each quantity some of the best places, and that whose
        surroundings seem the best."""
        every = [
            place
            for quantity in range(self._quantities)
            for place in (*self.ranked(quantity, APART, LEADS), *self._steady(quantity, 1))
        ]
        places = np.unique(np.array(every).reshape(-1, KNOB_COUNT), axis=0)
        return Leads(places, self.scores(places))

    def _cloud(self, start: Array, quantity: int, clouds: Clouds) -> Array:
        """Samples about a place, half of them along the ridge that it lies on."""
        places, column = self._column(quantity)
        near = np.abs(places - start).max(axis=1) <= NEAR
        order = np.argsort(-column[near], kind="stable")[:ELITE]
        round_ = clouds.spread**2 * np.eye(KNOB_COUNT)
        ridge = round_ / 16.0
        if len(order) > KNOB_COUNT:
            ridge += INFLATION * np.cov(places[near][order].T)
        steps = [
            self._random.multivariate_normal(np.zeros(KNOB_COUNT), spread, clouds.samples // 2)
            for spread in (round_, ridge)
        ]
        return rounded(start + np.vstack(steps))

    def ranked(self, quantity: int, distance: float, count: int) -> Array:
        """Places with a score, the best first, each ``distance`` from those before it."""
        places, column = self._column(quantity)
        order = np.argsort(-column, kind="stable")
        best = places[order[np.isfinite(column[order])]]
        return best[apart(best, distance, count)]

    def found(self, quantity: int, also: Array = NOWHERE, looks: int = 1) -> Best:
        """The best setting of a quantity, those whose surroundings seem the best, and ``also``
        those at places (rows) that are the best elsewhere, and all that were found before. Those
        that cannot be borne are left out.
        """
        self.scores(also)
        places = [*self.ranked(quantity, STEADY_APART, 1), *also[self._are_borne(also)]]
        settings = self._turned[quantity]
        for _ in range(looks):
            # What is known of surroundings changes with each look at them.
            places += [*self._steady(quantity, STEADY)]
            for place in places:
                if (row := tuple(place.tolist())) not in settings:
                    settings[row] = self.around(place, quantity)
        achievable = (one for one in settings.values() if one.value > 0.0)
        return Best(tuple(sorted(achievable, key=lambda one: -one.value)))

    def distinct(self, quantity: int, count: int) -> Array:
        """The best ``count`` places (rows) that are apart from each other, and as many whose
        surroundings seem the best."""
        best = self.ranked(quantity, STEADY_APART, count)
        return np.vstack([best, self._steady(quantity, count)])

    def best_of(self, places: Array, quantity: int, count: int) -> Best:
        """The best ``count`` of places (rows) for a quantity, without what cannot be borne."""
        column = self.scores(places)[:, quantity]
        order = np.argsort(-column, kind="stable")
        good = places[order[((column > 0.0) & self._are_borne(places))[order]]]
        return Best(tuple(self.around(place, quantity) for place in good[:count]))

    def bests(self, looks: int = 1, also: Sequence[Array] | None = None) -> Bests:
        """What was found for each quantity; ``also`` has further places (rows) for each."""
        every = also or [NOWHERE] * self._quantities
        return tuple(self.found(quantity, places, looks) for quantity, places in enumerate(every))

    def around(self, place: Array, quantity: int) -> Setting:
        """A place with all its turns."""
        every = self.scores(np.vstack([place, faces(place), corners(place)]))[:, quantity]
        return Setting(
            tuple(place.tolist()), float(every[0]), float(np.median(every)), float(every.min())
        )

    def _steady(self, quantity: int, count: int) -> Array:
        """Places whose surroundings, as far as they are known, are good, the best first."""
        places, column = self._column(quantity)
        order = np.argsort(-column, kind="stable")[:MOST]
        close = self._tree.query_ball_point(places[order], CLOSE, p=inf)
        quarter = [
            np.sort(column[row])[(len(row) - 1) // 4] if len(row) >= FEWEST else -inf
            for row in close
        ]
        best = order[np.argsort(-np.array(quarter), kind="stable")]
        good = places[best[column[best] > 0.0]]
        return good[apart(good, STEADY_APART, count)]

    def _column(self, quantity: int) -> tuple[Array, Array]:
        """All places, and their scores of a quantity; -inf where they are not bearable."""
        if self._arrays is None:
            every = np.array(list(self._known.values()))
            every[~np.array(list(self._borne.values()))] = -np.inf
            self._arrays = np.array(list(self._known)), every
            self._tree = KDTree(self._arrays[0])
        places, every = self._arrays
        return places, every[:, quantity]


def _to_the_stops(uniform: Array) -> Array:
    """Places (rows) that are dense where a knob is near an end of its turn, by the arcsine law:
    what is best often lies there."""
    return rounded(np.sin(0.5 * np.pi * uniform) ** 2)


def _above(heights: Array) -> Array:
    """Heights that are more than settled ones."""
    finite = np.where(np.isfinite(heights), heights, 0.0)
    return np.where(np.isfinite(heights), finite + SETTLED * np.abs(finite), -inf)


def _grown(before: Array, after: Array) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = after > _above(before)
    return found
