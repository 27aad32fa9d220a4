"""A tracked trial as a task for a simulation, and the error that a set of parameters makes in it.

Procedure and measure are the authors': of each trial's rows the first three and the last two are
left out, times and heights count from the first that is kept, the part starts with its tracked
velocity, and the error is the mean of |z measured − z simulated| every 0.1 ms, in mm and as a share
of the trial's largest measured |z|. Source: see `cosim.trials.published`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.mechanics import part
from cosim.trials import published
from cosim.trials.tracked import Trial

Solver = Literal["exact", "published"]

FIRST_ROW, LAST_ROWS = 3, 2
STEP = part.PUBLISHED_STEP


@dataclass(frozen=True)
class Parameters:
    """What the part is subject to; the normal force in weights of the part."""

    mu_k: float
    force: float
    mu_s: float = published.MU_S
    mu_plate: float = 0.0


class Case:
    """One trial, ready to be simulated; SI units."""

    def __init__(self, trial: Trial) -> None:
        rows = slice(FIRST_ROW, len(trial.time) - LAST_ROWS)
        self.trial = trial
        self.time: Array = np.ascontiguousarray(trial.time[rows] - trial.time[FIRST_ROW])
        self.v_surface: Array = np.ascontiguousarray(trial.platform.v[rows])
        self.z_surface: Array = trial.platform.z[rows] - trial.platform.z[FIRST_ROW]
        self.z_part: Array = trial.part.z[rows] - trial.part.z[FIRST_ROW]
        self.v0 = float(trial.part.v[FIRST_ROW])
        steps = int(np.floor(self.time[-1] / STEP + 1e-6))
        self.grid: Array = np.arange(steps + 1, dtype=np.float64) * STEP
        self.measured: Array = np.interp(self.grid, self.time, self.z_part)
        self.largest = float(np.abs(self.z_part).max())
        self._scratch = np.empty(3 * len(self.grid))
        measured = dict(enumerate(published.FORCES_MEASURED, 1))
        self.measured_force = measured.get(trial.number or 0)  # in weights of the part
        bounds = dict(enumerate(published.FORCE_BOUNDS, 1))
        self.bounds = bounds.get(trial.number or 0, published.OTHER_BOUNDS)

    def motion(self, parameters: Parameters, solver: Solver) -> part.PartMotion:
        """The part's simulated motion, every 0.1 ms."""
        solve = part.exact if solver == "exact" else part.published
        return solve(
            self.time,
            self.v_surface,
            mu_s=parameters.mu_s,
            mu_k=parameters.mu_k,
            force_per_mass=parameters.force * published.GRAVITY,
            gravity=published.GRAVITY,
            mu_plate=parameters.mu_plate,
            v0=self.v0,
            output=self.grid,
        )

    def errors(
        self, forces: npt.ArrayLike, mu_k: float, mu_plate: float, mu_s: float, solver: Solver
    ) -> Array:
        """The mean errors [m] for several normal forces [weights of the part], in one call."""
        weights = np.asarray(forces, dtype=np.float64) * published.GRAVITY
        laws = np.full((len(weights), 4), published.GRAVITY)
        laws[:, :3] = np.multiply.outer(weights, (mu_s, mu_k, mu_plate))
        found = np.empty(len(weights))
        part.part_library().part_errors(
            *(len(self.time), self.time.ctypes.data, self.v_surface.ctypes.data, self.v0),
            *(len(laws), laws.ctypes.data, STEP if solver == "published" else 0.0),
            *(part.PUBLISHED_V_MIN, len(self.grid), self.grid.ctypes.data),
            *(self.measured.ctypes.data, self._scratch.ctypes.data, found.ctypes.data),
        )
        return found

    def straight_line_error(self) -> float:
        """The mean error [m] of the straight line that fits the measured heights best."""
        line = np.polynomial.Polynomial.fit(self.grid, self.measured, 1)
        return float(np.abs(line(self.grid) - self.measured).mean())
