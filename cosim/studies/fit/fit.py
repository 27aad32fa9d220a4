"""Friction and normal forces from tracked trials, or the trials by the published parameters.

Tracks hold accelerations, no forces: they determine µ_k F_n/m of each trial, and one µ_p/µ_k for
all. With a given µ_k each trial's normal force follows; with known normal forces, µ_k.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files.atomic import write_json
from cosim.files.picture import Picture
from cosim.mechanics import part
from cosim.studies.fit import figures
from cosim.studies.fit.forces import Force, read_forces
from cosim.studies.fit.results import Shown, change, together, told
from cosim.studies.fit.search import FRICTIONS, LARGEST_RATIO, Fit, Found, Interval, search
from cosim.studies.fit.slides import Slide, noise_of
from cosim.studies.report import Row, write_csv
from cosim.trials import published
from cosim.trials.tracked import Trial, read_folder
from cosim.typed import typed

Solver = Literal["exact", "published"]

POINTS = 100  # of the line that is drawn for each slide

FIRST_ROW, LAST_ROWS = 3, 2
"""Rows that the authors' procedure leaves out at the begin and at the end of a trial."""


@dataclass(frozen=True, eq=False, repr=False)
class TrialResults:
    """Trials with their parameters and simulated motions: ``numbers``, figures and files."""

    shown: Sequence[Shown]
    forces: Sequence[Force]
    """What is known of each trial's normal force beside it."""
    numbers: dict[str, Any]
    """What ``fit.json`` holds; units as the names say, forces in weights of the part."""

    def plot(self) -> Picture:
        """Measured and predicted heights of the part, a panel for each trial."""
        return figures.trials(self.shown, self.numbers)

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``fit.json``, ``fit.csv`` and the figures ``fit-*.png``."""
        out = Path(folder)
        write_json(out / "fit.json", self.numbers)
        write_csv(out / "fit.csv", [_cells(row) for row in self.numbers["trials"]])
        self.plot().write(out / "fit-trials.png")
        figures.forces(self.forces, self.numbers).write(out / "fit-forces.png")
        if "profiles" in self.numbers:
            figures.profiles(self.numbers).write(out / "fit-profile.png")

    def __repr__(self) -> str:
        return told(self.numbers)


LEAST_MU_K = 1e-3
"""Below any dry pair of surfaces; a smaller µ_k would give absurd normal forces, µ_k F_n/µ_k."""


@typed
def fit(
    trials: str | os.PathLike[str],
    *,
    forces: str | os.PathLike[str] | None = None,
    mu_k: float | Literal["free"] = published.MU_K,
    plate: bool = True,
    evaluate: Literal["published"] | None = None,
    solver: Solver = "exact",
) -> TrialResults:
    """Fit µ_k F_n of each tracked trial (CSV) of a folder, and µ_plate.

    ``forces`` is a file with what is known of normal forces (:mod:`cosim.studies.fit.forces`), or
    “published”. The normal forces follow from ``mu_k``, or, “free”, it follows from bounds of
    forces. The spring-loaded plate moves as tracked, or rests where it was not; without ``plate``
    it has no friction.

    ``evaluate="published"`` takes the paper's µ_k and forces instead, by the authors' procedure,
    with the exact solution or with their scheme (``solver``). Raises BadInput.

    ``numbers`` of what comes back is what ``fit.json`` holds: ``trials``, a dictionary each, with
    ``normal_force_weights`` and what was measured of it, ``mean_error_mm`` and others whose names
    have their units, means of these over the trials, and the coefficients of friction.
    """
    folder = Path(trials)
    if evaluate:
        forces = "published" if forces is None else forces
    elif solver != "exact":
        raise BadInput("A fit is solved exactly; the authors' scheme needs evaluate=“published”.")
    found = read_folder(folder, None if forces is None else Path(forces))
    names = [trial.name for trial in found]
    if evaluate and names != list(published.TRIALS):
        first, last = published.TRIALS[0], published.TRIALS[-1]
        raise BadInput(
            f"{plain(folder)}: the published parameters belong to the trials 1…10 exactly, as "
            f"published, “{first}” to “{last}”."
        )
    read = {} if forces is None else read_forces(forces, names)
    known = [read.get(name, Force()) for name in names]
    if evaluate:
        if mu_k != published.MU_K or not plate:
            raise BadInput("The published parameters have a µ_k of their own, and no plate.")
        return _evaluated(found, known, solver)
    if mu_k != "free" and not (isinstance(mu_k, int | float) and LEAST_MU_K <= mu_k <= 10):
        words = f"must be from {LEAST_MU_K:g} to 10, or “free”, and is"
        raise BadInput(f"mu_k {words} {plain(mu_k)}.")
    if mu_k == "free" and not any(force.lower or force.upper for force in known):
        raise BadInput(
            "µ_k can only be fitted where bounds of normal forces are known: name a file."
        )
    return _fitted(found, known, None if mu_k == "free" else float(mu_k), plate)


def _fitted(
    trials: list[Trial], known: list[Force], given: float | None, plate: bool
) -> TrialResults:
    lowest, highest = FRICTIONS
    limits = [FRICTIONS] * len(trials)
    if given:  # times µ_k, bounds of the normal force are bounds of the friction
        limits = [
            ((force.lower or lowest / given) * given, (force.upper or highest / given) * given)
            for force in known
        ]
    law = search(trials, limits, plate)
    verdicts = [x.determined(limit) for x, limit in zip(law.kinetic, limits, strict=True)]
    mu_k, mu_k_range = (given, (given, given)) if given else _from_forces(law, known, verdicts)
    shown, rows = [], []
    each = zip(trials, known, law.kinetic, law.slides, verdicts, strict=True)
    for trial, force, kinetic, slides, how in each:
        panel, misfit = _predicted(trial, slides if how == "yes" else [], kinetic, law.ratio)
        shown.append(panel)
        # A number that the slides do not determine is None, and so is what is calculated of it.
        value = kinetic.value if how == "yes" else None
        low = kinetic.low if how in ("yes", "at least") else None
        high = kinetic.high if how in ("yes", "at most") else None
        weights = value and value / mu_k
        ends = [low and low / mu_k_range[1], high and high / mu_k_range[0]]
        rows.append(
            {
                "trial": trial.name,
                "normal_force_weights": weights,
                "normal_force_90_percent": ends,
                "kinetic_friction_weights": value,
                "kinetic_friction_90_percent": [low, high],
                "kinetic_friction_determined": how,
                "slides": len(slides),
                **change(weights, force.measured),
                "misfit_um": misfit and misfit * 1e6,
                "noise_um": noise_of(trial) * 1e6,
            }
        )
    # Where no trial determines its kinetic friction, none determines the plate's.
    untold = plate and "yes" not in verdicts
    ratio, at_end = law.ratio, law.ratio.value > LARGEST_RATIO - 1e-9
    reach = [ratio.low, None if at_end else ratio.high]
    numbers: dict[str, Any] = {
        "parameters": "fitted",
        "mu_k": mu_k,
        "mu_k_given": given is not None,
        "mu_plate": None if untold else ratio.value * mu_k,
        "plate_over_kinetic": None if untold else ratio.value,
        "plate_over_kinetic_90_percent": reach if plate and not untold else None,
        "profiles": {
            trial.name: {"kinetic_friction_weights": x.tolist(), "loss": y.tolist()}
            for trial, (x, y) in zip(trials, law.profile, strict=True)
        },
    }
    if not given:
        numbers["mu_k_90_percent"] = list(mu_k_range)
    return TrialResults(shown, known, numbers | together(rows))


def _predicted(
    trial: Trial, slides: Sequence[Slide], kinetic: Found, ratio: Found
) -> tuple[Shown, float | None]:
    """A trial with the law's prediction of its ``slides``, and the rms misfit [m] of the frames
    within them; None without slides."""
    law = kinetic.value * published.GRAVITY, kinetic.value * ratio.value * published.GRAVITY
    # A NaN at the end of each slide's times interrupts the drawn line.
    times = [np.append(np.linspace(x.time[0], x.time[-1], POINTS), np.nan) for x in slides]
    heights = [x.predicted(*law, time) for x, time in zip(slides, times, strict=True)]
    misfits = [x.z - x.predicted(*law, x.time) for x in slides]
    path = (np.concatenate([*times, []]), np.concatenate([*heights, []]) - trial.part.z[0])
    surface, part = (x.z - x.z[0] for x in (trial.platform, trial.part))
    shown = Shown(trial.name, trial.time - trial.time[0], surface, part, path)
    return shown, float(np.sqrt(np.nanmean(np.concatenate(misfits) ** 2))) if slides else None


def _from_forces(
    law: Fit, known: Sequence[Force], verdicts: Sequence[str]
) -> tuple[float, Interval]:
    """µ_k and its interval, from bounds of the normal forces of trials that determine µ_k F_n.

    Each trial gives µ_k F_n/upper ≤ µ_k ≤ µ_k F_n/lower. µ_k is the geometric mean of the largest
    lower and the least upper bound, also where these two contradict each other. Raises BadInput
    where no bounds are known.
    """
    each = zip(law.kinetic, known, verdicts, strict=True)
    pairs = [(found, force) for found, force, how in each if how == "yes"]
    if not any(force.lower or force.upper for _, force in pairs):
        raise BadInput(
            "µ_k cannot be fitted: no trial whose forces are known has slides enough to determine "
            "µ_k F_n."
        )

    def least_and_most(end: str) -> tuple[float, float]:
        least = [getattr(x, end) / force.upper for x, force in pairs if force.upper]
        most = [getattr(x, end) / force.lower for x, force in pairs if force.lower]
        return max(least, default=0.01), min(most, default=10.0)

    # 3 × 2: bounds of µ_k, for µ_k F_n at the low end of its interval, its value, the high end.
    ends: Array = np.array([least_and_most(end) for end in ("low", "value", "high")])
    return float(np.sqrt(ends[1].prod())), (float(ends.min()), float(ends.max()))


def _evaluated(trials: list[Trial], known: Sequence[Force], solver: Solver) -> TrialResults:
    """Each trial's whole path by the published parameters and the authors' procedure: times and
    heights count from the first row that is used, the surface's tracked velocity is interpolated
    linearly, the part starts with its own tracked velocity, and the error is the mean of
    |z measured − z simulated| every 0.1 ms. Source: see `cosim.trials.published`."""
    shown: list[Shown] = []
    rows: list[Row] = []
    for trial, known_force, force in zip(trials, known, published.FORCES_FITTED, strict=True):
        used = slice(FIRST_ROW, len(trial.time) - LAST_ROWS)
        time = np.ascontiguousarray(trial.time[used] - trial.time[FIRST_ROW])
        steps = int(np.floor(time[-1] / part.PUBLISHED_STEP + 1e-6))
        motion = (part.exact if solver == "exact" else part.threshold)(
            time,
            np.ascontiguousarray(trial.platform.v[used]),
            mu_s=published.MU_S,
            mu_k=published.MU_K_FITTED,
            force_per_mass=force * published.GRAVITY,
            gravity=published.GRAVITY,
            v0=float(trial.part.v[FIRST_ROW]),
            output=np.arange(steps + 1) * part.PUBLISHED_STEP,
        )
        surface, moved = (x.z[used] - x.z[FIRST_ROW] for x in (trial.platform, trial.part))
        shown.append(Shown(trial.name, time, surface, moved, (motion.time, motion.z)))
        rows.append(
            {
                "trial": trial.name,
                "normal_force_weights": force,
                "stick_fraction": motion.stick_fraction,
                "stick_slip_events": motion.stick_slip_events,
                **change(force, known_force.measured),
                **shown[-1].errors(),
            }
        )
    numbers = {
        "parameters": "published",
        "solver": solver,
        "mu_s": published.MU_S,
        "mu_k": published.MU_K_FITTED,
        "mu_plate": 0.0,
    }
    return TrialResults(shown, known, numbers | together(rows))


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    """A trial's row for ``fit.csv``: each interval takes two cells, ``…_from`` and ``…_to``."""
    cells: dict[str, Any] = {}
    for name, value in row.items():
        ends = {f"{name}_from": value[0], f"{name}_to": value[1]} if isinstance(value, list) else {}
        cells |= ends or {name: value}
    return {name: f"{x:.10g}" if isinstance(x, float) else x for name, x in cells.items()}
