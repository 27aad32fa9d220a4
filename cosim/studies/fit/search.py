"""The separable fit: µ_k (and µ_p) shared by all trials, a normal force for each.

Given µ_k and µ_p the trials have nothing in common, so that a fit of eleven numbers is ten
searches in one dimension for each µ_k on a line. The error jumps where a parameter makes the part
miss a stick, so the searches use grids, finer and finer, and no slope.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.mechanics.part import PartMotion
from cosim.studies.fit.cases import Case, Parameters, Solver
from cosim.trials import published

FORCES = 49  # on the first grid of normal forces
CANDIDATES = 2  # minima of it that are looked into
ROUNDS, POINTS = 3, 9  # finer and finer grids around each
MU_K_STEPS = (0.02, 0.004, 0.0008)
MU_PLATE_STEPS = (0.05, 0.0125, 0.004)
LARGEST_MU_PLATE = 0.3  # as measured with the plate alone: 0.18


@dataclass(frozen=True)
class Fit:
    """What was found, and all that was tried on the way.

    ``tried`` holds rows (µ_p, µ_k); ``errors`` [m] and ``forces`` [weights] have a row for each of
    them and a column for each case; ``best`` is the row with the smallest mean error.
    """

    tried: Array
    errors: Array
    forces: Array

    @property
    def best(self) -> int:
        return int(self.errors.mean(axis=1).argmin())

    @property
    def mu_plate(self) -> float:
        return float(self.tried[self.best, 0])

    @property
    def mu_k(self) -> float:
        return float(self.tried[self.best, 1])

    @property
    def at_best_plate(self) -> npt.NDArray[np.bool_]:
        """The rows with the best µ_p."""
        return self.tried[:, 0] == self.tried[self.best, 0]

    def profile(self) -> tuple[Array, Array]:
        """µ_k, rising, and the smallest mean error [m] with each, at the best µ_p."""
        rows = self.at_best_plate
        return self.tried[rows, 1], self.errors[rows].mean(axis=1)

    def leave_one_out(self) -> tuple[Array, Array]:
        """Each case's error [m] with the µ_k that is best for the others, and these µ_k.

        The normal force belongs to the case and is fitted to it, given that µ_k (and µ_p).
        """
        cases = self.errors.shape[1]
        if cases < 2:
            return self.errors[self.best], self.tried[[self.best], 1]
        others = self.errors.sum(axis=1)[:, None] - self.errors
        rows = others.argmin(axis=0)
        return self.errors[rows, np.arange(cases)], self.tried[rows, 1]


def best_force(
    case: Case, mu_k: float, mu_plate: float, mu_s: float, solver: Solver
) -> tuple[float, float]:
    """The normal force [weights] with the smallest error in a case, and that error [m]."""
    low, high = case.bounds
    law = (mu_k, mu_plate, mu_s, solver)
    grid = np.linspace(low, high, FORCES)
    found = case.errors(grid, *law)
    padded = np.concatenate([[np.inf], found, [np.inf]])
    minima = np.flatnonzero((found <= padded[:-2]) & (found <= padded[2:]))
    chosen = minima[np.argsort(found[minima], kind="stable")[:CANDIDATES]]
    best, error = float(grid[chosen[0]]), float(found[chosen[0]])
    for start in chosen:
        middle, width = float(grid[start]), float(grid[1] - grid[0])
        for _ in range(ROUNDS):
            near = np.clip(middle + width * np.linspace(-1, 1, POINTS), low, high)
            values = case.errors(near, *law)
            i = int(values.argmin())
            middle, width = float(near[i]), width * 2 / (POINTS - 1)
            if values[i] < error:
                best, error = middle, float(values[i])
    return best, error


def search(cases: Sequence[Case], solver: Solver = "exact", plate: bool = False) -> Fit:
    """Fit µ_k in 0…µ_s, each normal force within its bounds and, with ``plate``, µ_p in 0…0.3."""
    mu_s = published.MU_S
    done: dict[tuple[float, float], Array] = {}  # the forces and the errors

    def look(plates: Iterable[float], mu_ks: Iterable[float]) -> None:
        for pair in product(plates, mu_ks):
            key = (round(pair[0], 9), round(pair[1], 9))
            if key not in done:
                pairs = [best_force(case, key[1], key[0], mu_s, solver) for case in cases]
                done[key] = np.transpose(pairs)

    def best() -> tuple[float, float]:
        return min(done, key=lambda key: sum(done[key][1]))

    plates = np.arange(0, LARGEST_MU_PLATE + 1e-9, MU_PLATE_STEPS[0]) if plate else [0.0]
    look(plates, _line(0.0, mu_s, MU_K_STEPS[0] * (2 if plate else 1)))
    for before, step, wide, narrow in zip(
        MU_K_STEPS, MU_K_STEPS[1:], MU_PLATE_STEPS, MU_PLATE_STEPS[1:], strict=False
    ):
        mu_plate, mu_k = best()
        low, high = max(0.0, mu_plate - wide), min(LARGEST_MU_PLATE, mu_plate + wide)
        plates = _line(low, high, narrow) if plate else [0.0]
        look(plates, _line(max(0.0, mu_k - before), min(mu_s, mu_k + before), step))
    if plate:  # the whole profile over µ_k, at the best µ_p
        look([best()[0]], _line(0.0, mu_s, MU_K_STEPS[0]))
    tried = sorted(done)
    forces, errors = (np.array([done[key][k] for key in tried]) for k in (0, 1))
    return Fit(np.array(tried), errors, forces)


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """Trials with their parameters and simulated motions; ``fit`` if they were fitted."""

    cases: list[Case]
    parameters: list[Parameters]
    motions: list[PartMotion]
    fit: Fit | None
    numbers: dict[str, Any]
    """What ``fit.json`` holds; millimetres, m_P g and shares in per cent as the names say."""


def _line(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, max(2, round((high - low) / step) + 1))
