"""Finds the best settings of the knobs for several quantities at once, from the same runs.

The heights are ragged and lie on narrow ridges, so nothing here trusts a slope: a design that fills
the space, then clouds that shrink about the best few settings of each quantity, which are apart
from each other, so that each quantity is climbed from several starts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from cosim.arrays import Array
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES, TURN, corners, faces, rounded

STARTS, APART = 3, 0.1
"""Starts of each quantity, and how far apart, as a share of a knob's turn; half-way through, the
best of them is left."""

ELITE, NEAR, INFLATION = 6, 0.1, 2.0
"""Those settings: how many, from how far, and by how much their covariance is blown up."""

STEADY, STEADY_APART = 2, 0.015
"""Settings of each quantity whose surroundings are looked at beside those of the best one, and how
far apart. They stand in for one that is refuted, too."""

CLOSE, FEWEST = 1.5 * TURN, 5
"""What is known of a setting's surroundings: how far they reach, and from how many runs."""

MOST = 400
"""Best places among which some are picked that are apart."""

Ask = Callable[[Array], tuple[Array, NDArray[np.bool_]]]
"""Scores (a row each, a column a quantity) of places (rows) in the cube, and which of these the
coil and the power amplifier bear."""


@dataclass(frozen=True)
class Effort:
    """How much a search may cost."""

    design: int
    """Places that fill the cube; a power of two."""
    spreads: tuple[float, ...]
    """Standard deviations of the clouds."""
    samples: int
    """Of a cloud; even, since every other one lies along the best settings near by."""


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
        return np.array([self._known[row] for row in rows])

    def run(self, effort: Effort, hints: Array) -> None:
        """Ask for places that fill the cube, and climb from the best of these and of ``hints``."""
        from scipy.stats import qmc

        self.scores(rounded(qmc.Sobol(KNOB_COUNT, rng=self._random).random(effort.design)))
        self.climb(effort, hints)

    def climb(self, effort: Effort, hints: Array) -> None:
        """Ask for ``hints`` (rows), and climb from the best of all that is known."""
        self.scores(rounded(hints))
        for number, spread in enumerate(effort.spreads):
            wide = 2 * number < len(effort.spreads)
            starts, half = (STARTS, effort.samples // 2) if wide else (1, effort.samples)
            clouds = [np.empty((0, KNOB_COUNT))]
            for quantity in range(self._quantities):
                places = [*self.ranked(quantity, APART, starts), *self._steady(quantity, 1)]
                clouds += [self._cloud(p, quantity, spread, half) for p in places]
            self.scores(np.vstack(clouds))

    def _cloud(self, start: Array, quantity: int, spread: float, half: int) -> Array:
        """Samples about a place, half of them along the ridge that it lies on."""
        places, column = self._column(quantity)
        near = np.abs(places - start).max(axis=1) <= NEAR
        order = np.argsort(-column[near], kind="stable")[:ELITE]
        round_ = spread**2 * np.eye(KNOB_COUNT)
        ridge = round_ / 16.0
        if len(order) > KNOB_COUNT:
            ridge += INFLATION * np.cov(places[near][order].T)
        steps = [
            self._random.multivariate_normal(np.zeros(KNOB_COUNT), spread_, half)
            for spread_ in (round_, ridge)
        ]
        return rounded(start + np.vstack(steps))

    def ranked(self, quantity: int, distance: float, count: int) -> Array:
        """Places with a score, the best first, each ``distance`` from those before it."""
        places, column = self._column(quantity)
        order = np.argsort(-column, kind="stable")
        order = order[np.isfinite(column[order])]
        return _apart(places[order[:MOST]], distance, count)

    def found(self, quantity: int, also: Array) -> Best:
        """The best setting of a quantity, those whose surroundings seem the best, and ``also``
        those at places (rows) that are the best elsewhere. Those that cannot be borne are left out.
        """
        places = [*self.ranked(quantity, STEADY_APART, 1), *self._steady(quantity, STEADY)]
        self.scores(also)
        places += [place for place in also if self._borne[tuple(place.tolist())]]
        every = dict.fromkeys(tuple(place.tolist()) for place in places)
        settings = [self.around(np.array(place), quantity) for place in every]
        achievable = (one for one in settings if one.value > 0.0)
        return Best(tuple(sorted(achievable, key=lambda one: -one.value)))

    def apart(self, quantity: int, count: int) -> Array:
        """The best ``count`` places (rows) that are apart from each other, and as many whose
        surroundings seem the best."""
        best = self.ranked(quantity, STEADY_APART, count)
        return np.vstack([best, self._steady(quantity, count)])

    def best_of(self, places: Array, quantity: int, count: int) -> Best:
        """The best ``count`` of places (rows) for a quantity, without what cannot be borne."""
        column = self.scores(places)[:, quantity]
        good = [
            places[k]
            for k in np.argsort(-column, kind="stable")
            if column[k] > 0.0 and self._borne[tuple(places[k].tolist())]
        ]
        return Best(tuple(self.around(place, quantity) for place in good[:count]))

    def bests(self, also: Sequence[Array] | None = None) -> Bests:
        """What was found for each quantity; ``also`` has further places (rows) for each."""
        none = np.empty((0, KNOB_COUNT))
        return tuple(
            self.found(quantity, none if also is None else also[quantity])
            for quantity in range(self._quantities)
        )

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
        best = best[column[best] > 0.0]
        return _apart(places[best], STEADY_APART, count)

    def _column(self, quantity: int) -> tuple[Array, Array]:
        """All places, and their scores of a quantity; -inf where they are not bearable."""
        if self._arrays is None:
            every = np.array(list(self._known.values()))
            every[~np.array(list(self._borne.values()))] = -np.inf
            self._arrays = np.array(list(self._known)), every
            self._tree = KDTree(self._arrays[0])
        places, every = self._arrays
        return places, every[:, quantity]


def _apart(places: Array, distance: float, count: int) -> Array:
    """The first of ``places`` (rows), and those after it that are ``distance`` from all kept."""
    kept: list[Array] = []
    for place in places:
        if len(kept) == count:
            break
        if not kept or np.abs(np.array(kept) - place).max(axis=1).min() >= distance:
            kept.append(place)
    return np.array(kept).reshape(-1, KNOB_COUNT)
