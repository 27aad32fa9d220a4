"""Friction and normal forces from tracked trials, or what the published parameters make of them.

A camera smears an impact over the frames about it, and what the part did on the surface meanwhile.
So the motion between frames is reconstructed with its impacts (`cosim.studies.fit.between`), and
the law is the one that makes the tracks likeliest (`cosim.studies.fit.search`). That presumes
impacts that are short against the time between frames and a part that only slides. Where whole
paths of the part follow better from the tracked velocities as they are, joined by straight lines,
it does not hold, and the law is fitted to these paths (`cosim.studies.fit.paths`).
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.files.atomic import write_json
from cosim.files.picture import Picture
from cosim.studies.fit import paths, words
from cosim.studies.fit.between.motion import Lasting
from cosim.studies.fit.between.together import TYPICAL, Frames, Together, frames
from cosim.studies.fit.cases import Case, Parameters, Solver
from cosim.studies.fit.forces import Force, read_forces
from cosim.studies.fit.intervals import FRICTIONS, Interval, Law, laws, own, shared
from cosim.studies.fit.results import Shown, Solved
from cosim.studies.fit.search import Fit, search
from cosim.studies.fit.stretches import Stretches
from cosim.studies.tables import write_csv
from cosim.trials import published
from cosim.trials.tracked import Trial, read_folder

FORCES: Interval = (1.0, 60.0)
"""Bounds of a normal force of which nothing is known, in weights of the part."""

_Found = tuple[Law, list[Shown], dict[str, Any]]


class TrialResults(Solved):
    """Trials with their parameters and simulated motions: ``numbers``, figures and files."""

    def plot(self) -> Picture:
        """Measured and simulated height of the part, a panel for each trial."""
        from cosim.studies.fit import figures

        return figures.trials(self)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``fit.json``, ``fit.csv`` and the figures ``fit-*.png``."""
        from cosim.studies.fit import figures

        out = Path(folder)
        write_json(out / "fit.json", self.numbers)
        write_csv(out / "fit.csv", [_cells(row) for row in self.numbers["trials"]])
        figures.draw_all(self, out)

    def __repr__(self) -> str:
        return words.told(self.numbers)


def fit(
    trials: str | os.PathLike[str],
    *,
    forces: str | os.PathLike[str] | None = None,
    mu_s: float | Literal["free"] = published.MU_S,
    plate: bool = False,
    mass_ratio: float | None = None,
    evaluate: Literal["published"] | None = None,
    solver: Solver = "exact",
) -> TrialResults:
    """Fit µ_k and the normal forces to the tracked trials (CSVs) of a folder.

    ``forces`` is a file with what is known of normal forces (:mod:`cosim.studies.fit.forces`), or
    “published”. ``mu_s`` is kept, or, “free”, fitted too, which needs bounds of forces; ``plate``
    fits the friction of the springed plate, which moves as tracked, or rests where it was not;
    ``mass_ratio`` is the part's mass over that of the surface with what moves with it, fitted where
    it is not known.

    ``evaluate="published"`` takes the paper's µ_k and forces instead, by the authors' procedure,
    with the exact solution or with their scheme (``solver``). Raises BadInput.
    """
    folder = Path(trials)
    if evaluate not in (None, "published"):
        raise BadInput(f"Only “published” parameters can be evaluated, not “{evaluate}”.")
    if solver not in ("exact", "published"):
        raise BadInput(f"The solver is exact or published, not “{solver}”.")
    if evaluate:
        forces = "published" if forces is None else forces
    elif solver != "exact":
        raise BadInput("A fit is solved exactly; the authors' scheme needs evaluate=“published”.")
    found = read_folder(folder, None if forces is None else Path(forces))
    names = [trial.name for trial in found]
    if evaluate and names != list(published.TRIALS):
        first, last = published.TRIALS[0], published.TRIALS[-1]
        raise BadInput(
            f"{folder}: the published parameters belong to the trials 1…10 exactly, as published, "
            f"“{first}” to “{last}”."
        )
    read = {} if forces is None else read_forces(forces, names)
    known = [read.get(name, Force()) for name in names]
    if evaluate:
        if (mu_s, plate, mass_ratio) != (published.MU_S, False, None):
            raise BadInput(
                "The published parameters know no friction of the springed plate, no other µ_s and "
                "no ratio of masses."
            )
        return _evaluated(found, known, solver)
    if mu_s != "free" and not (isinstance(mu_s, int | float) and 0 < mu_s <= 10):
        raise BadInput(f"mu_s must be above 0 and at most 10, or “free”, and is {mu_s}.")
    if mu_s == "free" and not any(force.lower or force.upper for force in known):
        raise BadInput(
            "µ_s can only be fitted where bounds of normal forces are known: name a file."
        )
    if mass_ratio is not None and not 0 <= mass_ratio <= 10:
        raise BadInput(f"mass_ratio must lie between 0 and 10, and is {mass_ratio}.")
    return _fitted(found, known, None if mu_s == "free" else float(mu_s), plate, mass_ratio)


