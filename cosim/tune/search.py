"""The search: a Latin hypercube to hear the whole range, differential evolution from its best, and
evolution again in ever narrower boxes about the best.

The objective jumps where a mode of motion ends, is ragged where motion is chaotic, and is missing
where a scene cannot be: no method that trusts a slope finds its way there. Where it is ragged the
peaks are a few per cent of a knob wide, which is what the boxes are for.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EXPLORED, EVOLVED = 0.35, 0.3
"""Shares of the runs that listen to the whole range, and that evolve in it."""

GENERATIONS = 5
"""Of the evolution in the whole range."""

BOXES = (0.06, 0.03, 0.015)
"""Half widths of the boxes, as shares of the ranges."""

BOX_GENERATIONS = 3

_SMALLEST = 5
"""SciPy's least population."""


def search(costs: Callable[[Array], tuple[Array, int]], keys: int, runs: int, seed: int) -> None:
    """Ask ``costs`` for at most ``runs`` points of the unit cube of ``keys`` dimensions.

    ``costs`` takes points (rows) and gives a cost each, inf where there is none, and how many of
    them it had to run: it keeps what it learns, for a point may be asked for again. Few runs leave
    out the last boxes. Rainer Storn, Kenneth Price, "Differential evolution", J. Global
    Optimization 11 (1997), strategy best/1/bin of SciPy.
    """
    from scipy.stats import qmc

    generator = np.random.default_rng(seed)
    best, least = np.full(keys, 0.5), np.inf
    left = runs

    def heard(points: Array) -> Array:
        nonlocal best, least, left
        found, new = costs(points)
        left -= new
        if found.min() < least:
            best, least = points[np.argmin(found)].copy(), found.min()
        return found

    def spread(count: int) -> Array:
        return qmc.LatinHypercube(keys, rng=generator).random(count)

    points = spread(max(_SMALLEST, round(EXPLORED * runs)))
    ranked = points[np.argsort(heard(points), kind="stable")]
    population = max(_SMALLEST, round(EVOLVED * runs / GENERATIONS))
    generations = min(GENERATIONS, left // population)
    _evolve(heard, np.zeros(keys), np.ones(keys), ranked[:population], generations, generator)
    size = max(_SMALLEST, round((1.0 - EXPLORED - EVOLVED) * runs / len(BOXES) / BOX_GENERATIONS))
    for width in BOXES:
        if left < BOX_GENERATIONS * size:
            return
        low, high = np.maximum(best - width, 0.0), np.minimum(best + width, 1.0)
        points = low + spread(size) * (high - low)
        found = heard(points)
        points[np.argmax(found)] = best
        _evolve(heard, low, high, points, BOX_GENERATIONS - 1, generator)


def _evolve(
    heard: Callable[[Array], Array],
    low: Array,
    high: Array,
    first: Array,
    generations: int,
    generator: np.random.Generator,
) -> None:
    """Generations after ``first``, whose costs are known, within ``low`` … ``high``."""
    from scipy.optimize import differential_evolution

    if generations < 1 or len(first) < _SMALLEST:
        return
    evolve: Any = differential_evolution  # whose stubs know no array for init
    evolve(
        lambda columns: heard(columns.T),
        bounds=list(zip(low, high, strict=True)),
        init=first,
        maxiter=generations,
        mutation=(0.3, 0.8),
        recombination=0.9,
        tol=0.0,
        polish=False,
        rng=generator,
        vectorized=True,
        updating="deferred",
    )
