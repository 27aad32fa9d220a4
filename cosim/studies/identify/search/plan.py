"""The stages of an identification, from fits of single trials to the rig and its folds.

Start points are rigs that fit one trial each, both unchanged and with another scale of forces and
masses and other walls. Each is evaluated on all trials; then rounds of searches go on from fewer
and fewer of the best solutions, for more and more generations. Each law of the suspension is
searched twice with different random numbers: only if both searches reach the same cost does the
range of a key show what the trials leave open, and not the scatter of the search.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any
from zlib import crc32

import numpy as np

from cosim.arrays import Array
from cosim.studies.identify.search.search import Found, Progress, Search, best_of, finish

FOLDS = 3


@dataclass(frozen=True)
class Effort:
    """How much is searched. ``rounds`` are those for the rig of all trials, ``fold_rounds`` those
    for the rig of a fold; each is (number of solutions, generations, first step of CMA-ES)."""

    singles: int
    """Fits of each single trial."""
    single_generations: int
    rounds: tuple[tuple[int, int, float], ...]
    fold_rounds: tuple[tuple[int, int, float], ...]
    laws: int
    """How many of the suspension laws that the bounds name are searched, at most."""
    searches: int
    """Searches of each law."""


FULL = Effort(
    3, 50, ((24, 80, 0.07), (10, 160, 0.06), (4, 330, 0.04), (1, 800, 0.02)),
    ((10, 80, 0.07), (4, 200, 0.05), (1, 330, 0.04)), 3, 2,
)  # fmt: skip
"""The number of starts decides: with 20 and 8 in the first rounds a search of the published trials
reached a cost of 0.103, with 10 and 4 only 0.117. Small first steps do better, too: from eight
starts with the law knee, 960 rigs each reached a mean cost of 0.123 with a first step of 0.07, of
0.131 with 0.12, and of 0.140 with 0.2."""
QUICK = Effort(1, 25, ((3, 40, 0.07), (1, 80, 0.04)), ((1, 40, 0.07),), 1, 1)

AGREED = 1.02
"""Ratio of the costs of two searches up to which they agree."""

SCALE, WALLS = 0.25, 1.5
"""Standard deviations of the logarithms by which the starts' scale and walls are changed."""

SCREENED, KEPT, SCREEN_ROUNDS = 128, 8, 4
"""Screening of a new rig: own parameters that are drawn, those that are refined, and rounds."""
AGAIN = 256, 16, 4
"""Screening before a solution is searched further."""
CAREFUL = 512, 24, 5
"""Screening of a rig that is to be finished."""
DRIVES = 4096, 128, 5
"""Screening where only own parameters are sought, on a given rig: they must be the global best."""
LAST = 40
"""Generations of CMA-ES with the time step of the finish."""


