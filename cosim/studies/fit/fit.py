"""Fits the part's motion to tracked trials, or evaluates the published parameters on them.

`run` writes `fit.json`, `fit.csv` and the figures `fit-trials.png`, `fit-profile.png` and
`fit-forces.png`. The measure of the error is the authors' (`cosim.studies.fit.cases`), the search
separable (`cosim.studies.fit.search`).
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cosim.errors import BadInput
from cosim.files.atomic import whole
from cosim.mechanics.part import PartMotion
from cosim.studies.fit.cases import Case, Parameters, Solver
from cosim.studies.fit.search import Fit, search
from cosim.trials import published
from cosim.trials.tracked import read_folder

Array = npt.NDArray[np.float64]

SENSITIVITY = 0.05  # relative change of a parameter
RESAMPLES = 2000  # of the trials, for the interval of µ_k
NEAR = 1.05  # a mean error within this of the best is told as about as good


@dataclass(frozen=True)
class Outcome:
    """Parameters, motions and errors, trial by trial; ``fit`` is there if they were fitted."""

    cases: list[Case]
    parameters: list[Parameters]
    motions: list[PartMotion]
    errors: Array  # m
    fit: Fit | None
    result: dict[str, Any]  # what fit.json holds


def run(
    trials_dir: Path,
    out_dir: Path,
    evaluate: Literal["published"] | None = None,
    solver: Solver = "exact",
    plate: bool = False,
    progress: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Fit or evaluate the trials of a folder, write the files, and return what `fit.json` holds.

    ``evaluate="published"`` takes the paper's µ_k and normal forces instead of fitting them;
    ``plate`` fits the friction of the springed plate too; ``solver`` is the exact solution or the
    authors' scheme. ``progress`` is called now and then while fitting.
    """
    from cosim.studies.fit import figures as fit_figures

    outcome = compute(Path(trials_dir), evaluate, solver, plate, progress)
    out = Path(out_dir)
    with whole(out / "fit.json") as temporary:
        text = json.dumps(outcome.result, indent=2, ensure_ascii=False, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with whole(out / "fit.csv") as temporary:
        temporary.write_text(_csv(outcome.result["trials"]), encoding="utf-8")
    fit_figures.draw_all(outcome, out)
    return outcome.result


def compute(
    trials_dir: Path,
    evaluate: Literal["published"] | None = None,
    solver: Solver = "exact",
    plate: bool = False,
    progress: Callable[[], None] = lambda: None,
) -> Outcome:
    """`run` without the files."""
    if evaluate not in (None, "published"):
        raise BadInput(f"Only “published” parameters can be evaluated, not “{evaluate}”.")
    if solver not in ("exact", "published"):
        raise BadInput(f"The solver is exact or published, not “{solver}”.")
    cases = [Case(trial) for trial in read_folder(trials_dir)]
    fit = None
    if evaluate:
        if plate:
            raise BadInput("The published parameters know no friction of the springed plate.")
        parameters = _published(cases, trials_dir)
    else:
        fit = search(cases, solver, plate, progress=progress)
        parameters = [
            Parameters(fit.mu_k, float(force), mu_plate=fit.mu_plate)
            for force in fit.forces[fit.best]
        ]
    motions = [case.motion(p, solver) for case, p in zip(cases, parameters, strict=True)]
    errors = np.array([_error(case, p, solver) for case, p in zip(cases, parameters, strict=True)])
    result = _result(cases, parameters, motions, errors, solver, evaluate)
    if fit:
        result |= _certainty(fit, cases)
    result["sensitivity"] = _sensitivity(cases, parameters, solver)
    return Outcome(cases, parameters, motions, errors, fit, result)


def table(result: dict[str, Any]) -> str:
    """The result as a few lines to print."""
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


def _published(cases: list[Case], folder: Path) -> list[Parameters]:
    numbers = [case.trial.number for case in cases]
    if numbers != list(range(1, len(published.FORCES_FITTED) + 1)):
        raise BadInput(f"{folder}: the published parameters belong to the trials 1…10 exactly.")
    return [Parameters(published.MU_K_FITTED, force) for force in published.FORCES_FITTED]


def _error(case: Case, parameters: Parameters, solver: Solver) -> float:
    p = parameters
    return float(case.errors(np.array([p.force]), p.mu_k, p.mu_plate, p.mu_s, solver)[0])


def _result(
    cases: list[Case],
    parameters: list[Parameters],
    motions: list[PartMotion],
    errors: Array,
    solver: Solver,
    evaluate: str | None,
) -> dict[str, Any]:
    trials = [
        _trial(case, p, motion, float(error))
        for case, p, motion, error in zip(cases, parameters, motions, errors, strict=True)
    ]
    changes = [row["normal_force_change_percent"] for row in trials]
    changes = [change for change in changes if change is not None]
    lines = [case.straight_line_error() * 1e3 for case in cases]
    return {
        "parameters": "published" if evaluate else "fitted",
        "solver": solver,
        "mu_s": parameters[0].mu_s,
        "mu_k": parameters[0].mu_k,
        "mu_plate": parameters[0].mu_plate,
        "normal_force_weights": [p.force for p in parameters],
        "mean_error_mm": float(errors.mean() * 1e3),
        "mean_error_percent": float(np.mean([row["mean_error_percent"] for row in trials])),
        "normal_force_change_mean_percent": float(np.mean(changes)) if changes else None,
        "normal_force_change_median_percent": float(np.median(changes)) if changes else None,
        "straight_line_mean_error_mm": float(np.mean(lines)),
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


def leave_one_out(fit: Fit) -> tuple[Array, Array]:
    """Each case's error [m] with the µ_k that is best for the others, and these µ_k.

    The normal force belongs to the case and is fitted to it, given that µ_k (and µ_p).
    """
    errors = fit.errors
    if errors.shape[1] < 2:
        return errors[fit.best], fit.tried[[fit.best], 1]
    rest = errors.sum(axis=1)[:, None] - errors
    rows = rest.argmin(axis=0)
    return errors[rows, np.arange(errors.shape[1])], fit.tried[rows, 1]


def profile(fit: Fit) -> tuple[Array, Array]:
    """µ_k, rising, and the smallest mean error [m] with each, at the best µ_p."""
    rows = fit.tried[:, 0] == fit.tried[fit.best, 0]
    return fit.tried[rows, 1], fit.errors[rows].mean(axis=1)


def _certainty(fit: Fit, cases: Sequence[Case]) -> dict[str, Any]:
    left_out, mu_k = leave_one_out(fit)
    line, error = profile(fit)
    near = line[error <= NEAR * error.min()]
    # The trials drawn anew, with repetition: what µ_k other trials of the kind would have given.
    draws = np.random.default_rng(0).multinomial(
        len(cases), np.full(len(cases), 1 / len(cases)), RESAMPLES
    )
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

    def mean(mu_s: float = 1.0, mu_k: float = 1.0, force: float = 1.0) -> float:
        changed = [
            replace(
                p,
                mu_s=p.mu_s * mu_s,
                mu_k=min(p.mu_k * mu_k, p.mu_s * mu_s),
                force=p.force * force,
            )
            for p in parameters
        ]
        errors = [_error(case, p, solver) for case, p in zip(cases, changed, strict=True)]
        return float(np.mean(errors) * 1e3)

    names = ("mu_s", "mu_k", "force")
    return {
        "normal_force" if name == "force" else name: {
            f"{sign * SENSITIVITY:+.0%}": mean(**{name: 1 + sign * SENSITIVITY}) for sign in (-1, 1)
        }
        for name in names
    }


def _csv(rows: list[dict[str, Any]]) -> str:
    def cell(value: object) -> str:
        if value is None:
            return ""
        return f"{value:.10g}" if isinstance(value, float) else str(value)

    lines = [",".join(rows[0]), *(",".join(map(cell, row.values())) for row in rows)]
    return "\n".join(lines) + "\n"
