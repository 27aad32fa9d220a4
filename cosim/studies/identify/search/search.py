"""The search for one rig that explains several trials.

CMA-ES searches over the rig; each trial's own parameters (``own``) are nuisance parameters. For
each candidate rig they start at those of the nearest good rig of the last generation, corrected to
first order for the difference of the two rigs (`sensitivity`), and one round of Gauss–Newton fits
them: so CMA-ES sees a cost from which they are nearly eliminated. Since a trial's cost has many
local minima over its own parameters, random ones are tried from time to time (`screen`). Least
squares over rig and own parameters together ends the search (`finish`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
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
"""Step of finite differences, over a bound's range: below it impacts make the cost rough."""
SOFT = 0.03
"""Damping of the sensitivities, relative to the diagonal of the normal matrix."""
POPULATION = 12  # rigs in a generation of CMA-ES
REFRESH, RESCREEN = 4, 30
"""Generations after which sensitivities are found anew, and own parameters drawn anew."""
RESCREENED = 128, 8, 3
"""When they are drawn anew: how many are drawn, how many of them refined, in how many rounds."""
STARTS = 15
"""Start times of the drive that are tried."""
BETTER = 0.97
"""Own parameters are replaced only if the trial's cost falls by 3 %."""
SAMPLES = 46.0
"""Effective number of independent samples of a trial: the nine published trials have 412."""
NARROW = 1e-3
"""Step of CMA-ES, as a share of the bounds' ranges, at which it ends."""
TINY = 1e-12
"""Regularisation of the normal matrix, as a share of its trace."""
ENDS_AT = 1e-5
"""Relative gain of a step of least squares below which it ends."""


@dataclass(frozen=True, eq=False)
class Found:
    """A solution: a rig, as a ``point`` of its ``space``, with each trial's parameters ``own``
    (trials × OWN) and ``costs`` (trials)."""

    space: Space
    point: Array
    own: Array
    costs: Array

    @cached_property
    def total(self) -> float:
        """The cost of all trials together, :func:`totals`."""
        return float(totals(self.space, self.costs[None], self.point[None])[0])

    @property
    def rig(self) -> Array:
        """The stepper's numbers of the rig (RIG)."""
        return self.space.rigs(self.point[None])[0]

    @property
    def numbers(self) -> dict[str, float]:
        """The stepper's numbers of the rig by name."""
        return dict(zip(RIG, self.rig.tolist(), strict=True))

    @property
    def settings(self) -> dict[str, Any]:
        """The rig by the keys of a scene, SI."""
        return self.space.settings(self.point)


Progress = Callable[[str, float], None]
"""What is being done, and the best cost so far."""


def totals(space: Space, costs: Array, points: Array) -> Array:
    """Costs (n) of rigs at points (n × free) whose trials have ``costs`` (n × trials).

    -2 ln L is the effective samples times ln cost. A measurement beside the trials, or a prior,
    adds the square of its residual r, in standard deviations. To first order that multiplies the
    mean cost by 1 + Σ r²/(effective samples)."""
    off = (space.residuals(points) ** 2).sum(axis=1) / (SAMPLES * costs.shape[1])
    return costs.mean(axis=1) * (1.0 + off)


def best_of(several: Sequence[Found]) -> Found:
    """The solution with the lowest cost, the first of equal ones."""
    return min(several, key=lambda one: one.total)


def _started(targets: Sequence[Target], own: Array) -> Array:
    """Own parameters (n × trials × m × OWN), each unchanged and with STARTS other start times of
    the drive: n × trials × m (1 + STARTS) × OWN. The start times are the centres of equal parts of
    their range."""
    k = OWN.index("start")
    found = np.repeat(own[:, :, :, None], 1 + STARTS, axis=3)
    for t, target in enumerate(targets):
        if target.scale[k] > 0.0:
            times = target.low[k] + (np.arange(STARTS) + 0.5) / STARTS * target.scale[k]
            found[:, t, :, 1:, k] = times
    return found.reshape(*own.shape[:2], -1, len(OWN))


