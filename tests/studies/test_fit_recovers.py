"""Fits of the bench's own exported runs, whose parameters are known, and the files of forces."""

import csv
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.files.atomic import write_text
from cosim.mechanics import part
from cosim.scene.model import to_toml
from cosim.studies.fit.forces import Force, read_forces
from cosim.studies.fit.slides import Span, slide
from cosim.trials.tracked import Track, Trial
from cosim.waveforms.formats import tracker
from cosim.waveforms.formats.source import Run

pytestmark = pytest.mark.physics

WEIGHT = 0.009 * 9.81  # N, of the part
MU_S, MASS, NOISE = 0.72, 0.009, 2e-6
MADE = {
    "05": ("trial-05", {}),
    "09": ("trial-09", {}),
    "a": ("trial-01", (0.55, 0.7, 0.18)),
    "b": ("trial-04", (0.45, 0.9, 0.15)),
    "c": ("trial-08", (0.65, 1.2, 0.10)),
    "d": ("trial-07", (0.50, 0.6, 0.25)),
    "e": ("trial-02", (0.60, 1.0, 0.20)),
    "f": ("trial-10", (0.40, 1.4, 0.12)),
    "g": ("trial-05", (0.50, 1.1, 0.15, 40.0)),
    "h": ("trial-09", (0.68, 0.6, 0.30, 30.0)),
    "held": ("trial-05", (0.35, 6.0, 0.0)),
    "i": ("trial-05", (0.5, 0.6, 0.25)),
    "rough": ("trial-09", (0.3, 1.2, 0.45)),
    "ridge": ("trial-08", (0.39, 0.68, 0.27)),
}
"""Scenes, and where they differ: µ_k, F_n [N], µ_plate, and the frequency of the drive [Hz]."""
KEYS = ("friction.mu_k", "friction.normal_force", "friction.mu_plate", "drive.frequency")
TEN = [name for name in MADE if name not in ("held", "i", "ridge", "rough")]


def made(
    folder: Path, name: str, seed: int = 0, noise: float = NOISE, frames: int | None = None
) -> dict[str, float]:
    """A run as a tracked trial, as ``cosim export --as tracker`` writes it, with a camera's noise
    (m) on the heights; its true numbers. Without the run's figure, which takes longer than the
    rest."""
    base, changed = MADE[name]
    scene = {"circuit.model": "limited", **dict(zip(KEYS, changed, strict=False))}
    run = cosim.run(base, scene)
    home = folder / "runs" / name
    write_text(home / "scene.toml", to_toml(run.scene))
    file = BytesIO()
    tracker.write(Run(home, run.columns, {}, {}, datetime.now(UTC)), file)
    rows = list(csv.DictReader(file.getvalue().decode().splitlines()))
    rng = np.random.default_rng([seed, len(name), ord(name[0])])
    with (folder / f"Trial {name}.csv").open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["t", "zp", "zo", "zs"])
        for row in rows[:frames]:
            seen = [float(row[key]) + 1e3 * noise * rng.standard_normal() for key in ("zp", "zo")]
            writer.writerow([row["t"], *seen, row["zs"]])
    friction = run.scene.friction
    force = friction.normal_force / WEIGHT
    return {
        "kinetic": friction.mu_k * force,
        "force": force,
        "mu_k": friction.mu_k,
        "ratio": friction.mu_plate / friction.mu_k,
    }


def holds(row: dict[str, Any], truth: dict[str, float]) -> bool:
    """Whether the interval of µ_k F_n, or its one end, holds the true one."""
    low, high = row["kinetic_friction_90_percent"]
    return (low or 0.0) <= truth["kinetic"] <= (high or np.inf)


def test_two_trials_of_one_rig_give_their_friction_back(tmp_path: Path) -> None:
    """Fits of whole paths on the tracked velocities, without a plate, found it 36 and 54 % off."""
    truths = [made(tmp_path, name) for name in ("05", "09")]
    found = cosim.fit(tmp_path).numbers
    for row, truth in zip(found["trials"], truths, strict=True):
        assert row["kinetic_friction_weights"] == pytest.approx(truth["kinetic"], rel=0.1)
        assert row["kinetic_friction_determined"] == "yes"
        assert row["noise_um"] == pytest.approx(NOISE * 1e6, rel=0.5)
        assert row["misfit_um"] < 3 * NOISE * 1e6
    assert sum(map(holds, found["trials"], truths)) >= 1
    assert found["plate_over_kinetic"] == pytest.approx(truths[0]["ratio"], abs=0.12)


@pytest.mark.slow
def test_frames_without_noise_do_not_mislead(tmp_path: Path) -> None:
    """How a slide begins is not modelled to the digits of a table: taken so, they are 11 % off."""
    truths = [made(tmp_path, name, noise=0.0) for name in ("05", "09")]
    for row, truth in zip(cosim.fit(tmp_path).numbers["trials"], truths, strict=True):
        assert row["kinetic_friction_weights"] == pytest.approx(truth["kinetic"], rel=0.05)
        assert holds(row, truth)


