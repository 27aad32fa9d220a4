"""How far a measurement narrows the interval of a target, over a sample of possible rigs.

Each rig in turn is the truth and left out of the sample: the measurement is simulated on it with
noise, the other rigs are weighted by their likelihood, and their weighted quantiles give the
interval that the measurement would leave (leave-one-out cross-validation of importance weights).
"""

from typing import NamedTuple

import numpy as np

from cosim.arrays import Array

ENDS = (0.05, 0.95)
"""Ends of an interval, as quantiles of the weight."""

FEWEST = 20.0
"""Least effective number of rigs for an interval: with 19 equally likely ones the ends of a 90 %
interval are the least and the greatest value, with fewer the interval would be too narrow. So the
sample's size limits how much a very accurate measurement counts."""

DRAWS = 8
"""Draws of the measurement's noise on each rig."""


class Worth(NamedTuple):
    """The worth of one measurement for each target, over rigs taken as the truth and left out."""

    width: Array
    """Mean width of the intervals, by target."""
    error: Array
    """Standard error of this mean."""
    held: Array
    """Share of the intervals that contain the truth."""
    each: Array
    """Widths for each true rig (rigs × targets), means over the draws of the noise."""


def likely(values: Array, shown: Array, sd: Array) -> Array:
    """Weights (n) of rigs with ``values`` (n × numbers) after ``shown`` (numbers) was measured with
    standard deviations ``sd``: normal likelihoods, flattened where too few rigs would count."""
    square = (((values - shown) / sd) ** 2).sum(axis=1)
    # Tempering: the likelihood is raised to smaller and smaller powers until the effective number
    # of rigs, (Σ w)² / Σ w², suffices.
    square = square - square.min()
    while True:
        weights = np.exp(-0.5 * square)
        if weights.sum() ** 2 >= min(FEWEST, 0.5 * len(square)) * (weights**2).sum():
            return weights
        square = square / 1.3


def interval(targets: Array, weights: Array) -> Array:
    """The ends of the 90 % interval of each target (n × targets), by weighted quantiles: ends ×
    targets. Of n equally likely values, n the effective number, the i-th is the quantile i/(n + 1),
    the expected share of further values below it (Weibull's plotting position, 1939)."""
    weights = weights / weights.sum()
    n, columns = 1.0 / (weights**2).sum(), []
    for column in targets.T:
        order = np.argsort(column)
        share = (n * (np.cumsum(weights[order]) - 0.5 * weights[order]) + 0.5) / (n + 1.0)
        columns.append(np.interp(ENDS, share, column[order]))
    return np.array(columns).T


def worth(values: Array, sd: Array, targets: Array, rng: np.random.Generator) -> Worth:
    """The worth, for ``targets`` (rigs × targets), of a measurement whose ``values`` and ``sd`` are
    rigs × numbers; without numbers, that of no measurement."""
    n = len(targets)
    widths, held = (np.empty((n, DRAWS, targets.shape[1])) for _ in range(2))
    for truth in range(n):
        others = np.arange(n) != truth
        for draw in range(DRAWS):
            shown = values[truth] + sd[truth] * rng.standard_normal(values.shape[1])
            weights = likely(values[others], shown, sd[truth])
            low, high = interval(targets[others], weights)
            widths[truth, draw] = high - low
            held[truth, draw] = (low <= targets[truth]) & (targets[truth] <= high)
    each = widths.mean(axis=1)
    errors = each.std(axis=0, ddof=1) / np.sqrt(n)
    return Worth(each.mean(axis=0), errors, held.mean(axis=(0, 1)), each)


def chance(targets: Array, rng: np.random.Generator) -> Worth:
    """The worth of an accurate measurement that does not depend on the targets, the mean of four:
    its intervals are narrower only because fewer rigs count."""
    n = len(targets)
    found = [worth(rng.random((n, 1)), np.full((n, 1), 1e-3), targets, rng) for _ in range(4)]
    return Worth(*(np.mean(alike, axis=0) for alike in zip(*found, strict=True)))
