"""How far a measurement narrows what is wanted, over a sample of what may be true."""

from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array

ENDS = (0.05, 0.95)
"""Of an interval, as shares of the weight."""

FEWEST = 20.0
"""Effective rigs that an interval stands on at least: of 19 equally likely ones the ends of a 90 %
interval are the least and the greatest, so of fewer it would be too narrow. A measurement finer
than the sample counts for no more than the sample can tell."""

DRAWS = 8
"""Of the measurement's noise, on each rig."""


@dataclass(frozen=True, eq=False)
class Worth:
    """Of one measurement for one target, over rigs taken as the truth and left out."""

    width: float
    """The mean of the intervals' widths."""
    error: float
    """Its standard error."""
    held: float
    """The share of them that holds the truth."""
    each: Array
    """The widths, rig by rig, means over the noise."""


def likely(values: Array, shown: Array, sd: Array) -> Array:
    """Weights of rigs with ``values`` (n × numbers) where ``shown`` was measured to ``sd``."""
    # -2 ln L of each rig.
    square = (((values - shown) / sd) ** 2).sum(axis=1)
    # Rigs are few: where next to none is as likely as the truth, the weights are made flatter until
    # the effective number of rigs, (Σ w)² / Σ w², suffices.
    square = square - square.min()
    while True:
        weights = np.exp(-0.5 * square)
        if weights.sum() ** 2 >= min(FEWEST, 0.5 * len(square)) * (weights**2).sum():
            return weights
        square = square / 1.3


def interval(targets: Array, weights: Array) -> Array:
    """The ends of the 90 % interval of each target (n × targets), by weighted quantiles: ends ×
    targets. The i-th of n equally likely values, n the effective number, stands at i/(n + 1): so
    often a further one lies below it (Weibull's plotting position, 1939)."""
    weights = weights / weights.sum()
    n, columns = 1.0 / (weights**2).sum(), []
    for column in targets.T:
        order = np.argsort(column)
        share = (n * (np.cumsum(weights[order]) - 0.5 * weights[order]) + 0.5) / (n + 1.0)
        columns.append(np.interp(ENDS, share, column[order]))
    return np.array(columns).T


def worth(values: Array, sd: Array, targets: Array, rng: np.random.Generator) -> list[Worth]:
    """Of a measurement whose ``values`` and ``sd`` are rigs × numbers, for each target (rigs ×
    targets); of none where there are no numbers."""
    # Each rig in turn is the truth, and the others are what is known before the measurement.
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
    told = zip(each.mean(axis=0), errors, held.mean(axis=(0, 1)), each.T, strict=True)
    return [Worth(float(width), float(error), float(h), one) for width, error, h, one in told]


def chance(targets: Array, rng: np.random.Generator) -> list[Worth]:
    """What a fine measurement of something that has nothing to do with the targets leaves, since
    its intervals stand on fewer rigs: of four, in turn, the means."""
    n = len(targets)
    found = [worth(rng.random((n, 1)), np.full((n, 1), 1e-3), targets, rng) for _ in range(4)]
    rows = [[[one.width, one.error, one.held, *one.each] for one in each] for each in found]
    means: Array = np.mean(rows, axis=0)
    return [Worth(float(one[0]), float(one[1]), float(one[2]), one[3:]) for one in means]
