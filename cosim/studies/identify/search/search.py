"""The search for one rig that explains several trials.

CMA-ES goes over the rig. Each of its candidates gets the trial-specific parameters (``own``) that
the nearest good candidate of the last generation had, moved along as the rig differs
(`sensitivity`), and one round of Gauss–Newton on each trial: so the search over the rig sees a cost
from which these nuisance parameters are nearly eliminated. Since a trial's cost has many minima
over them, they are drawn anew from time to time (`screen`). Least squares over all of them together
ends it (`finish`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from cmaes import CMA
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from cosim.arrays import Array
from cosim.stepper.stepper import OWN, RIG
from cosim.studies.identify.chain.chain import Target, look_around, refine, simulate
from cosim.studies.identify.problem.space import Space
from cosim.studies.identify.problem.targets import draws

STEP = 2e-3
"""Of a bound's range, for derivatives: below it impacts make the cost rough."""
SOFT = 0.03
"""Damping of the sensitivities, relative to the diagonal of the normal matrix."""
POPULATION = 12
REFRESH, RESCREEN = 4, 30
"""Generations after which sensitivities are found anew, and own parameters drawn anew."""
RESCREENED = 128, 8, 3
"""Of these: how many are drawn, how many of them refined, and the rounds for that."""
STARTS = 15
"""Moments of the drive's start that are tried."""
BETTER = 0.97
"""Own parameters are replaced only if the trial's cost falls by 3 %."""
SAMPLES = 46.0
"""Effective ones of a trial: 412 of the nine published ones."""
NARROW = 1e-3
"""Step of CMA-ES, of the bounds' ranges, at which it ends."""
TINY = 1e-12
"""Of the normal matrix' trace."""
ENDS_AT = 1e-5
"""Relative gain of a step of least squares below which it ends."""


@dataclass(frozen=True, eq=False)
class Found:
    """A rig, a ``point`` of its ``space``, and the trials on it: their parameters ``own`` (trials ×
    OWN), their ``costs``, and ``total``: their mean, with what is known beside the trials."""

    space: Space
    point: Array
    own: Array
    costs: Array
    total: float

    @property
    def rig(self) -> Array:
        """The stepper's numbers of the rig (RIG)."""
        return self.space.rigs(self.point[None])[0]

    @property
    def numbers(self) -> dict[str, float]:
        """The same by name."""
        return dict(zip(RIG, self.rig.tolist(), strict=True))

    @property
    def settings(self) -> dict[str, Any]:
        """The rig by the keys of a scene, SI."""
        return self.space.settings(self.point)


Progress = Callable[[str, float], None]
"""What is being done, and the best cost so far."""


def best_of(several: Sequence[Found]) -> Found:
    """The one whose cost is lowest, the first of equal ones."""
    return min(several, key=lambda one: one.total)


def _started(targets: Sequence[Target], own: Array) -> Array:
    """Own parameters (n × m × OWN), each as it is and with the drive switched on at other times."""
    k = OWN.index("start")
    # n × m × (as it is, and at STARTS moments) × OWN; the moments are in the middle of equal parts.
    found = np.repeat(own[:, :, None], 1 + STARTS, axis=2)
    for rows, target in zip(found, targets, strict=True):
        if target.scale[k] > 0.0:
            rows[:, 1:, k] = target.low[k] + (np.arange(STARTS) + 0.5) / STARTS * target.scale[k]
    return found.reshape(len(own), -1, len(OWN))


def _best(own: Array, cost: Array, kept: int) -> tuple[Array, Array]:
    """The best of several own parameters (n × m × OWN) with costs (n × m)."""
    order = np.argsort(cost, axis=1)[:, :kept]
    best = np.take_along_axis(own, order[:, :, None], axis=1)
    return best, np.take_along_axis(cost, order, 1)


def _perturbed(point: Array, step: float) -> tuple[Array, Array]:
    """A point and its neighbours, each a step away in one coordinate (rows); the steps."""
    steps = np.where(point + step <= 1.0, step, -step)
    return np.concatenate([point[None], point + np.diag(steps)]), steps