@pytest.mark.slow
def test_a_narrow_ridge_is_found(tmp_path: Path) -> None:
    """Where so much friction is the plate's, both frictions can be exchanged for each other but for
    what sharp frames tell: with their noise taken ten times too high it was 39 % off."""
    truth = made(tmp_path, "ridge")
    found = cosim.fit(tmp_path).numbers
    (row,) = found["trials"]
    assert row["kinetic_friction_weights"] == pytest.approx(truth["kinetic"], rel=0.1)
    assert found["plate_over_kinetic"] == pytest.approx(truth["ratio"], rel=0.1)
    assert row["misfit_um"] < 2 * NOISE * 1e6


@pytest.mark.slow
def test_missing_frames_change_the_friction_little(tmp_path: Path) -> None:
    """A tenth of the frames has no height of one of the bodies, some in the middle of slides."""
    truth = made(tmp_path, "09")
    file = tmp_path / "Trial 09.csv"
    head, *rows = (line.split(",") for line in file.read_text().splitlines())
    gone = np.random.default_rng(1).choice(len(rows), len(rows) // 10, replace=False)
    for n, k in enumerate(gone.tolist()):
        rows[k][1 + n % 2] = ""
    file.write_text("\n".join(map(",".join, [head, *rows])))
    (row,) = cosim.fit(tmp_path).numbers["trials"]
    assert row["kinetic_friction_weights"] == pytest.approx(truth["kinetic"], rel=0.1)
    assert row["misfit_um"] < 3 * NOISE * 1e6


@pytest.mark.slow
def test_ten_trials_of_different_friction_give_it_back(tmp_path: Path) -> None:
    """Each alone, as their frictions have not even ratios in common."""
    near, held = 0, 0
    for name in TEN:
        folder = tmp_path / name
        folder.mkdir()
        truth = made(folder, name)
        (row,) = cosim.fit(folder).numbers["trials"]
        if (found := row["kinetic_friction_weights"]) is not None:  # one has too few slides
            near += abs(found / truth["kinetic"] - 1.0) < 0.1
            held += holds(row, truth)
    assert near >= 9
    assert held >= 8


@pytest.mark.slow
def test_intervals_of_few_noisy_frames_are_as_wide_as_they_must_be(tmp_path: Path) -> None:
    """110 frames with 8 µm of noise hardly tell friction from a plate's: the likelihood is flat
    over a decade. Of 20, those with slides enough."""
    told = held = of_ratio = 0
    for seed in range(20):
        truth = made(tmp_path, "i", seed, 8e-6, 110)
        found = cosim.fit(tmp_path).numbers
        (row,) = found["trials"]
        if row["kinetic_friction_determined"] == "yes":
            told += 1
            held += holds(row, truth)
            low, high = found["plate_over_kinetic_90_percent"]
            of_ratio += low <= truth["ratio"] <= high
    assert told >= 8 and held >= 0.8 * told and of_ratio >= 0.8 * told


def test_a_plate_that_is_rougher_than_the_search_goes_is_told(tmp_path: Path) -> None:
    """µ_plate/µ_k is 1.5; it was told as 1.19 … 1.32, which is where the search ends."""
    truth = made(tmp_path, "rough")
    fit = cosim.fit(tmp_path)
    low, high = fit.numbers["plate_over_kinetic_90_percent"]
    assert high is None and 1.0 < low < truth["ratio"] == pytest.approx(1.5)
    assert f"µ_plate/µ_k at least {low:.2f}: the search ends there" in repr(fit)
    fit.save(tmp_path)  # with an interval without an end


def test_a_trial_in_which_the_part_never_slips_determines_nothing(tmp_path: Path) -> None:
    truth = made(tmp_path, "held")
    found = cosim.fit(tmp_path).numbers
    (row,) = found["trials"]
    assert found["mu_plate"] is found["misfit_um"] is None
    assert row["kinetic_friction_determined"] in ("at least", "no")
    assert row["normal_force_weights"] is row["kinetic_friction_weights"] is None
    assert holds(row, truth)


@pytest.mark.slow
def test_mu_k_follows_from_known_forces(tmp_path: Path) -> None:
    """Bounds in newtons, with the mass of the part, 6 % on either side."""
    truth = made(tmp_path, "a")
    force = truth["force"] * WEIGHT
    lines = ["trial,force,lower,upper,mass"]
    lines.append(f"Trial a,{force},{0.94 * force},{1.06 * force},{MASS}")
    (tmp_path / "forces.csv").write_text("\n".join(lines), encoding="utf-8")
    found = cosim.fit(tmp_path, forces=tmp_path / "forces.csv", mu_k="free").numbers
    assert found["mu_k"] == pytest.approx(truth["mu_k"], rel=0.1)
    low, high = found["mu_k_90_percent"]
    assert low <= truth["mu_k"] <= high
    (row,) = found["trials"]
    assert row["normal_force_measured_weights"] == pytest.approx(truth["force"])


def test_the_path_of_a_slide_is_the_exact_one() -> None:
    """A part that slides up on a plate, stops over it and is held, or goes on down, against
    `part.exact`, with the true instants: nothing is misfit."""
    for kinetic, plate in ((25.0, 4.0), (12.0, 6.0)):
        time = np.arange(16) / 960
        law: dict[str, Any] = {
            "mu_s": 2 * kinetic,
            "mu_k": kinetic,
            "mu_plate": plate,
            "force_per_mass": 1.0,
        }
        slow = np.array([-1.0, -1.0])  # the surface, far below the part's velocity all the while
        z = part.exact(time[[0, -1]], slow, output=time, v0=0.1, gravity=9.81, **law).z
        ends = np.array([time[0]]), np.array([time[-1]])
        span = Span(-1, np.arange(16), np.arange(16), *ends)
        nothing = Track(z, np.gradient(z, time))
        trial = Trial("any", time, nothing, nothing, None)
        found = slide(trial, span, 2e-6, 1e5)
        assert found is not None
        near = kinetic * np.array([1.0, 0.99, 1.01])
        told = found.log_likelihoods(near, np.full(3, plate))[:, 0]
        assert told[0] == pytest.approx(found.fixed[0], abs=0.01)
        assert told[0] > told[1:].max() + 3
        np.testing.assert_allclose(found.predicted(kinetic, plate, time), z, atol=1e-8)


def test_forces_from_a_file(tmp_path: Path) -> None:
    path, head = tmp_path / "known.csv", "\ufefftrial,force,lower,upper,mass\n"
    path.write_text(f"{head}a,0.5,0.4,,0.01\n\nb,,,12,\n", encoding="utf-8")
    found = read_forces(path, ["a", "b", "c"])
    assert found["a"].measured == pytest.approx(0.5 / 0.01 / 9.81)
    assert found["a"].lower == pytest.approx(0.4 / 0.01 / 9.81)
    assert (found["a"].upper, found["b"]) == (None, Force(upper=12.0))


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("f.csv", "name,force\na,1\n", "f.csv: row 1: the column “trial” is missing"),
        ("f.csv", "trial,force\na,1_000\n", "f.csv: row 2, column force: “1_000” is not a number."),
        ("f.csv", "trial,mass,force\na,1e-9,1\n", "row 2: mass makes more than 1e+06 weights"),
        ("f.csv", "trial,force,force\na,1,2\n", "row 1: the column “force” stands there twice."),
        (
            "f.csv",
            "trial,force\na,2e6\n",
            "row 2: force must be above 0 and at most 1e+06, not “2e",
        ),
        ("f.csv", "trial,force\na,-1\n", "f.csv: row 2: force must be above 0 and at most 1e+06, "),
        ("f.csv", "trial,force\na,much\n", "f.csv: row 2, column force: “much” is not a number."),
        ("f.csv", "trial,force\na,1,2\n", "row 2: it has 3 cells, the header 2"),
        ("f.csv", "trial,weight\na,1\n", "“weight” is none of force, lower, upper, mass"),
        ("f.csv", "trial,force\na,1\na,2\n", "row 3: the trial “a” stands there twice"),
        ("f.csv", "trial,force\nz,1\n", "there is no trial “z” (there are: a)"),
        ("f.csv", "trial,lower,upper\na,3,2\n", "row 2: lower must not be above upper"),
        ("f.csv", "trial,force\n", "holds no forces"),
        ("f.toml", "[a]\nforce = 1", "f.toml: row 1: the column “trial” is missing"),
    ],
)
def test_what_is_wrong_with_a_file_of_forces(
    name: str, text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence, before anything is fitted, and nothing written."""
    rows = [f"{i / 960},{i},{2 * i}" for i in range(12)]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],zp [mm],zo [mm]", *rows]), encoding="utf-8")
    (tmp_path / name).write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["fit", str(tmp_path), "--forces", str(tmp_path / name), "--out", str(out)]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1 and "Traceback" not in said
    assert not out.exists()


def test_options_that_cannot_be(tmp_path: Path) -> None:
    rows = [f"{i / 960},{i},{i}" for i in range(12)]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],zp [mm],zo [mm]", *rows]), encoding="utf-8")
    with pytest.raises(BadInput, match="bounds of normal forces are known"):
        cosim.fit(tmp_path, mu_k="free")
    with pytest.raises(BadInput, match="mu_k must be from"):
        cosim.fit(tmp_path, mu_k=0.0)
    with pytest.raises(BadInput, match="scheme needs"):
        cosim.fit(tmp_path, solver="published")