@dataclass(frozen=True, eq=False)
class Plan:
    """One search and its stages; ``fine`` is ``coarse`` with the finish's shorter time step."""

    coarse: Search
    fine: Search
    effort: Effort
    once: Callable[[str, Callable[[], Any]], Any]
    """A store's method, which keeps finished stages for an interrupted identification."""
    seed: int
    progress: Progress
    name: str
    """Of the search; it seeds the stages' random numbers, so two searches draw different ones."""

    def _stage(
        self, name: str, work: Callable[[np.random.Generator], Sequence[Found]]
    ) -> list[Found]:
        """The solutions of a stage: those of the store, or else of ``work``. Each stage has its own
        random numbers, so its result does not depend on which earlier stages came from the store.
        """
        name = f"{self.name}: {name}"
        rng = np.random.default_rng([self.seed, crc32(name.encode())])

        def plain() -> list[Any]:  # lists, which the store can hold
            return [[x.tolist() for x in (one.point, one.own, one.costs)] for one in work(rng)]

        return [Found(self.coarse.space, *map(np.array, each)) for each in self.once(name, plain)]

    def singles(self) -> list[Found]:
        """Rigs that fit one trial each, ``effort.singles`` of each."""

        def single(rng: np.random.Generator, k: int) -> list[Found]:
            alone, tell = self.coarse.part([k]), self._telling(f"trial {k + 1} alone")
            # From the best of 24 random rigs, each with 64 random own parameters.
            start = best_of(alone.screen(rng.random((24, len(alone.space.free))), rng, 64, 4, 2))
            return [alone.nested(start, rng, self.effort.single_generations, 0.15, tell)]

        return [
            self._stage(f"single {k + 1}-{n + 1}", partial(single, k=k))[0]
            for k in range(len(self.coarse.targets))
            for n in range(self.effort.singles)
        ]

    def ensemble(
        self, name: str, rows: Sequence[int], rounds: Sequence[tuple[int, int, float]]
    ) -> list[Found]:
        """Solutions for the trials ``rows``, the best first: those of the last round, and those
        whose search ended in an earlier one. The starts are the rigs that fit one of these trials.
        """
        search, each = self.coarse.part(rows), self.effort.singles
        # ``singles`` has ``each`` rigs of trial 0, then ``each`` of trial 1, and so on.
        points = np.array([one.point for i, one in enumerate(self.singles()) if i // each in rows])

        def starts(rng: np.random.Generator) -> list[Found]:
            scale, walls = (np.exp(s * rng.standard_normal(len(points))) for s in (SCALE, WALLS))
            both = np.concatenate([points, search.space.scaled(points, scale, walls)])
            return search.screen(both, rng, SCREENED, KEPT, SCREEN_ROUNDS)

        def further(rng: np.random.Generator, given: Any) -> list[Found]:
            start, others, *effort = given
            begun = search.rescreened(search.borrowed(start, others), rng, *AGAIN)
            return [search.nested(begun, rng, *effort)]

        several, ended = self._stage(f"{name}: starts", starts), []
        for number, (count, generations, sigma) in enumerate(rounds, 1):
            several = sorted(several, key=lambda one: one.total)
            several, left = several[:count], several[count:]
            ended += left if number > 1 else []  # before round 1 these are only starts
            new = []
            for k, start in enumerate(several, 1):
                title = f"{name}: round {number}, {k} of {len(several)}"
                given = start, several, generations, sigma, self._telling(title)
                new += self._stage(title, partial(further, given=given))
            several = new
        return sorted([*several, *ended], key=lambda one: one.total)

    def finished(self, name: str, rows: Sequence[int], found: Found) -> Found:
        """The solution searched on with the time step of the finish, then by least squares."""
        fine = self.fine.part(rows)

        def work(rng: np.random.Generator) -> list[Found]:
            start = fine.rescreened(fine.refined(found.point, found.own, 4), rng, *CAREFUL)
            nested = fine.nested(start, rng, LAST, 0.01, self._telling(f"{name}: finish"))
            return [finish(fine, best_of([start, nested]), 12)]

        return self._stage(f"{name}: finish", work)[0]

    def drives(self, name: str, point: Array, targets: Search) -> Found:
        """The solution on a given rig with the best own parameters of very many random ones."""
        return self._stage(name, lambda rng: targets.screen(point[None], rng, *DRIVES))[0]

    def _telling(self, title: str) -> Progress:
        return lambda what, best: self.progress(f"{self.name}: {title}, {what}", best)


@dataclass(frozen=True, eq=False)
class Searched:
    """The solutions of all searches with one law of the suspension."""

    ends: list[Found]
    """The best solution of each search, finished."""
    candidates: list[Found]
    """All solutions of all searches before the finish, the best first."""
    begun: Sequence[Found] = ()
    """The candidates from which the ends were finished, and which the ends therefore replace."""

    @property
    def best(self) -> Found:
        """The best of the ends."""
        return best_of(self.ends)

    @property
    def scatter(self) -> float:
        """The highest cost of the ends over the lowest; 1, and no measure, for a single search."""
        return max(one.total for one in self.ends) / self.best.total

    @property
    def converged(self) -> bool:
        """Whether several searches agree in their cost."""
        return len(self.ends) > 1 and self.scatter <= AGREED

    def within(self, factor: float) -> list[Found]:
        """The candidates whose cost is at most ``factor`` times the lowest, without ``begun``."""
        most = factor * self.candidates[0].total
        return [one for one in self.candidates if one.total <= most and one not in self.begun]


def searched(plans: Sequence[Plan]) -> Searched:
    """Carry out the searches of a law, one plan each."""
    rows = [*range(len(plans[0].coarse.targets))]
    ensembles = [plan.ensemble("all trials", rows, plan.effort.rounds) for plan in plans]
    pairs = zip(plans, ensembles, strict=True)
    ends = [plan.finished("all trials", rows, found[0]) for plan, found in pairs]
    order = sorted([one for found in ensembles for one in found], key=lambda one: one.total)
    return Searched(ends, order, [found[0] for found in ensembles])


def folds(count: int) -> list[list[int]]:
    """The trials' numbers (from 0) of each fold: every third."""
    return [[*range(k, count, FOLDS)] for k in range(min(FOLDS, count))]
