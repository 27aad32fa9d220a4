"""A tracked trial by its authors' procedure: the surface as tracked, the part simulated on it.

Of each trial's rows the first three and the last two are left out, times and heights count from the
first that is kept, the surface's tracked velocity is joined by straight lines, the part starts with
its own tracked velocity, and the error is the mean of |z measured − z simulated| every 0.1 ms.
Source: see `cosim.trials.published`.
"""

from typing import Literal

import numpy as np

from cosim.mechanics import part
from cosim.studies.fit.results import Shown
from cosim.trials import published
from cosim.trials.tracked import Trial

Solver = Literal["exact", "published"]

FIRST_ROW, LAST_ROWS = 3, 2


def simulated(trial: Trial, force: float, solver: Solver) -> tuple[Shown, part.PartMotion]:
    """A trial with the published friction and a normal force in weights of the part."""
    rows = slice(FIRST_ROW, len(trial.time) - LAST_ROWS)
    time = np.ascontiguousarray(trial.time[rows] - trial.time[FIRST_ROW])
    steps = int(np.floor(time[-1] / part.PUBLISHED_STEP + 1e-6))
    solve = part.exact if solver == "exact" else part.published
    motion = solve(
        time,
        np.ascontiguousarray(trial.platform.v[rows]),
        mu_s=published.MU_S,
        mu_k=published.MU_K_FITTED,
        force_per_mass=force * published.GRAVITY,
        gravity=published.GRAVITY,
        v0=float(trial.part.v[FIRST_ROW]),
        output=np.arange(steps + 1) * part.PUBLISHED_STEP,
    )
    z_surface, z_part = (x.z[rows] - x.z[FIRST_ROW] for x in (trial.platform, trial.part))
    return Shown(trial.name, time, z_surface, z_part, (motion.time, motion.z)), motion
