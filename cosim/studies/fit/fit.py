"""Fits the part's motion to tracked trials, or evaluates the published parameters on them."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.files.atomic import write_json
from cosim.files.picture import Picture
from cosim.mechanics.part import PartMotion
from cosim.studies.fit.cases import Case, Parameters, Solver
from cosim.studies.fit.search import Fit, Solved, search
from cosim.studies.tables import write_csv
from cosim.trials import published
from cosim.trials.tracked import read_folder

SENSITIVITY = 0.05  # relative change of a parameter
RESAMPLES = 2000  # of the trials, for the interval of µ_k
NEAR = 1.05  # over the best mean error: µ_k with less are reported as about as good


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
        rows = [
            {name: f"{x:.10g}" if isinstance(x, float) else x for name, x in row.items()}
            for row in self.numbers["trials"]
        ]
        write_csv(out / "fit.csv", rows)
        figures.draw_all(self, out)

    def __repr__(self) -> str:
        result = self.numbers
        lines = ["trial   force [m g]   measured   error [mm]   [%]   sticks"]
        for row in result["trials"]:
            measured = row["normal_force_measured_weights"]
            lines.append(
                f"{row['trial']!s:>5} {row['normal_force_weights']:>11.2f} "
                f"{'–' if measured is None else format(measured, '.2f'):>12} "
                f"{row['mean_error_mm']:>11.3f} {row['mean_error_percent']:>8.2f} "
                f"{100 * row['stick_fraction']:>5.0f} %"
            )
        plate = f", mu_p {result['mu_plate']:.4g}" if result["mu_plate"] else ""
        lines.append(
            f"mu_k {result['mu_k']:.4g}{plate}: mean error {result['mean_error_mm']:.4f} mm, "
            f"{result['mean_error_percent']:.2f} %"
        )
        if result["normal_force_change_mean_percent"] is not None:
            lines.append(
                f"normal force changed by {result['normal_force_change_mean_percent']:.2f} % mean, "
                f"{result['normal_force_change_median_percent']:.2f} % median"
            )
        if "leave_one_out_mean_error_mm" in result:
            lines.append(f"leave-one-out error {result['leave_one_out_mean_error_mm']:.4f} mm")
        return "\n".join(lines)


def fit(
    trials: str | os.PathLike[str],
    *,
    evaluate: Literal["published"] | None = None,
    solver: Solver = "exact",
    plate: bool = False,
) -> TrialResults:
    """Fit friction and normal forces to the tracked trials (CSVs) of a folder.

    ``evaluate="published"`` takes the paper's µ_k and normal forces instead of fitting them;
    ``plate`` fits the friction of the springed plate too; ``solver`` is the exact solution or the
    authors' scheme. The measure of the error is the authors' (:mod:`cosim.studies.fit.cases`), the
    search separable (:mod:`cosim.studies.fit.search`). Raises BadInput.
    """
    if evaluate not in (None, "published"):
        raise BadInput(f"Only “published” parameters can be evaluated, not “{evaluate}”.")
    if solver not in ("exact", "published"):
        raise BadInput(f"The solver is exact or published, not “{solver}”.")
    cases = [Case(trial) for trial in read_folder(Path(trials))]
    found = None
    if evaluate:
        if plate:
            raise BadInput("The published parameters know no friction of the springed plate.")
        parameters = _published(cases, Path(trials))
    else:
        found = search(cases, solver, plate)
        parameters = [
            Parameters(found.mu_k, float(force), mu_plate=found.mu_plate)
            for force in found.forces[found.best]
        ]
    motions = [case.motion(p, solver) for case, p in zip(cases, parameters, strict=True)]
    result = _result(cases, parameters, motions, solver, evaluate)
    if found:
        result |= _certainty(found)
    result["sensitivity"] = _sensitivity(cases, parameters, solver)
    return TrialResults(cases, parameters, motions, found, result)


def _published(cases: list[Case], folder: Path) -> list[Parameters]:
    numbers = [case.trial.number for case in cases]
    if numbers != list(range(1, len(published.FORCES_FITTED) + 1)):
        raise BadInput(f"{folder}: the published parameters belong to the trials 1…10 exactly.")
    return [Parameters(published.MU_K_FITTED, force) for force in published.FORCES_FITTED]


def _errors(cases: list[Case], parameters: list[Parameters], solver: Solver) -> Array:
    """The mean error [m] in each trial."""
    pairs = zip(cases, parameters, strict=True)
    errors = (case.errors([p.force], p.mu_k, p.mu_plate, p.mu_s, solver) for case, p in pairs)
    return np.concatenate(list(errors))


def _result(
    cases: list[Case],
    parameters: list[Parameters],
    motions: list[PartMotion],
    solver: Solver,
    evaluate: str | None,
) -> dict[str, Any]:
    errors = _errors(cases, parameters, solver).tolist()
    trials = [*map(_trial, cases, parameters, motions, errors)]
    changes = [row["normal_force_change_percent"] for row in trials]
    changes = [change for change in changes if change is not None]

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in trials]))

    return {
        "parameters": "published" if evaluate else "fitted",
        "solver": solver,
        "mu_s": parameters[0].mu_s,
        "mu_k": parameters[0].mu_k,
        "mu_plate": parameters[0].mu_plate,
        "normal_force_weights": [p.force for p in parameters],
        "mean_error_mm": float(np.mean(errors) * 1e3),
        "mean_error_percent": mean("mean_error_percent"),
        "normal_force_change_mean_percent": float(np.mean(changes)) if changes else None,
        "normal_force_change_median_percent": float(np.median(changes)) if changes else None,
        "straight_line_mean_error_mm": mean("straight_line_error_mm"),
        "trials": trials,
    }


def _trial(case: Case, p: Parameters, motion: PartMotion, error: float) -> dict[str, Any]:
    measured, span = case.measured_force, float(case.grid[-1])
    low, high = case.bounds
    return {
        "trial": case.trial.number if case.trial.number is not None else case.trial.name,
        "normal_force_weights": p.force,
        "normal_force_measured_weights": measured,
        "normal_force_change_percent": measured and 100 * abs(p.force - measured) / measured,
        "normal_force_at_bound": bool(np.isclose(p.force, (low, high), rtol=1e-6).any()),
        "mean_error_mm": error * 1e3,
        "mean_error_percent": 100 * error / case.largest if case.largest else 0.0,
        "straight_line_error_mm": case.straight_line_error() * 1e3,
        "velocity_mm_per_s": float(motion.z[-1]) / span * 1e3,
        "velocity_measured_mm_per_s": float(case.measured[-1]) / span * 1e3,
        "stick_fraction": motion.stick_fraction,
        "stick_slip_events": motion.stick_slip_events,
    }


def _certainty(fit: Fit) -> dict[str, Any]:
    left_out, mu_k = fit.leave_one_out()
    line, error = fit.profile()
    near = line[error <= NEAR * error.min()]
    # The trials drawn anew, with repetition: what µ_k other trials of the kind would have given.
    count = fit.errors.shape[1]
    draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), RESAMPLES)
    found = fit.tried[(fit.errors @ draws.T).argmin(axis=0)]
    return {
        "leave_one_out_mean_error_mm": float(left_out.mean() * 1e3),
        "leave_one_out_mu_k": mu_k.tolist(),
        "mu_k_within_5_percent_of_best": [float(near.min()), float(near.max())],
        "mu_k_95_percent": np.quantile(found[:, 1], (0.025, 0.975)).tolist(),
        "mu_plate_95_percent": np.quantile(found[:, 0], (0.025, 0.975)).tolist(),
        "profile": {"mu_k": line.tolist(), "mean_error_mm": (error * 1e3).tolist()},
    }


def _sensitivity(
    cases: list[Case], parameters: list[Parameters], solver: Solver
) -> dict[str, dict[str, float]]:
    """The mean error [mm] with one parameter 5 % lower or higher and all others kept."""

    def mean(name: str, factor: float) -> float:
        changed = [replace(p, **{name: getattr(p, name) * factor}) for p in parameters]
        changed = [replace(p, mu_k=min(p.mu_k, p.mu_s)) for p in changed]
        return float(np.mean(_errors(cases, changed, solver)) * 1e3)

    names = {"mu_s": "mu_s", "mu_k": "mu_k", "normal_force": "force"}
    return {
        told: {f"{sign * SENSITIVITY:+.0%}": mean(name, 1 + sign * SENSITIVITY) for sign in (-1, 1)}
        for told, name in names.items()
    }
