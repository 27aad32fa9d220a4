"""The search for one rig that explains several trials.

CMA-ES goes over the rig. Each of its candidates gets the trials' own numbers that the nearest good
candidate of the last generation had, moved along as the rig differs (`sensitivity`), and one round
of Gauss–Newton on each trial: so the search over the rig sees a cost from which the own numbers are
nearly eliminated. Since a trial's cost has many minima over its own numbers, they are drawn anew
from time to time (`screen`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from cmaes import CMA

from cosim.arrays import Array
from cosim.stepper.stepper import OWN, RIG
from cosim.studies.identify.chain.chain import Target, look_around, refine, simulate
from cosim.studies.identify.problem.space import Space
from cosim.studies.identify.problem.targets import draws

TURN = 2e-3
"""Of a bound's range, for derivatives: below it impacts make the cost rough."""
SOFT = 0.03
"""Damping of the sensitivities, relative to the diagonal of the normal matrix."""
POPULATION = 16
REFRESH, RESCREEN = 4, 30
"""Generations after which sensitivities are found anew, and own numbers drawn anew."""
FORCE = RIG.index("force_factor")
STARTS = 15
"""Moments of the drive's start that are tried."""
BETTER = 0.97
"""Of a trial's cost, which other own numbers must reach to take the place of the present ones."""
SAMPLES = 46.0
"""Effective ones of a trial: 412 of the nine published ones."""
NARROW = 1e-3
"""Step of CMA-ES, of the bounds' ranges, at which it ends."""


@dataclass(frozen=True, eq=False)
class Found:
    """A rig and the trials' numbers on it: ``place`` (free), ``own`` (trials × OWN), ``costs`` (one
    for each trial) and ``total``, their mean and what the priors add."""

    place: Array
    own: Array
    costs: Array
    total: float


Progress = Callable[[str, float], None]
"""What is being done, and the best cost so far."""


def _started(targets: Sequence[Target], own: Array) -> Array:
    """Own numbers (n × m × OWN), each as it is and with the drive switched on at other times."""
    k = OWN.index("start")
    found = np.repeat(own[:, :, None], 1 + STARTS, axis=2)
    for rows, target in zip(found, targets, strict=True):
        if target.scale[k] > 0.0:
            rows[:, 1:, k] = target.low[k] + (np.arange(STARTS) + 0.5) / STARTS * target.scale[k]
    return found.reshape(len(own), -1, len(OWN))


