"""The stages of an identification, from fits of single trials to the rig, its folds and profiles.

Starts are rigs that fit one trial each. They are tried on all trials, and the better ones of them
are searched further, fewer and fewer for longer and longer; all that end near the best are its
ensemble.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from cosim.arrays import Array
from cosim.studies.identify.search.finish import finish
from cosim.studies.identify.search.search import Found, Progress, Search

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
    profile_points: int
    """On each side of the best value of a key."""
    profile_generations: int


FULL = Effort(
    4, 60, ((16, 90, 0.12), (8, 150, 0.08), (3, 250, 0.05), (2, 300, 0.03)),
    ((6, 90, 0.12), (3, 150, 0.08), (1, 300, 0.05)), 3, 40,
)  # fmt: skip
QUICK = Effort(1, 25, ((3, 30, 0.12), (1, 60, 0.06)), ((1, 30, 0.1),), 1, 8)

SCREENED, KEPT, SCREEN_ROUNDS = 128, 8, 4
"""Own numbers that are drawn for a new rig, those that are refined, and the rounds for them."""
AGAIN = 256, 16, 4
"""The same before a solution is searched further."""
CAREFUL = 512, 24, 5
"""The same where a trial's own numbers must be the best there are."""


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

    def _stage(
        self, name: str, work: Callable[[np.random.Generator], Sequence[Found]]
    ) -> list[Found]:
        """The solutions of a stage: those of the store, or of ``work``. A stage draws random
        numbers of its own, so it comes out the same whichever of those before it were done."""
        rng = np.random.default_rng([self.seed, crc32(name.encode())])
        found = self.once(name, lambda: [_plain(one) for one in work(rng)])
        return [_found(one) for one in found]

    def singles(self) -> list[Found]:
        """Rigs that fit one trial each, ``effort.singles`` of each."""
        found = []
        for k in range(len(self.coarse.targets)):
            for n in range(self.effort.singles):
                found += self._stage(
                    f"single {k + 1}-{n + 1}", lambda rng, k=k: [self._single(k, rng)]
                )
        return found

    def _single(self, k: int, rng: np.random.Generator) -> Found:
        alone = self.coarse.part([k])
        places = rng.random((24, len(self.coarse.space.free)))
        start = min(alone.screen(places, rng, 64, 4, 2), key=lambda one: one.total)
        told = self._telling(f"trial {k + 1} alone")
        return alone.nested(start, rng, self.effort.single_generations, 0.15, told, 12)

    def ensemble(
        self, name: str, rows: Sequence[int], rounds: Sequence[tuple[int, int, float]]
    ) -> list[Found]:
        """Solutions for the trials ``rows``, from the rigs of these trials alone on, the best
        first; each has ended its search, most of them early."""
        search, each = self.coarse.part(rows), self.effort.singles
        places = [one.place for i, one in enumerate(self.singles()) if i // each in rows]
        several = self._stage(
            f"{name}: starts",
            lambda rng: search.screen(np.array(places), rng, SCREENED, KEPT, SCREEN_ROUNDS),
        )
        ended: list[Found] = []
        for number, (count, generations, sigma) in enumerate(rounds, 1):
            several = sorted(several, key=lambda one: one.total)
            several, left = several[:count], several[count:]
            ended += left if number > 1 else []
            new = []
            for k, start in enumerate(several, 1):
                title = f"{name}: round {number}, {k} of {len(several)}"
                new += self._further(title, search, start, several, generations, sigma)
            several = new
        return sorted([*several, *ended], key=lambda one: one.total)

    def _further(
        self,
        title: str,
        search: Search,
        start: Found,
        others: Sequence[Found],
        generations: int,
        sigma: float,
    ) -> list[Found]:
        told = self._telling(title)

        def work(rng: np.random.Generator) -> list[Found]:
            begun = search.rescreened(search.borrowed(start, others), rng, *AGAIN)
            return [search.nested(begun, rng, generations, sigma, told)]

        return self._stage(title, work)

    def finished(self, name: str, rows: Sequence[int], found: Found) -> Found:
        """The solution at the finish's step, and by least squares."""
        fine = self.fine.part(rows)

        def work(rng: np.random.Generator) -> list[Found]:
            start = fine.rescreened(fine.refined(found.place, found.own, 4), rng, *CAREFUL)
            nested = fine.nested(start, rng, 40, 0.01, self._telling(f"{name}: finish"))
            return [finish(fine, min(start, nested, key=lambda one: one.total), 12)]

        return self._stage(f"{name}: finish", work)[0]

    def drives(self, name: str, place: Array, targets: Search) -> Found:
        """The best own numbers of trials on a rig, of many starts."""
        return self._stage(name, lambda rng: targets.screen(place[None], rng, *CAREFUL))[0]

    def profile(self, key: int, place: float, start: Found, others: Sequence[Found]) -> Found:
        """The best solution with one key at a place: from a neighbour on, or from that of
        ``others`` whose key is nearest to the place, whichever is the better start.

        Both are moved along the valley of the cost, half of the way or not at all.
        """
        name = f"profile {self.coarse.space.names[key]} {place:.4f}"
        near = min(others, key=lambda one: abs(one.place[key] - place))

        def work(rng: np.random.Generator) -> list[Found]:
            starts = [one for from_ in (start, near) for one in self._moved(from_, key, place)]
            there = min(starts, key=lambda one: one.total)
            n = self.effort.profile_generations
            return [self.coarse.nested(there, rng, n, 0.04, self._telling(name), fixed=key)]

        return self._stage(name, work)[0]

    def _moved(self, start: Found, key: int, place: float) -> list[Found]:
        """A solution with one key moved to a place."""
        search = self.coarse
        follow = search.sensitivity(start.place, start.own)
        along = search.valley(start.place, start.own, key)
        low, high = ([getattr(t, end) for t in search.targets] for end in ("low", "high"))
        found = []
        for share in (0.0, 0.5, 1.0):
            moved = start.place + share * (place - start.place[key]) * along
            moved = np.clip(moved, 0.0, 1.0)
            moved[key] = place
            own = np.clip(start.own + follow @ (moved - start.place), low, high)
            found.append(search.refined(moved, own, 4))
        return found

    def _telling(self, title: str) -> Progress:
        return lambda what, best: self.progress(f"{title}, {what}", best)


def folds(count: int) -> list[list[int]]:
    """The trials' numbers (from 0) of each fold: every third."""
    return [[*range(k, count, FOLDS)] for k in range(min(FOLDS, count))]


def with_targets(search: Search, targets: Sequence[object]) -> Search:
    """The same search for other targets."""
    return replace(search, targets=targets)


def _plain(found: Found) -> dict[str, Any]:
    arrays = {name: getattr(found, name).tolist() for name in ("place", "own", "costs")}
    return arrays | {"total": found.total}


def _found(plain: Mapping[str, Any]) -> Found:
    place, own, costs = (np.array(plain[name], np.float64) for name in ("place", "own", "costs"))
    return Found(place, own, costs, plain["total"])
