"""The search: a Latin hypercube to hear the whole range, then differential evolution from its best.

The objective jumps where a mode of motion ends, is ragged where motion is chaotic, and is missing
where a scene cannot be: no method that trusts a slope finds its way there. Evolution from a random
start needs half again as many runs; a covariance search from the best point settles too soon.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EXPLORED = 0.35
"""Share of the runs that listen to the whole range."""

POPULATION = 0.06
"""Size of a generation over the number of runs."""

_SMALLEST = 5
"""SciPy's least population."""


def search(costs: Callable[[Array], Array], keys: int, runs: int, seed: int) -> None:
    """Ask ``costs`` for at most ``runs`` points of the unit cube of ``keys`` dimensions.

    ``costs`` takes points (rows) and gives a cost each, inf where there is none; it keeps what it
    learns. A point may be asked for again. Rainer Storn, Kenneth Price, "Differential evolution",
    J. Global Optimization 11 (1997), strategy best/1/bin of SciPy.
    """
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    generator = np.random.default_rng(seed)
    explored = max(_SMALLEST, round(EXPLORED * runs))
    population = max(_SMALLEST, round(POPULATION * runs))
    points = qmc.LatinHypercube(keys, rng=generator).random(explored)
    heard = costs(points)
    generations = (runs - explored) // population
    if generations < 1:
        return
    evolve: Any = differential_evolution  # whose stubs know no array for init
    evolve(
        lambda columns: costs(columns.T),
        bounds=[(0.0, 1.0)] * keys,
        init=points[np.argsort(heard, kind="stable")[:population]],
        maxiter=generations,
        mutation=(0.3, 0.8),
        recombination=0.9,
        tol=0.0,
        polish=False,
        rng=generator,
        vectorized=True,
        updating="deferred",
    )