def _best(own: Array, cost: Array, kept: int) -> tuple[Array, Array]:
    """The ``kept`` cheapest of the m own parameters (n × trials × m × OWN) with costs (n × trials ×
    m), for each rig and trial."""
    order = np.argsort(cost, axis=2)[:, :, :kept]
    best = np.take_along_axis(own, order[..., None], axis=2)
    return best, np.take_along_axis(cost, order, axis=2)


def _inherited(points: Array, parents: Array, parents_own: Array, follow: Array) -> Array:
    """Own parameters (n × trials × OWN) with which rigs at points (n × free) start: those of the
    nearest parent, corrected by ``follow`` (trials × OWN × free) for the difference of the two."""
    apart = (points[:, None] - parents) / (parents.std(axis=0) + 1e-6)  # rigs × parents × free
    near = (apart**2).sum(axis=2).argmin(axis=1)
    return parents_own[near] + np.einsum("tkd,nd->ntk", follow, points - parents[near])


def _perturbed(point: Array, step: float) -> tuple[Array, Array]:
    """A point (d) and d neighbours, each moved in one coordinate (rows, 1 + d), and the steps (d):
    backwards where a forward step would leave the unit cube."""
    steps = np.where(point + step <= 1.0, step, -step)
    return np.concatenate([point[None], point + np.diag(steps)]), steps


