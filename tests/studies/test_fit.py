"""Fits of the ten published trials, against what their authors printed."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.part import solvers
from cosim.errors import BadInput
from cosim.studies.fit.fit import TrialResults, fit
from cosim.studies.fit.forces import PUBLISHED
from cosim.trials import published

pytestmark = pytest.mark.physics


SOME = (1, 3, 8, 10)
"""Numbers of trials that are fitted quickly: two determine their friction, two do not."""


@pytest.fixture(scope="module")
def some(trials: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("some")
    for n in SOME:
        shutil.copy(trials / f"Trial #{n}.csv", folder)
    return folder


@pytest.fixture(scope="module")
def fitted(some: Path, tmp_path_factory: pytest.TempPathFactory) -> TrialResults:
    """Of some trials, with the published forces in a file."""
    lines = ["trial,force,lower,upper"]
    for n in SOME:
        force = PUBLISHED[name := published.TRIALS[n - 1]]
        lines.append(f"{name},{force.measured},{force.lower},{force.upper}")
    path = tmp_path_factory.mktemp("forces") / "forces.csv"
    path.write_text("\n".join(lines))
    return fit(some, forces=path)


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


def check_bounds(found: TrialResults) -> None:
    result = found.numbers
    low, high = result["plate_over_kinetic_90_percent"]
    assert low <= result["plate_over_kinetic"] <= high
    for row in result["trials"]:
        known = PUBLISHED[row["trial"]]
        assert row["normal_force_measured_weights"] == known.measured
        if row["kinetic_friction_determined"] != "yes":
            assert row["normal_force_weights"] is row["misfit_um"] is None
            continue
        assert known.lower is not None and known.upper is not None
        assert known.lower <= row["normal_force_weights"] <= known.upper * (1 + 1e-12)
        low, high = row["kinetic_friction_90_percent"]
        assert low <= row["kinetic_friction_weights"] <= high * (1 + 1e-12)


def check_determined(found: TrialResults) -> None:
    rows = found.numbers["trials"]
    told = [row for row in rows if row["kinetic_friction_determined"] == "yes"]
    assert 0 < len(told) < len(rows)
    assert found.numbers["misfit_um"] == pytest.approx(np.mean([row["misfit_um"] for row in told]))
    assert found.numbers["misfit_um"] < 2 * found.numbers["noise_um"]
    for shown, row in zip(found.shown, rows, strict=True):
        if row in told:
            assert len(shown.simulated[0]) == len(shown.simulated[1]) > 0
        else:
            assert row["slides"] < 5
            assert row["kinetic_friction_90_percent"] == [None, None]
            assert row["normal_force_weights"] is row["misfit_um"] is None
            assert len(shown.simulated[0]) == 0
    said = repr(found)
    assert said.count("not determined") == len(rows) - len(told)
    assert f"means over the {len(told)} of {len(rows)} trials" in said


def test_the_fit_with_the_spring_loaded_plate(fitted: TrialResults):
    check_bounds(fitted)


@pytest.mark.slow
def test_trials_that_are_not_determined_have_no_force_and_no_path(some: Path):
    """The rest are predicted within their slides to not much more than the noise of the tracks.
    Published forces are taken by wish alone."""
    found = fit(some)
    check_determined(found)
    rows = found.numbers["trials"]
    assert [row["normal_force_measured_weights"] for row in rows] == [None] * len(SOME)
    assert found.numbers["normal_force_change_mean_percent"] is None


@pytest.mark.slow
def test_all_published_trials(trials: Path):
    check_bounds(fit(trials, forces="published"))
    check_determined(fit(trials))


def test_the_files(fitted: TrialResults, tmp_path: Path):
    fitted.save(tmp_path / "out")
    result = fitted.numbers
    assert json.loads((tmp_path / "out" / "fit.json").read_text(encoding="utf-8")) == result
    with (tmp_path / "out" / "fit.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["trial"] for row in rows] == [published.TRIALS[n - 1] for n in SOME]
    for row, told in zip(rows, result["trials"], strict=True):
        for name in ("normal_force_weights", "misfit_um"):
            value = float(row[name]) if row[name] else None
            assert value == (told[name] and pytest.approx(told[name]))
    names = ["fit-forces.png", "fit-profile.png", "fit-trials.png", "fit.csv", "fit.json"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    for name in names[:3]:
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
    assert "µ_plate" in repr(fitted)


def test_an_evaluation_has_no_profile(trials: Path, tmp_path: Path):
    found = fit(trials, evaluate="published", solver="published")
    found.save(tmp_path)
    assert "fit-profile.png" not in [path.name for path in tmp_path.iterdir()]
    assert "33.78 % mean, 26.99 % median" in repr(found)


def test_trials_that_nobody_published(trials: Path, tmp_path: Path):
    for n in (3, 6):
        shutil.copy(trials / f"Trial #{n}.csv", tmp_path / f"trial {n + 50}.csv")
    shutil.copy(trials / "Trial #2.csv", tmp_path / "trial.csv")
    result = fit(tmp_path).numbers
    assert [row["trial"] for row in result["trials"]] == ["trial 53", "trial 56", "trial"]
    assert result["normal_force_change_mean_percent"] is None
    with pytest.raises(BadInput, match="belong to the trials 1…10"):
        fit(tmp_path, evaluate="published")


def test_options_that_do_not_exist(trials: Path):
    with pytest.raises(BadInput, match="µ_k of their own"):
        fit(trials, evaluate="published", plate=False)
    with pytest.raises(BadInput, match='evaluate = "mine" must be "published" or None'):
        fit(trials, evaluate="mine")  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInput, match='solver = "other" must be "exact" or "published"'):
        fit(trials, solver="other")  # pyright: ignore[reportArgumentType]


def test_exact_is_faster_than_the_authors_scheme(trials: Path):
    assert solvers(trials, rounds=11)["exact_over_published"]["median"] < 0.5
