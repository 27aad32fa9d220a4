"""Fits of the ten published trials, against what their authors printed."""

import csv
import json
import shutil
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from benchmarks.part import solvers
from cosim.errors import BadInput
from cosim.mechanics import part
from cosim.studies.fit.cases import Case
from cosim.studies.fit.fit import TrialResults, fit
from cosim.studies.fit.forces import PUBLISHED
from cosim.studies.fit.intervals import laws
from cosim.studies.fit.paths import Paths, best_friction, search
from cosim.trials import published
from cosim.trials.tracked import read_folder

pytestmark = pytest.mark.physics

LIMITS = [(published.MU_S * low, published.MU_S * high) for low, high in published.FORCE_BOUNDS]


@pytest.fixture(scope="module")
def fitted(trials: Path) -> TrialResults:
    return fit(trials, forces="published")


@pytest.fixture(scope="module")
def cases(trials: Path) -> list[Case]:
    return [Case(trial) for trial in read_folder(trials)]


@pytest.fixture(scope="module")
def found(cases: list[Case]) -> Paths:
    return search([case.errors for case in cases], LIMITS, False)


def test_the_authors_scheme_gives_every_digit_that_they_printed(trials: Path):
    result = fit(trials, evaluate="published", solver="published").numbers
    assert f"{result['mean_error_mm']:.3f}" == "0.161"
    assert f"{result['mean_error_percent']:.2f}" == "11.87"
    change = result["normal_force_change_median_percent"]
    assert f"{change:.2f}" == "26.99"
    change = result["normal_force_change_mean_percent"]
    assert f"{change:.2f}" == "33.78"
    # and some digits more, so that a change of the scheme is seen
    assert result["mean_error_mm"] == pytest.approx(0.161101, abs=1e-6)
    assert result["mean_error_percent"] == pytest.approx(11.87003, abs=1e-5)


def test_the_authors_scheme_hardly_ever_sticks(trials: Path):
    chattering = fit(trials, evaluate="published", solver="published").numbers["trials"]
    truth = fit(trials, evaluate="published").numbers["trials"]
    assert max(row["stick_fraction"] for row in chattering) < 0.04
    assert min(row["stick_fraction"] for row in truth) > 0.25


def test_the_same_parameters_solved_exactly(trials: Path):
    result = fit(trials, evaluate="published").numbers
    assert f"{result['mean_error_mm']:.4f}" == "0.1569"
    assert f"{result['mean_error_percent']:.2f}" == "9.14"


def test_the_exact_fit(fitted: TrialResults):
    result = fitted.numbers
    assert result["between_frames"] == "straight lines"
    errors = result["paths_mean_error_mm"]
    assert errors["straight lines"] < 0.7 * errors["impacts"]
    assert result["mean_error_mm"] <= 0.114
    assert result["mean_error_percent"] <= 6.1
    assert result["leave_one_out_mean_error_mm"] <= 0.12
    assert result["mean_error_mm"] < result["straight_line_mean_error_mm"]
    assert result["mu_plate"] == 0.0
    assert 0.5 < result["mu_k"] < 0.6
    low, high = result["mu_k_95_percent"]
    assert low <= result["mu_k"] <= high
    for row, (lower, upper) in zip(result["trials"], published.FORCE_BOUNDS, strict=True):
        assert lower <= row["normal_force_weights"] <= upper * (1 + 1e-12)
        low, high = row["normal_force_95_percent"]
        assert low <= row["normal_force_weights"] <= high * (1 + 1e-12)


def test_what_is_reported_is_what_the_parameters_give(fitted: TrialResults, cases: list[Case]):
    for case, row in zip(cases, fitted.numbers["trials"], strict=True):
        motion = part.exact(
            case.time,
            case.v_surface,
            mu_s=0.72,
            mu_k=fitted.numbers["mu_k"],
            force_per_mass=row["normal_force_weights"] * 9.81,
            v0=case.v0,
            output=case.grid,
        )
        error = np.abs(motion.z - np.interp(case.grid, case.time, case.z_part)).mean()
        assert row["mean_error_mm"] == pytest.approx(1e3 * error, rel=1e-6)


def test_a_leave_one_out_mu_k_does_not_know_the_trial_left_out(found: Paths):
    errors, slips = found.leave_one_out()
    for j in range(10):
        others = np.delete(found.errors, j, axis=1).mean(axis=1)
        row = int(np.flatnonzero(found.tried[:, 0] == slips[j])[0])
        assert others[row] == others.min()
        assert errors[j] == found.errors[row, j]


