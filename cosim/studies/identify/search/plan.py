"""The stages of an identification, from fits of single trials to the rig and its folds.

Starts are rigs that fit one trial each, as they are and with another scale of forces and masses and
other walls. They are tried on all trials, and the better ones of them are searched further, fewer
and fewer for longer and longer. Each law of the suspension is searched twice, from other random
numbers: only where both come to the same cost does a range mean the trials and not the search.
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
    """How much is searched. ``rounds`` are those of the rig for all trials, ``fold_rounds`` those
    of a fold: how many solutions, for how many generations, with which first step of CMA-ES."""

    singles: int
    """Fits of each single trial."""
    single_generations: int
    rounds: tuple[tuple[int, int, float], ...]
    fold_rounds: tuple[tuple[int, int, float], ...]
    laws: int
    """So many laws of the suspension, of those that the bounds name, at most."""
    searches: int
    """Of each law."""


FULL = Effort(
    3, 50, ((24, 80, 0.07), (10, 160, 0.06), (4, 330, 0.04), (1, 800, 0.02)),
    ((10, 80, 0.07), (4, 200, 0.05), (1, 330, 0.04)), 3, 2,
)  # fmt: skip
"""Breadth decides: from 20 and 8 starts in the first rounds a search came to 0.103 of the published
trials, which from 10 and 4 had ended at 0.117. Small first steps do better, too: of eight starts
with the law knee, 960 rigs each took the cost to 0.123 in the mean from 0.07 on, to 0.131 from 0.12
on, and to 0.140 from 0.2 on."""
QUICK = Effort(1, 25, ((3, 40, 0.07), (1, 80, 0.04)), ((1, 40, 0.07),), 1, 1)

AGREED = 1.02
"""Ratio of the costs of two searches up to which they have come to the same."""

SCALE, WALLS = 0.25, 1.5
"""Standard deviations of the logarithms by which starts are moved."""

SCREENED, KEPT, SCREEN_ROUNDS = 128, 8, 4
"""Own parameters that are drawn for a new rig, those that are refined, and the rounds for them."""
AGAIN = 256, 16, 4
"""The same before a solution is searched further."""
CAREFUL = 512, 24, 5
"""The same of a rig that is to be finished."""
DRIVES = 4096, 128, 5
"""The same where only a trial's own parameters are sought: they must be the best there are."""
LAST = 40
"""Generations at the finish's step."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Carries out the stages; ``fine`` is the same search at the finish's step."""

    coarse: Search
    fine: Search
    effort: Effort
    once: Callable[[str, Callable[[], Any]], Any]
    """A store's, of the stages that are done: an interrupted identification goes on there."""
    seed: int
    progress: Progress
    name: str
    """Of the search: stages of two searches draw other random numbers."""

    def _stage(
        self, name: str, work: Callable[[np.random.Generator], Sequence[Found]]
    ) -> list[Found]:
        """The solutions of a stage: those of the store, or of ``work``. A stage draws random
        numbers of its own, so it comes out the same whichever of those before it were done."""
        name = f"{self.name}: {name}"
        rng = np.random.default_rng([self.seed, crc32(name.encode())])

        def plain() -> list[Any]:
            arrays = [((one.point, one.own, one.costs), one.total) for one in work(rng)]
            return [[[array.tolist() for array in each], total] for each, total in arrays]

        found = []
        for arrays, total in self.once(name, plain):
            point, own, costs = (np.array(array, np.float64) for array in arrays)
            found.append(Found(self.coarse.space, point, own, costs, total))
        return found

    def singles(self) -> list[Found]:
        """Rigs that fit one trial each, ``effort.singles`` of each."""

        def single(rng: np.random.Generator, k: int) -> list[Found]:
            alone, told = self.coarse.part([k]), self._telling(f"trial {k + 1} alone")
            start = best_of(alone.screen(rng.random((24, len(alone.space.free))), rng, 64, 4, 2))
            return [alone.nested(start, rng, self.effort.single_generations, 0.15, told)]

        return [
            self._stage(f"single {k + 1}-{n + 1}", partial(single, k=k))[0]
            for k in range(len(self.coarse.targets))
            for n in range(self.effort.singles)
        ]

    def ensemble(
        self, name: str, rows: Sequence[int], rounds: Sequence[tuple[int, int, float]]
    ) -> list[Found]:
        """Solutions for the trials ``rows``, from the rigs of these trials alone on, the best
        first; each has ended its search, most of them early."""
        search, each = self.coarse.part(rows), self.effort.singles
        points = np.array([one.point for i, one in enumerate(self.singles()) if i // each in rows])

        def starts(rng: np.random.Generator) -> list[Found]:
            scale, walls = (np.exp(s * rng.standard_normal(len(points))) for s in (SCALE, WALLS))
            every = np.concatenate([points, search.space.scaled(points, scale, walls)])
            return search.screen(every, rng, SCREENED, KEPT, SCREEN_ROUNDS)

        def further(rng: np.random.Generator, given: Any) -> list[Found]:
            start, others, *effort = given
            begun = search.rescreened(search.borrowed(start, others), rng, *AGAIN)
            return [search.nested(begun, rng, *effort)]

        several, ended = self._stage(f"{name}: starts", starts), []
        for number, (count, generations, sigma) in enumerate(rounds, 1):
            several = sorted(several, key=lambda one: one.total)
            several, left = several[:count], several[count:]
            ended += left if number > 1 else []
            new = []
            for k, start in enumerate(several, 1):
                title = f"{name}: round {number}, {k} of {len(several)}"
                given = start, several, generations, sigma, self._telling(title)
                new += self._stage(title, partial(further, given=given))
            several = new
        return sorted([*several, *ended], key=lambda one: one.total)

    def finished(self, name: str, rows: Sequence[int], found: Found) -> Found:
        """The solution at the finish's step, and by least squares."""
        fine = self.fine.part(rows)

        def work(rng: np.random.Generator) -> list[Found]:
            start = fine.rescreened(fine.refined(found.point, found.own, 4), rng, *CAREFUL)
            nested = fine.nested(start, rng, LAST, 0.01, self._telling(f"{name}: finish"))
            return [finish(fine, best_of([start, nested]), 12)]

        return self._stage(f"{name}: finish", work)[0]

    def drives(self, name: str, point: Array, targets: Search) -> Found:
        """The best own parameters of trials on a rig, of many starts."""
        return self._stage(name, lambda rng: targets.screen(point[None], rng, *DRIVES))[0]

    def _telling(self, title: str) -> Progress:
        return lambda what, best: self.progress(f"{self.name}: {title}, {what}", best)


@dataclass(frozen=True, eq=False)
class Searched:
    """What the searches with one law of the suspension have found."""

    ends: list[Found]
    """The best of each search, finished."""
    candidates: list[Found]
    """All at which a search has ended, the best first, at the step of the search."""
    begun: Sequence[Found] = ()
    """Those of them that the ends were finished from, and so are the same again."""

    @property
    def best(self) -> Found:
        """The best of the ends."""
        return best_of(self.ends)

    @property
    def scatter(self) -> float:
        """The highest cost of the ends over the lowest; of one search nothing is known."""
        return max(one.total for one in self.ends) / self.best.total

    @property
    def converged(self) -> bool:
        """Whether several searches have come to the same."""
        return len(self.ends) > 1 and self.scatter <= AGREED

    def within(self, factor: float) -> list[Found]:
        """The candidates whose cost is at most ``factor`` times the lowest; none finished."""
        most = factor * self.candidates[0].total
        return [one for one in self.candidates if one.total <= most and one not in self.begun]


def searched(plans: Sequence[Plan]) -> Searched:
    """The searches of a law, one plan each."""
    rows = [*range(len(plans[0].coarse.targets))]
    every = [plan.ensemble("all trials", rows, plan.effort.rounds) for plan in plans]
    both = zip(plans, every, strict=True)
    ends = [plan.finished("all trials", rows, found[0]) for plan, found in both]
    order = sorted([one for found in every for one in found], key=lambda one: one.total)
    return Searched(ends, order, [found[0] for found in every])


def folds(count: int) -> list[list[int]]:
    """The trials' numbers (from 0) of each fold: every third."""
    return [[*range(k, count, FOLDS)] for k in range(min(FOLDS, count))]
