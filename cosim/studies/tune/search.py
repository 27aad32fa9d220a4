"""The search: a Latin hypercube to hear the whole range, then the cross-entropy method.

The objective jumps where a mode of motion ends, is ragged where motion is chaotic, and is missing
where a scene cannot be: no method that trusts a slope finds its way there. Its heights are narrow
ridges aslant to the knobs, which samples from a normal distribution can lie along.
"""

from collections.abc import Callable

import numpy as np

from cosim.arrays import Array

EXPLORED = 0.4
"""Share of the runs that listens to the whole range."""

GENERATION = 10
"""Samples that are drawn at once."""

ELITE = 5
"""Best points so far, whose mean and covariance the next samples are drawn with."""

INFLATION = 2.0
"""Of that covariance: with less, the samples close in on the first ridge that they find."""

LEAST_SPREAD = 1e-3
"""Standard deviation that is left in every direction, as a share of the range."""


def search(
    costs: Callable[[Array], tuple[Array, int]],
    keys: int,
    runs: int,
    seed: int,
    hints: Array | None = None,
) -> None:
    """Ask ``costs`` for at most ``runs`` points of the unit cube of ``keys`` dimensions.

    ``costs`` takes points (rows) and gives a cost each, inf where there is none, and how many of
    them it had to run. ``hints`` (rows) are asked for first, in place of most of the exploration.
    R. Y. Rubinstein, "The cross-entropy method for combinatorial and continuous optimization",
    Methodology and Computing in Applied Probability 1 (1999), with the elite of all samples so far
    and every other sample drawn about the best of them instead of about their mean.
    """
    from scipy.stats import qmc

    generator = np.random.default_rng(seed)
    explored = max(ELITE, round(EXPLORED * runs))
    points = np.empty((0, keys)) if hints is None else hints[:explored]
    spread = max(explored - len(points), min(GENERATION, runs - len(points)))
    points = np.vstack([points, qmc.LatinHypercube(keys, rng=generator).random(spread)])
    found, taken = costs(points)
    while taken < runs:
        best = points[np.argsort(found, kind="stable")[:ELITE]]
        covariance = INFLATION * np.cov(best.T).reshape(keys, keys)
        covariance += LEAST_SPREAD**2 * np.eye(keys)
        size = min(GENERATION, runs - taken)
        steps = generator.multivariate_normal(np.zeros(keys), covariance, size)
        about = np.where(generator.random((size, 1)) < 0.5, best[0], best.mean(axis=0))
        samples = np.clip(about + steps, 0.0, 1.0)
        heard, new = costs(samples)
        if not new:  # whole numbers leave no more to ask for
            return
        points, found = np.vstack([points, samples]), np.concatenate([found, heard])
        taken += new


def apart(points: Array, distance: float) -> Array:
    """The first of ``points`` (rows), and each later one that is ``distance`` from all kept."""
    kept: list[Array] = []
    for point in points:
        if all(np.abs(point - other).max() >= distance for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, points.shape[1])
