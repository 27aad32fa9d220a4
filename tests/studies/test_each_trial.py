"""cosim chart trials: against a comparison made by hand, and on the published trials."""

import csv
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.cli.main import main

LIMITED = "--set=circuit.model=limited"


def rows(folder: Path) -> list[dict[str, str]]:
    with open(folder / "trials.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_run_of_the_scene_is_its_own_trial(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = cosim.run("trial-05", {"circuit.model": "limited"})
    run.save(tmp_path / "run")
    assert main(["export", str(tmp_path / "run"), "--as", "tracker"]) == 0
    folder, out = tmp_path / "trials", tmp_path / "out"
    folder.mkdir()
    text = (tmp_path / "run" / "tracker.csv").read_bytes()
    (folder / "Trial #5.csv").write_bytes(text)
    assert main(["chart", "trials", str(folder), LIMITED, "--out", str(out)]) == 0
    (found,) = rows(out)
    assert found["scene"] == "trial-05"
    assert float(found["surface's velocity: R²"]) == pytest.approx(1.0, abs=1e-6)
    assert float(found["part's height: mean error, means removed [mm]"]) < 1e-5
    # The same trial at another's drive: what the table tells is the disagreement.
    (folder / "Trial #5.csv").rename(folder / "Trial #4.csv")
    assert main(["chart", "trials", str(folder), LIMITED, "--out", str(out)]) == 0
    (found,) = rows(out)
    assert float(found["surface's velocity: R²"]) < 0.5
    assert {path.name for path in out.iterdir()} == {"trials.csv", "trials.md", "trials.png"}
    capsys.readouterr()
    (folder / "Trial #4.csv").rename(folder / "Trial #44.csv")
    assert main(["chart", "trials", str(folder), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "Trial #44.csv: there is no built-in scene trial-44" in said and said.count("\n") == 1


@pytest.mark.parametrize("number", [1, 5, 9, 10])
def test_a_saved_run_of_the_scene_covers_its_trial(
    number: int, trials: Path, tmp_path: Path
) -> None:
    """The run's last row may lie a little before the trial's."""
    run = cosim.run(f"trial-{number:02}", {"circuit.model": "limited"})
    run.save(tmp_path / "run")
    trial, out = trials / f"Trial #{number}.csv", tmp_path / "out"
    assert main(["compare", str(tmp_path / "run"), str(trial), "--out", str(out)]) == 0
    whole = cosim.compare(run.scene, trial, aligned=True)
    saved = cosim.compare(tmp_path / "run", trial)
    assert saved.numbers["velocity_r2"] == pytest.approx(whole.numbers["velocity_r2"], abs=5e-3)


def test_the_published_trials(trials: Path, tmp_path: Path) -> None:
    """The nine trials that were fitted are repeated better than a straight line does, and their
    errors are those of the columns themselves."""
    out = tmp_path / "out"
    assert main(["chart", "trials", str(trials), LIMITED, "--out", str(out)]) == 0
    found = {int(row["scene"][-2:]): row for row in rows(out)}
    assert sorted(found) == list(range(1, 11))
    for number, row in found.items():
        error, line = (
            float(row[name])
            for name in ("part's height: mean error, means removed [mm]", "of a straight line [mm]")
        )
        assert error < line or number == 6
    one = cosim.compare(
        "trial-09", trials / "Trial #9.csv", {"circuit.model": "limited"}, aligned=True
    ).found
    apart = one.simulated["z_part"] - one.recording.signals["z_part"]
    error = 1e3 * np.mean(np.abs(apart - apart.mean()))
    assert float(found[9]["part's height: mean error, means removed [mm]"]) == pytest.approx(
        error, rel=1e-9
    )
    assert one.start == cosim.load("trial-09").run.settle
