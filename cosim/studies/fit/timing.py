"""How fast the exact solution and the separable fit are beside what they replace.

Each comparison is made side by side in one process, so that the machine's mood cancels.
"""

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter

import numpy as np

from cosim.mechanics import part
from cosim.studies.fit.cases import Case, Solver
from cosim.studies.fit.search import search
from cosim.trials import published


def solvers(cases: Sequence[Case], rounds: int = 51) -> dict[str, float]:
    """Seconds that each compiled solver takes for all cases, medians, and exact over published.

    Both are called straight, with buffers made beforehand. The exact solution is asked for the
    heights at the tracked times; the published scheme gives them at its steps.
    """
    calls = {solver: [_call(case, solver) for case in cases] for solver in ("exact", "published")}
    taken: dict[str, list[float]] = {solver: [] for solver in calls}
    for _ in range(rounds):
        for solver, todo in calls.items():
            start = perf_counter()
            for call in todo:
                call()
            taken[solver].append(perf_counter() - start)
    seconds = {solver: median(values) for solver, values in taken.items()}
    ratios = [e / p for e, p in zip(taken["exact"], taken["published"], strict=True)]
    return {**seconds, "ratio": median(ratios)}


def fits(cases: Sequence[Case], generations: int = 1000, seed: int = 1) -> dict[str, float]:
    """The separable fit beside SciPy's differential evolution of all numbers at once.

    Both have the same bounds and the same compiled measure of the error. Gives seconds and mean
    errors [mm] of either, ``speedup`` (global over separable) and the global search's evaluations.
    """
    from scipy.optimize import differential_evolution

    start = perf_counter()
    found = search(cases)
    separable = perf_counter() - start

    def error(numbers: np.ndarray) -> float:
        mu_k, forces = float(numbers[0]), numbers[1:, None]
        return sum(
            float(case.errors(force, mu_k, 0.0, published.MU_S, "exact")[0])
            for case, force in zip(cases, forces, strict=True)
        )

    bounds = [(0.0, published.MU_S), *(case.bounds for case in cases)]
    start = perf_counter()
    # Without the polish: the error has steps, and no slope to follow.
    result = differential_evolution(error, bounds, maxiter=generations, rng=seed, polish=False)
    taken = perf_counter() - start
    return {
        "separable": separable,
        "separable_error_mm": float(found.errors[found.best].mean() * 1e3),
        "global": taken,
        "global_error_mm": float(result.fun / len(cases) * 1e3),
        "global_evaluations": float(result.nfev),
        "speedup": taken / separable,
    }


def _call(case: Case, solver: Solver) -> Callable[[], int]:
    number = case.trial.number or 0
    fitted = dict(enumerate(published.FORCES_FITTED, 1)).get(number, np.mean(case.bounds))
    force = float(fitted) * published.GRAVITY
    law = part.friction_law(published.MU_S, published.MU_K_FITTED, force, published.GRAVITY, 0.0)
    length = len(case.time) if solver == "exact" else len(case.grid)
    rows = np.empty((3, length))
    library, surface = part.part_library(), (len(case.time), case.time.ctypes.data)
    surface = (*surface, case.v_surface.ctypes.data, 1, law.ctypes.data, 0.0, case.v0)
    result = tuple(row.ctypes.data for row in rows)
    if solver == "exact":
        arguments, function = (*surface, length, None, *result), library.part_exact
    else:
        steps = (part.PUBLISHED_STEP, part.PUBLISHED_V_MIN, length - 1)
        arguments, function = (*surface, *steps, *result), library.part_threshold

    def call(buffers: object = (law, rows)) -> int:  # which live as long as the call
        return function(*arguments)

    return call