@dataclass(frozen=True, eq=False)
class Search:
    """The trials that a rig is sought for, and with how many threads."""

    space: Space
    targets: Sequence[Target]
    workers: int

    def part(self, rows: Sequence[int]) -> "Search":
        """The same with some of the trials."""
        return replace(self, targets=[self.targets[k] for k in rows])

    def bounds(self, name: str) -> Array:
        """``low``, ``high`` or ``scale`` of all targets (trials × OWN)."""
        return np.array([getattr(target, name) for target in self.targets])

    def made(self, point: Array, own: Array, costs: Array) -> Found:
        """A solution whose costs are known."""
        total = float(self.totals(costs[None], point[None])[0])
        return Found(self.space, point.copy(), own.copy(), costs.copy(), total)

    def totals(self, costs: Array, points: Array) -> Array:
        """Of rigs at points (n × free) whose trials have ``costs`` (n × trials). -2 ln L is the
        effective samples times ln cost, to which a measurement beside the trials, or a prior, adds
        the square of its residual in standard deviations: it weighs what the trials let it."""
        off = (self.space.residuals(points) ** 2).sum(axis=1) / (SAMPLES * costs.shape[1])
        return costs.mean(axis=1) * (1.0 + off)

    def refined(self, point: Array, own: Array, rounds: int) -> Found:
        """The trials' parameters fitted on a given rig from ``own`` on."""
        rigs = np.repeat(self.space.rigs(point[None]), len(self.targets), axis=0)
        return self.made(point, *refine(self.targets, rigs, own, rounds, self.workers))

    def screen(
        self, points: Array, rng: np.random.Generator, count: int, kept: int, rounds: int
    ) -> list[Found]:
        """For each rig the best of ``count`` random own parameters, ``kept`` of them refined."""
        trials = len(self.targets)
        # From here on a row for each pair of rig and trial, all trials of the first rig first.
        rigs = np.repeat(self.space.rigs(points), trials, axis=0)
        each = [*self.targets] * len(points)
        drawn = np.stack([draws(target, count, rng) for target in each])
        own, cost = _best(*look_around(each, rigs, drawn, self.workers), kept)
        own, cost = self._refined_each(each, rigs, own, 1)
        # The cost is rugged over the moment of the start: all of them are tried.
        own, cost = _best(*look_around(each, rigs, _started(each, own), self.workers), kept)
        own, cost = _best(*self._refined_each(each, rigs, own, rounds), 1)
        shape = (len(points), trials)
        solutions = zip(points, own.reshape(*shape, len(OWN)), cost.reshape(shape), strict=True)
        return [self.made(*one) for one in solutions]

    def _refined_each(
        self, targets: Sequence[Target], rigs: Array, own: Array, rounds: int
    ) -> tuple[Array, Array]:
        """Several own parameters (n × m × OWN) of each target and rig, fitted, and their costs."""
        n, m, _ = own.shape
        each = [target for target in targets for _ in range(m)]
        wide = np.repeat(rigs, m, axis=0)
        found, cost = refine(each, wide, own.reshape(n * m, -1), rounds, self.workers)
        return found.reshape(own.shape), cost.reshape(n, m)

    def rescreened(
        self, found: Found, rng: np.random.Generator, count: int, kept: int, rounds: int
    ) -> Found:
        """With other own parameters where random ones led to clearly less."""
        (other,) = self.screen(found.point[None], rng, count, kept, rounds)
        same = self.refined(found.point, found.own, rounds)
        take = other.costs < BETTER * same.costs
        own = np.where(take[:, None], other.own, same.own)
        return self.made(found.point, own, np.where(take, other.costs, same.costs))

    def borrowed(self, found: Found, others: Sequence[Found]) -> Found:
        """With the own parameters of other rigs' trials where they fit this one better, the drives
        scaled to the same force."""
        # Rigs × trials × OWN until turned; the first rig is the one to be fitted.
        every = [found, *others]
        rigs = self.space.rigs(np.array([one.point for one in every]))
        force = rigs[:, RIG.index("force_factor")]
        tried = np.array([one.own for one in every])
        drives = [OWN.index(name) for name in ("amplitude", "offset")]
        tried[:, :, drives] *= (force / force[0])[:, None, None]
        tried = np.clip(tried, self.bounds("low"), self.bounds("high")).transpose(1, 0, 2)
        here = np.repeat(rigs[:1], len(self.targets), axis=0)
        own, cost = _best(*self._refined_each(self.targets, here, tried, 3), 1)
        return self.made(found.point, own[:, 0], cost[:, 0])

    def slopes(self, point: Array, own: Array, k: int) -> Array:
        """Of the residuals of trial ``k``, by the rig's coordinates and the fitted own parameters
        in units of their scales (rows)."""
        target = self.targets[k]
        free = np.flatnonzero(target.scale > 0.0)
        # Rows: the rig and own parameters as they are; each coordinate of the rig moved; each
        # fitted own parameter moved. Where a step would leave the bounds it goes the other way.
        points, steps = _perturbed(point, STEP)
        rigs = self.space.rigs(points)
        rigs = np.concatenate([rigs, np.repeat(rigs[:1], len(free), axis=0)])
        own_steps = np.where(own[k] + STEP * target.scale <= target.high, STEP, -STEP)[free]
        several = np.repeat(own[k][None], len(rigs), axis=0)
        several[len(points) + np.arange(len(free)), free] += own_steps * target.scale[free]
        residuals = simulate(target, rigs, several)[1]
        return (residuals[1:] - residuals[0]) / np.concatenate([steps, own_steps])[:, None]

    def sensitivity(self, point: Array, own: Array) -> Array:
        """How the own parameters follow the rig's point: trials × OWN × free."""

        def one(k: int) -> Array:
            slopes, d = self.slopes(point, own, k), len(point)
            normal = np.einsum("ij,kj->ik", slopes, slopes)  # on any number of threads the same
            # The blocks of the normal matrix N are the rig's d coordinates r, then the own
            # parameters o. Where these are fitted N_oo do + N_or dr = 0; damping keeps do small
            # where the trial does not tell it.
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
    ) -> Found:
        """CMA-ES over the rig from ``start`` on."""
        space, trials = self.space, len(self.targets)
        search = CMA(
            mean=np.clip(start.point, 1e-3, 1 - 1e-3),
            sigma=sigma,
            bounds=np.tile([0.0, 1.0], (len(start.point), 1)),
            population_size=POPULATION,
            seed=int(rng.integers(2**31)),
        )
        low, high = self.bounds("low"), self.bounds("high")
        best = here = self.refined(start.point, start.own, 2)
        follow = self.sensitivity(here.point, here.own)
        parents, theirs = here.point[None], here.own[None]
        for generation in range(1, generations + 1):
            asked = [search.ask() for _ in range(POPULATION)]
            points = np.array(asked)
            # Each begins with the nearest parent's own parameters, moved by the sensitivities.
            spread = parents.std(axis=0) + 1e-6
            apart = ((points[:, None] - parents) / spread) ** 2
            nearest = apart.sum(axis=2).argmin(axis=1)
            moved = theirs[nearest] + np.einsum("tkd,nd->ntk", follow, points - parents[nearest])
            # One round of least squares for each pair of rig and trial.
            own, costs = refine(
                [*self.targets] * POPULATION,
                np.repeat(space.rigs(points), trials, axis=0),
                np.clip(moved, low, high).reshape(-1, len(OWN)),
                *(1, self.workers),
            )
            own, costs = own.reshape(POPULATION, trials, -1), costs.reshape(POPULATION, trials)
            totals = self.totals(costs, points)
            search.tell([*zip(asked, totals.tolist(), strict=True)])
            k = int(totals.argmin())
            here = self.made(points[k], own[k], costs[k])
            # The better half, by which CMA-ES moves on, are the parents of the next generation.
            good = np.argsort(totals)[: POPULATION // 2]
            parents, theirs = points[good], own[good]
            if generation % RESCREEN == 0:
                here = self.rescreened(here, rng, *RESCREENED)
                parents, theirs = here.point[None], here.own[None]
            best = best_of([best, here])
            if generation % REFRESH == 0:
                follow = self.sensitivity(here.point, here.own)
            progress(f"generation {generation}", best.total)
            if search._sigma < NARROW:
                break
        return best


def _unknowns(search: Search, point: Array, own: Array, weight: float) -> Array:
    """Slopes of all residuals, the trials' and ``weight`` times those of what is known beside
    them, by the unknowns (rows): the point, then each trial's fitted own parameters in units of
    their scales, which move that trial's residuals alone."""
    d = len(point)
    each = search.each(lambda k: search.slopes(point, own, k))
    points, turns = _perturbed(point, STEP)
    beside = search.space.residuals(points)
    beside = weight * (beside[1:] - beside[0]) / turns[:, None]
    alone: Array = np.asarray(block_diag(*(one[d:] for one in each)))
    shared = np.hstack([one[:d] for one in each])
    return np.block([[shared, beside], [alone, np.zeros((len(alone), beside.shape[1]))]])


def deviations(search: Search, found: Found, samples: float) -> Array:
    """Standard deviations of the rig's coordinates, the own parameters fitted anew, where the cost
    is as curved as at the solution: its neighbourhood alone, no other minimum. The solution may be
    of another law than ``search``.

    -2 ln L is the effective ``samples`` times ln cost, so the covariance is the inverse of the
    normal matrix times the sum of squares over the samples (G. A. F. Seber, C. J. Wild, *Nonlinear
    Regression*, Wiley 1989, section 5.1).
    """
    d, total = len(found.point), float(found.costs.sum())
    alike = replace(search, space=found.space)
    slopes = _unknowns(alike, found.point, found.own, _weight(found))
    normal = np.einsum("ij,kj->ik", slopes, slopes)
    normal += TINY * np.trace(normal) * np.eye(len(normal))  # of what moves nothing
    covariance = np.linalg.inv(normal) * total / samples
    return np.asarray(np.sqrt(np.diag(covariance)[:d]))


def _weight(found: Found) -> float:
    """Of a residual of what is known beside the trials, in units of theirs."""
    return float(np.sqrt(found.costs.mean() / SAMPLES))


def finish(search: Search, found: Found, steps: int) -> Found:
    """The solution after at most ``steps`` steps of least squares, if it is better. What is known
    beside the trials is among the residuals, with the weight of ``Search.totals``.

    The unknowns are the point and the fitted own parameters in units of their scales.
    """
    space, targets, d = search.space, search.targets, len(found.point)
    low, high, scale = (search.bounds(name) for name in ("low", "high", "scale"))
    free = scale > 0.0
    weight = _weight(found)

    def apart(x: Array) -> tuple[Array, Array]:
        own = found.own.copy()
        own[free] = x[d:] * scale[free]
        return x[:d], own

    def residuals(x: Array) -> Array:
        point, own = apart(x)
        rig = space.rigs(point[None])
        rows = search.each(lambda k: simulate(targets[k], rig, own[k][None])[1][0])
        return np.concatenate([*rows, weight * space.residuals(point[None])[0]])

    def slopes(x: Array) -> Array:
        return _unknowns(search, *apart(x), weight).T

    start = np.concatenate([found.point, found.own[free] / scale[free]])
    ends = [
        np.concatenate([np.full(d, end), bound[free] / scale[free]])
        for end, bound in ((0.0, low), (1.0, high))
    ]
    inside = np.clip(start, ends[0] + 1e-9, ends[1] - 1e-9)
    jacobian: Any = slopes  # a callable, which scipy's annotations do not know
    fitted = least_squares(
        residuals, inside, jacobian, (ends[0], ends[1]), ftol=ENDS_AT, xtol=1e-8, max_nfev=steps
    )
    return best_of([found, search.refined(*apart(fitted.x), 2)])
