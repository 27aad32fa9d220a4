"""A tracked trial by its authors' procedure: the surface as tracked, the part simulated on it.

Of each trial's rows the first three and the last two are left out, times and heights count from the
first that is kept, the surface's tracked velocity is joined by straight lines, the part starts with
its own tracked velocity, and the error is the mean of |z measured − z simulated| every 0.1 ms.
Source: see `cosim.trials.published`. Added to it is a springed plate that moves as tracked.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosim.arrays import Array
from cosim.mechanics import part
from cosim.studies.fit.results import STEP, Shown
from cosim.studies.fit.slides import plate_velocity
from cosim.trials import published
from cosim.trials.tracked import Trial

Solver = Literal["exact", "published"]

FIRST_ROW, LAST_ROWS = 3, 2


@dataclass(frozen=True)
class Parameters:
    """What the part is subject to; the normal force in weights of the part."""

    mu_k: float
    force: float
    mu_s: float = published.MU_S


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
        self._v_plate = plate_velocity(trial)[rows]

    def motion(self, parameters: Parameters, solver: Solver) -> part.PartMotion:
        """The part's simulated motion, every 0.1 ms; the plate at rest."""
        solve = part.exact if solver == "exact" else part.published
        return solve(
            self.time,
            self.v_surface,
            mu_s=parameters.mu_s,
            mu_k=parameters.mu_k,
            force_per_mass=parameters.force * published.GRAVITY,
            gravity=published.GRAVITY,
            v0=self.v0,
            output=self.grid,
        )

    def heights(self, law: Array) -> Array:
        """The part's heights [m] every 0.1 ms with a law (a row of `part.heights`), over a plate
        that moves as tracked."""
        steps = np.diff(self.time)
        # Seen from the plate, and back.
        v, v0 = self.v_surface - self._v_plate, self.v0 - float(self._v_plate[0])
        pull = np.diff(self._v_plate) / steps
        means = (self._v_plate[1:] + self._v_plate[:-1]) / 2
        plate = np.interp(self.grid, self.time, np.append(0.0, np.cumsum(steps * means)))
        return part.heights(self.time, v, law[None], self.grid, v0, pull)[0] + plate

    def shown(self, z: Array) -> Shown:
        """The trial with the part's simulated heights ``z`` [m] every 0.1 ms."""
        return Shown(self.trial.name, self.time, self.z_surface, self.z_part, (self.grid, z))