def _fitted(
    found: list[Trial],
    known: list[Force],
    mu_s: float | None,
    plate: bool,
    mass_ratio: float | None,
) -> TrialResults:
    normal = [(force.lower or FORCES[0], force.upper or FORCES[1]) for force in known]
    # Of µ_s F_n.
    limits = [(a * mu_s, b * mu_s) for a, b in normal] if mu_s else [FRICTIONS] * len(normal)
    seen = [frames(trial, plate) for trial in found]
    cases = [Case(trial, plate) for trial in found]
    straight = paths.least_error([case.errors for case in cases], limits)
    impacts = paths.least_error([_typical(one).errors for one in seen], limits)
    result = None
    if impacts <= straight:  # else the likeliest law need not be sought
        result = _with_impacts(search(seen, limits, plate, mass_ratio), seen)
        impacts = float(np.mean([one.error for one in result[1]]))
    if result is None or impacts > straight:
        result = _with_straight_lines(paths.search([c.errors for c in cases], limits, plate), cases)
    law, shown, numbers = result
    numbers |= {
        "parameters": "fitted",
        "paths_mean_error_mm": {"impacts": impacts * 1e3, "straight lines": straight * 1e3},
        "mass_ratio_given": mass_ratio is not None,
        **shared(law, normal, mu_s, plate),
    }
    static = tuple(numbers.get("mu_s_95_percent", (mu_s, mu_s)))
    each = [
        own(law, i, limit, static, numbers["mu_s"], mu_s is not None)
        for i, limit in enumerate(normal)
    ]
    return TrialResults(shown, known, numbers, each)


def _with_impacts(law: Fit, seen: list[Frames]) -> _Found:
    """The law with each trial and what is told of the motion between frames."""
    shown: list[Shown] = []
    for i, (stretches, one) in enumerate(zip(law.stretches, seen, strict=True)):
        # From the first frame at which the part sticks, in one run.
        time, z = stretches.whole(_law(law, i))
        first = stretches.starts[0]
        begin, rows = one.time[first], slice(first, None)
        z_surface, z_part = (track[rows] - track[first] for track in (one.z_surface, one.z_part))
        shown.append(
            Shown(one.name, one.time[rows] - begin, z_surface, z_part, (time - begin, z[0]))
        )
    numbers = {
        "between_frames": "impacts",
        "mass_ratio": law.mass_ratio,
        "impact_duration_s": law.lasting.impact,
        "force_step_duration_s": law.lasting.step,
        "dispersion": law.dispersion,
    }
    return law, shown, numbers


def _with_straight_lines(law: paths.Paths, cases: list[Case]) -> _Found:
    shown = [case.shown(case.heights(_law(law, i))[0]) for i, case in enumerate(cases)]
    left_out, _ = law.leave_one_out()
    numbers = {
        "between_frames": "straight lines",
        "leave_one_out_mean_error_mm": float(left_out.mean() * 1e3),
    }
    return law, shown, numbers


def _typical(seen: Frames) -> Stretches:
    """With impacts between the frames, before anything is fitted."""
    both = Together(seen, TYPICAL, False, None)
    return Stretches(both, both.motion(), Lasting(2e-4, 0.0))


def _law(law: Law, trial: int) -> Array:
    """The best one of a trial, a row."""
    return laws(law.frictions(trial)[[law.best]], *law.ratios[law.best])


def _evaluated(found: list[Trial], known: Sequence[Force], solver: Solver) -> TrialResults:
    shown: list[Shown] = []
    rows: list[dict[str, Any]] = []
    for trial, normal in zip(found, published.FORCES_FITTED, strict=True):
        case = Case(trial)
        motion = case.motion(Parameters(published.MU_K_FITTED, normal), solver)
        shown.append(case.shown(motion.z))
        rows.append(
            {
                "normal_force_weights": normal,
                "stick_fraction": motion.stick_fraction,
                "stick_slip_events": motion.stick_slip_events,
            }
        )
    numbers = {
        "parameters": "published",
        "solver": solver,
        "mu_s": published.MU_S,
        "mu_k": published.MU_K_FITTED,
        "mu_plate": 0.0,
    }
    return TrialResults(shown, known, numbers, rows)


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    """A row of the table, an interval in two cells."""
    cells: dict[str, Any] = {}
    for name, value in row.items():
        ends = {f"{name}_from": value[0], f"{name}_to": value[1]} if isinstance(value, list) else {}
        cells |= ends or {name: value}
    return {name: f"{x:.10g}" if isinstance(x, float) else x for name, x in cells.items()}