@dataclass(frozen=True, eq=False)
class Search:
    """The space of rigs, the trials that one rig must explain, and the number of threads."""

    space: Space
    targets: Sequence[Target]
    workers: int

    def part(self, rows: Sequence[int]) -> "Search":
        """This search with some of its trials."""
        return replace(self, targets=[self.targets[k] for k in rows])

    def bounds(self, name: str) -> Array:
        """``low``, ``high`` or ``scale`` of all targets (trials × OWN)."""
        return np.array([getattr(target, name) for target in self.targets])

    def fitted(self, points: Array, own: Array, rounds: int) -> tuple[Array, Array]:
        """Own parameters (n × trials × m × OWN) fitted on rigs (n × free), and their costs."""
        return refine(self.targets, self.space.rigs(points), own, rounds, self.workers)

    def refined(self, point: Array, own: Array, rounds: int) -> Found:
        """The solution on a given rig, its own parameters fitted from ``own`` on."""
        found, costs = self.fitted(point[None], own[None, :, None], rounds)
        return Found(self.space, point, found[0, :, 0], costs[0, :, 0])

    def screen(
        self, points: Array, rng: np.random.Generator, count: int, kept: int, rounds: int
    ) -> list[Found]:
        """For each rig (n × free) and trial the best of ``count`` random own parameters: the
        ``kept`` cheapest ones are refined, tried with other start times, and refined again."""
        targets, rigs = self.targets, self.space.rigs(points)
        own = np.array([[draws(target, count, rng) for target in targets] for _ in points])
        own, _ = _best(*look_around(targets, rigs, own, self.workers), kept)
        own, _ = self.fitted(points, own, 1)
        # The cost is rugged over the drive's start time: a grid over its whole range is tried.
        own, _ = _best(*look_around(targets, rigs, _started(targets, own), self.workers), kept)
        own, cost = _best(*self.fitted(points, own, rounds), 1)
        solutions = zip(points, own[:, :, 0], cost[:, :, 0], strict=True)
        return [Found(self.space, *solution) for solution in solutions]

    def rescreened(
        self, found: Found, rng: np.random.Generator, count: int, kept: int, rounds: int
    ) -> Found:
        """The solution with the own parameters of a new screening where they cost clearly less."""
        (drawn,) = self.screen(found.point[None], rng, count, kept, rounds)
        refined = self.refined(found.point, found.own, rounds)
        take = drawn.costs < BETTER * refined.costs
        own = np.where(take[:, None], drawn.own, refined.own)
        return Found(self.space, found.point, own, np.where(take, drawn.costs, refined.costs))

    def borrowed(self, found: Found, others: Sequence[Found]) -> Found:
        """The solution on the same rig, with another solution's own parameters for each trial which
        they fit better; its drives are scaled to give the same coil force on this rig."""
        solutions = [found, *others]
        rigs = self.space.rigs(np.array([one.point for one in solutions]))
        force = rigs[:, RIG.index("force_factor")]
        tried = np.array([one.own for one in solutions])  # solutions × trials × OWN
        drives = [OWN.index(name) for name in ("amplitude", "offset")]
        tried[:, :, drives] *= (force / force[0])[:, None, None]
        tried = np.clip(tried, self.bounds("low"), self.bounds("high")).transpose(1, 0, 2)
        own, cost = _best(*self.fitted(found.point[None], tried[None], 3), 1)
        return Found(self.space, found.point, own[0, :, 0], cost[0, :, 0])

    def slopes(self, point: Array, own: Array, k: int) -> Array:
        """Derivatives of the residuals of trial ``k`` (columns) by the rig's d coordinates, then by
        the fitted own parameters in units of their scales (rows)."""
        target = self.targets[k]
        free = np.flatnonzero(target.scale > 0.0)
        # Rows of ``rigs`` and ``several``: everything unchanged; each coordinate of the rig moved;
        # each fitted own parameter moved, backwards where a forward step would leave its bounds.
        points, steps = _perturbed(point, STEP)
        rigs = self.space.rigs(points)
        rigs = np.concatenate([rigs, np.repeat(rigs[:1], len(free), axis=0)])
        own_steps = np.where(own[k] + STEP * target.scale <= target.high, STEP, -STEP)[free]
        several = np.repeat(own[k][None], len(rigs), axis=0)
        several[len(points) + np.arange(len(free)), free] += own_steps * target.scale[free]
        residuals = simulate(target, rigs, several)[1]
        return (residuals[1:] - residuals[0]) / np.concatenate([steps, own_steps])[:, None]

    def sensitivity(self, point: Array, own: Array) -> Array:
        """Derivatives of the best own parameters by the rig's point: trials × OWN × free."""

        def of_trial(k: int) -> Array:
            slopes, d = self.slopes(point, own, k), len(point)
            # Not by BLAS, whose rounding depends on its number of threads.
            normal = np.einsum("ij,kj->ik", slopes, slopes)
            # The normal matrix N has blocks for the rig's d coordinates r and for the own
            # parameters o. Own parameters that stay fitted obey N_oo do + N_or dr = 0; damping
            # keeps do small where the trial does not determine it.
            inner = normal[d:, d:] + SOFT * np.diag(np.diag(normal)[d:] + 1e-9)
            found = np.zeros((len(OWN), d))
            free = np.flatnonzero(self.targets[k].scale > 0.0)
            if len(free):
                scale = self.targets[k].scale[free]
                found[free] = -np.linalg.solve(inner, normal[d:, :d]) * scale[:, None]
            return found

        return np.array(self.each(of_trial))

    def each(self, work: Callable[[int], Any]) -> list[Any]:
        """The results of ``work`` for the number of each target, in ``workers`` threads."""
        with ThreadPoolExecutor(self.workers) as pool:
            return [*pool.map(work, range(len(self.targets)))]

    def nested(
        self,
        start: Found,
        rng: np.random.Generator,
        generations: int,
        sigma: float,
        progress: Progress,
    ) -> Found:
        """The best solution of CMA-ES over the rig from ``start`` on. The first step is ``sigma``,
        as a share of the bounds' ranges."""
        search = CMA(
            mean=np.clip(start.point, 1e-3, 1 - 1e-3),
            sigma=sigma,
            bounds=np.tile([0.0, 1.0], (len(start.point), 1)),
            population_size=POPULATION,
            seed=int(rng.integers(2**31)),
        )
        best = leader = self.refined(start.point, start.own, 2)  # of all, of this generation
        follow = self.sensitivity(leader.point, leader.own)  # how own parameters follow the rig
        parents, parents_own = leader.point[None], leader.own[None]
        for generation in range(1, generations + 1):
            asked = [search.ask() for _ in range(POPULATION)]
            points = np.array(asked)
            begun = _inherited(points, parents, parents_own, follow)
            begun = np.clip(begun, self.bounds("low"), self.bounds("high"))
            own, costs = (x[:, :, 0] for x in self.fitted(points, begun[:, :, None], 1))
            whole = totals(self.space, costs, points)
            search.tell([*zip(asked, whole.tolist(), strict=True)])
            k = int(whole.argmin())
            leader = Found(self.space, points[k], own[k], costs[k])
            # The better half, from which CMA-ES moves its mean, are the next generation's parents.
            good = np.argsort(whole)[: POPULATION // 2]
            parents, parents_own = points[good], own[good]
            if generation % RESCREEN == 0:
                leader = self.rescreened(leader, rng, *RESCREENED)
                parents, parents_own = leader.point[None], leader.own[None]
            best = best_of([best, leader])
            if generation % REFRESH == 0:
                follow = self.sensitivity(leader.point, leader.own)
            progress(f"generation {generation}", best.total)
            if search._sigma < NARROW:
                break
        return best


def _unknowns(search: Search, point: Array, own: Array, weight: float) -> Array:
    """Derivatives of all residuals (columns: those of each trial, then ``weight`` times those of
    measurements beside the trials and of priors) by the unknowns (rows: the rig's d coordinates,
    then each trial's fitted own parameters in units of their scales)."""
    d = len(point)
    each = search.each(lambda k: search.slopes(point, own, k))
    points, steps = _perturbed(point, STEP)
    beside = search.space.residuals(points)
    beside = weight * (beside[1:] - beside[0]) / steps[:, None]
    # Own parameters move the residuals of their own trial alone: a block for each trial.
    alone: Array = np.asarray(block_diag(*(slopes[d:] for slopes in each)))
    shared = np.hstack([slopes[:d] for slopes in each])
    return np.block([[shared, beside], [alone, np.zeros((len(alone), beside.shape[1]))]])


def deviations(search: Search, found: Found, samples: float) -> Array:
    """Standard deviations of the rig's coordinates, with the own parameters fitted anew, from the
    cost's curvature at the solution: they cover its neighbourhood, no other minimum. The solution
    may be of another suspension law than ``search``.

    -2 ln L is the effective ``samples`` times ln cost, so the covariance is the inverse of the
    normal matrix times the sum of squares over the samples (G. A. F. Seber, C. J. Wild, *Nonlinear
    Regression*, Wiley 1989, section 5.1).
    """
    d, total = len(found.point), float(found.costs.sum())
    alike = replace(search, space=found.space)
    slopes = _unknowns(alike, found.point, found.own, _weight(found))
    normal = np.einsum("ij,kj->ik", slopes, slopes)
    normal += TINY * np.trace(normal) * np.eye(len(normal))  # an unknown may move nothing
    covariance = np.linalg.inv(normal) * total / samples
    return np.asarray(np.sqrt(np.diag(covariance)[:d]))


def _weight(found: Found) -> float:
    """The factor w on residuals r of measurements beside the trials and of priors, with which
    Σ cost + w² Σ r² is proportional to ``totals``."""
    return float(np.sqrt(found.costs.mean() / SAMPLES))


def finish(search: Search, found: Found, steps: int) -> Found:
    """The solution after at most ``steps`` steps of least squares, if they lower its cost.

    The unknowns x are the point, then the fitted own parameters in units of their scales. The
    residuals are those of the trials, then those of measurements beside them and of priors.
    """
    space, targets, d = search.space, search.targets, len(found.point)
    low, high, scale = (search.bounds(name) for name in ("low", "high", "scale"))
    free = scale > 0.0
    weight = _weight(found)

    def split(x: Array) -> tuple[Array, Array]:
        """The point and the own parameters (trials × OWN)."""
        own = found.own.copy()
        own[free] = x[d:] * scale[free]
        return x[:d], own

    def residuals(x: Array) -> Array:
        point, own = split(x)
        rig = space.rigs(point[None])
        rows = search.each(lambda k: simulate(targets[k], rig, own[k][None])[1][0])
        return np.concatenate([*rows, weight * space.residuals(point[None])[0]])

    def slopes(x: Array) -> Array:
        return _unknowns(search, *split(x), weight).T

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
    return best_of([found, search.refined(*split(fitted.x), 2)])
