"""What the package tells of the published trials, against the trials themselves."""

from pathlib import Path

import numpy as np
import pytest

from cosim.scene import changed, load
from cosim.trials.camera import accelerations
from cosim.trials.measured import OF_PAPER, measured
from cosim.trials.tracked import read_folder


def test_statistics_are_those_of_the_records(trials: Path) -> None:
    for number, trial in enumerate(read_folder(trials), 1):  # in the order of their numbers
        found = measured(load(f"trial-{number:02d}"))
        assert found is not None and found[0] == number
        z, t, surface = trial.part.z, trial.time, trial.platform
        expected = {
            "v_average": np.polyfit(t, z, 1)[0],
            "z_surface_pp": np.ptp(surface.z),
            "v_surface_min": np.nanmin(surface.v),
            "v_surface_max": np.nanmax(surface.v),
            "a_camera_min": np.nanmin(accelerations(surface.z)),
            "a_camera_max": np.nanmax(accelerations(surface.z)),
        }
        for name, value in expected.items():
            assert found[1][name] == pytest.approx(value, rel=0.01, abs=1e-5), (number, name)
        if number == OF_PAPER:
            paper = measured(load("paper"))
            assert paper is not None and paper[1]["v_average"] == found[1]["v_average"]


def test_another_motion_has_no_measured_one() -> None:
    paper = load("paper")
    assert measured(changed(paper, {"circuit.model": "limited"}, "here")) == measured(paper)
    assert measured(changed(paper, {"drive.amplitude": 5.0}, "here")) is None
    assert measured(load("reference")) is None


def test_a_scene_of_ones_own_may_be_called_as_a_trial(tmp_path: Path) -> None:
    """As ``identify`` calls those of more trials than were published."""
    own = tmp_path / "trial-12.toml"
    own.write_text('base = "paper-limited"\n', encoding="utf-8")
    assert measured(load(own)) is None