def test_the_profile_is_the_best_of_each_mu_k(fitted: TrialResults):
    profile = fitted.numbers["profile"]
    assert (np.diff(profile["mu_k"]) > 0).all()
    assert profile["mu_k"][-1] == 0.72
    best = int(np.argmin(profile["loss"]))
    assert profile["loss"][best] == 0.0
    assert profile["mu_k"][best] == pytest.approx(fitted.numbers["mu_k"])


def test_one_search_against_a_fine_grid(cases: list[Case]):
    for case, limit in zip(cases, LIMITS, strict=True):
        error, low, static, high = best_friction(case.errors, limit, 0.75, 0.0)
        grid = np.linspace(*limit, 4001)
        best = case.errors(laws(grid * 0.75, 0.75, 0.0)).min()
        assert error <= 1.02 * best
        assert limit[0] <= low <= static <= high <= limit[1] * (1 + 1e-12)


@pytest.mark.slow
def test_with_friction_of_the_springed_plate(trials: Path):
    result = fit(trials, forces="published", plate=True).numbers
    assert result["mean_error_mm"] <= 0.095
    low, high = result["mu_plate_95_percent"]
    assert 0.05 < result["mu_plate"] < 0.18
    assert low <= result["mu_plate"] <= high


def test_the_files(fitted: TrialResults, tmp_path: Path):
    fitted.save(tmp_path / "out")
    result = fitted.numbers
    assert json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8")) == result
    with (tmp_path / "out" / "fit.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["trial"] for row in rows] == list(published.TRIALS)
    assert float(rows[4]["mean_error_mm"]) == pytest.approx(result["trials"][4]["mean_error_mm"])
    names = ["fit-forces.png", "fit-profile.png", "fit-trials.png", "fit.csv", "fit.json"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    for name in names[:3]:
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
    assert "leave-one-out" in repr(fitted)


def test_an_evaluation_has_no_profile(trials: Path, tmp_path: Path):
    found = fit(trials, evaluate="published", solver="published")
    found.save(tmp_path)
    assert "fit-profile.png" not in [path.name for path in tmp_path.iterdir()]
    assert "33.78 % mean, 26.99 % median" in repr(found)


def test_published_forces_are_taken_by_wish_alone(fitted: TrialResults):
    rows = fitted.numbers["trials"]
    assert [row["normal_force_measured_weights"] for row in rows] == [
        PUBLISHED[name].measured for name in published.TRIALS
    ]


def test_trials_that_nobody_published(trials: Path, tmp_path: Path):
    for n in (3, 6):
        shutil.copy(trials / f"Trial #{n}.csv", tmp_path / f"trial {n + 50}.csv")
    shutil.copy(trials / "Trial #2.csv", tmp_path / "trial.csv")
    result = fit(tmp_path).numbers
    assert [row["trial"] for row in result["trials"]] == ["trial 53", "trial 56", "trial"]
    assert result["normal_force_change_mean_percent"] is None
    assert result["mean_error_mm"] < 0.1
    with pytest.raises(BadInput, match="belong to the trials 1…10"):
        fit(tmp_path, evaluate="published")


def test_options_that_do_not_exist(trials: Path):
    with pytest.raises(BadInput, match="know no friction of the springed plate"):
        fit(trials, evaluate="published", plate=True)
    with pytest.raises(BadInput, match="can be evaluated"):
        fit(trials, evaluate="mine")  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInput, match="exact or published"):
        fit(trials, solver="other")  # pyright: ignore[reportArgumentType]


def test_exact_is_faster_than_the_authors_scheme(trials: Path):
    assert solvers(trials, rounds=11)["exact_over_published"]["median"] < 0.5


@pytest.mark.slow
def test_the_separable_fit_is_faster_and_better_than_a_global_search(cases: list[Case]):
    start = perf_counter()
    found = search([case.errors for case in cases], LIMITS, False)
    separable = perf_counter() - start

    def error(numbers: np.ndarray) -> float:
        mu_k, forces = float(numbers[0]), numbers[1:, None]
        return sum(
            float(case.errors(laws(force * mu_k, mu_k / published.MU_S, 0.0))[0])
            for case, force in zip(cases, forces, strict=True)
        )

    # Without the polish: the error has steps, and no slope to follow.
    start = perf_counter()
    bounds = [(1e-3, published.MU_S), *published.FORCE_BOUNDS]
    result: Any = differential_evolution(error, bounds, maxiter=1000, rng=1, polish=False)
    assert perf_counter() - start > separable
    assert found.errors[found.best].mean() < result.fun / len(cases)