@dataclass(frozen=True, eq=False)
class Search:
    """The trials that a rig is sought for, and with how many threads."""

    space: Space
    targets: Sequence[Target]
    workers: int

    def made(self, place: Array, own: Array, found: Array) -> Found:
        """A solution whose costs are known."""
        total = float(self.totals(found[None], place[None])[0])
        return Found(place.copy(), own.copy(), found.copy(), total)

    def totals(self, costs: Array, places: Array) -> Array:
        """Of rigs at places (n × free) whose trials have ``costs`` (n × trials). -2 ln L is the
        effective samples times ln cost, to which a measurement beside the trials adds the square of
        its miss in standard deviations; so it weighs as much as the trials let it."""
        off = (self.space.misses(places) ** 2).sum(axis=1) / (SAMPLES * costs.shape[1])
        return costs.mean(axis=1) * (1.0 + off) + self.space.prior(places)

    def refined(self, place: Array, own: Array, rounds: int) -> Found:
        """The trials' numbers fitted on a given rig from ``own`` on."""
        rigs = np.repeat(self.space.rigs(place[None]), len(self.targets), axis=0)
        return self.made(place, *refine(self.targets, rigs, own, rounds, self.workers))

    def screen(
        self, places: Array, rng: np.random.Generator, count: int, kept: int, rounds: int
    ) -> list[Found]:
        """For each rig the best of ``count`` random own numbers, ``kept`` of which are refined."""
        trials = len(self.targets)
        rigs = np.repeat(self.space.rigs(places), trials, axis=0)
        each = [*self.targets] * len(places)
        drawn = np.stack([draws(target, count, rng) for target in each])
        own, cost = self._best(*look_around(each, rigs, drawn, self.workers), kept)
        own, cost = self._refined_each(each, rigs, own, 1)
        # The cost is rugged over the moment of the start: all of them are tried.
        own, cost = self._best(*look_around(each, rigs, _started(each, own), self.workers), kept)
        own, cost = self._refined_each(each, rigs, own, rounds)
        own, cost = self._best(own, cost, 1)
        shape = (len(places), trials)
        solutions = zip(places, own.reshape(*shape, len(OWN)), cost.reshape(shape), strict=True)
        return [self.made(*one) for one in solutions]

    @staticmethod
    def _best(own: Array, cost: Array, kept: int) -> tuple[Array, Array]:
        """The best of several own numbers (n × m × OWN) with costs (n × m)."""
        order = np.argsort(cost, axis=1)[:, :kept]
        return np.take_along_axis(own, order[:, :, None], axis=1), np.take_along_axis(
            cost, order, 1
        )

    def _refined_each(
        self, targets: Sequence[Target], rigs: Array, own: Array, rounds: int
    ) -> tuple[Array, Array]:
        """Several own numbers (n × m × OWN) of each target and rig, fitted, and their costs."""
        n, m, _ = own.shape
        each = [target for target in targets for _ in range(m)]
        wide = np.repeat(rigs, m, axis=0)
        found, cost = refine(each, wide, own.reshape(n * m, -1), rounds, self.workers)
        return found.reshape(own.shape), cost.reshape(n, m)

    def rescreened(
        self,
        found: Found,
        rng: np.random.Generator,
        count: int = 128,
        kept: int = 8,
        rounds: int = 3,
    ) -> Found:
        """With other own numbers where random ones led to clearly less."""
        (other,) = self.screen(found.place[None], rng, count, kept, rounds)
        same = self.refined(found.place, found.own, rounds)
        take = other.costs < BETTER * same.costs
        own = np.where(take[:, None], other.own, same.own)
        return self.made(found.place, own, np.where(take, other.costs, same.costs))

    def borrowed(self, found: Found, others: Sequence[Found]) -> Found:
        """With the own numbers of other rigs' trials where they fit this one better, the drives
        scaled to the same force."""
        force = self.space.rigs(np.array([one.place for one in [found, *others]]))[:, FORCE]
        drives = [OWN.index(name) for name in ("amplitude", "offset")]
        tried = np.array([found.own, *(one.own for one in others)])
        tried[:, :, drives] *= (force / force[0])[:, None, None]
        low, high = ([getattr(t, end) for t in self.targets] for end in ("low", "high"))
        rigs = np.repeat(self.space.rigs(found.place[None]), len(self.targets), axis=0)
        own, cost = self._refined_each(
            self.targets, rigs, np.clip(tried, low, high).transpose(1, 0, 2), 3
        )
        own, cost = self._best(own, cost, 1)
        return self.made(found.place, own[:, 0], cost[:, 0])

    def slopes(self, place: Array, own: Array, k: int, turn: float = TURN) -> tuple[Array, Array]:
        """Residuals of trial ``k``, and their slopes by the rig's place and the fitted own numbers
        in units of their scales (rows)."""
        target = self.targets[k]
        free = np.flatnonzero(target.scale > 0.0)
        turns = np.where(place + turn <= 1.0, turn, -turn)
        rigs = self.space.rigs(np.concatenate([place[None], place + np.diag(turns)]))
        rigs = np.concatenate([rigs, np.repeat(rigs[:1], len(free), axis=0)])
        own_turns = np.where(own[k] + turn * target.scale <= target.high, turn, -turn)[free]
        numbers = np.repeat(own[k][None], len(rigs), axis=0)
        rows = 1 + len(place) + np.arange(len(free))
        numbers[rows, free] += own_turns * target.scale[free]
        residuals = simulate(target, rigs, numbers)[1]
        steps = np.concatenate([turns, own_turns])[:, None]
        return residuals[0], (residuals[1:] - residuals[0]) / steps

    def sensitivity(self, place: Array, own: Array) -> Array:
        """How the own numbers follow the rig's place: trials × OWN × free."""

        def one(k: int) -> Array:
            _, slopes = self.slopes(place, own, k)
            d = len(place)
            normal = np.einsum("ij,kj->ik", slopes, slopes)  # on any number of threads the same
            inner = normal[d:, d:] + SOFT * np.diag(np.diag(normal)[d:] + 1e-9)
            found = np.zeros((len(OWN), d))
            free = np.flatnonzero(self.targets[k].scale > 0.0)
            if len(free):
                scale = self.targets[k].scale[free]
                found[free] = -np.linalg.solve(inner, normal[d:, :d]) * scale[:, None]
            return found

        return np.array(self.each(one))

    def each(self, work: Callable[[int], Any]) -> list[Any]:
        """What ``work`` makes of the number of each target, by as many threads as are asked for."""
        numbers = range(len(self.targets))
        if self.workers == 1:
            return [work(k) for k in numbers]
        with ThreadPoolExecutor(self.workers) as pool:
            return [*pool.map(work, numbers)]

    def nested(
        self,
        start: Found,
        rng: np.random.Generator,
        generations: int,
        sigma: float,
        progress: Progress,
        population: int = POPULATION,
    ) -> Found:
        """CMA-ES over the rig from ``start`` on."""
        space, trials = self.space, len(self.targets)
        search = CMA(
            mean=np.clip(start.place, 1e-3, 1 - 1e-3),
            sigma=sigma,
            bounds=np.tile([0.0, 1.0], (len(start.place), 1)),
            population_size=population,
            seed=int(rng.integers(2**31)),
        )
        low, high = (np.array([getattr(t, end) for t in self.targets]) for end in ("low", "high"))
        best = here = self.refined(start.place, start.own, 2)
        follow = self.sensitivity(here.place, here.own)
        parents, theirs = here.place[None], here.own[None]
        for generation in range(1, generations + 1):
            asked = [search.ask() for _ in range(population)]
            places = np.array(asked)
            spread = parents.std(axis=0) + 1e-6
            apart = ((places[:, None] - parents) / spread) ** 2
            nearest = apart.sum(axis=2).argmin(axis=1)
            moved = theirs[nearest] + np.einsum("tkd,nd->ntk", follow, places - parents[nearest])
            own, found = refine(
                [*self.targets] * population,
                np.repeat(space.rigs(places), trials, axis=0),
                np.clip(moved, low, high).reshape(-1, len(OWN)),
                *(1, self.workers),
            )
            found = found.reshape(population, trials)
            totals = self.totals(found, places)
            search.tell([*zip(asked, totals.tolist(), strict=True)])
            k = int(totals.argmin())
            own = own.reshape(population, trials, -1)
            here = self.made(places[k], own[k], found[k])
            good = np.argsort(totals)[: population // 2]
            parents, theirs = places[good], own[good]
            if generation % RESCREEN == 0:
                here = self.rescreened(here, rng)
                parents, theirs = here.place[None], here.own[None]
            best = min(best, here, key=lambda one: one.total)
            if generation % REFRESH == 0:
                follow = self.sensitivity(here.place, here.own)
            progress(f"generation {generation}", best.total)
            if search._sigma < NARROW:
                break
        return best

    def part(self, rows: Sequence[int]) -> "Search":
        """The same with some of the trials."""
        return replace(self, targets=[self.targets[k] for k in rows])
