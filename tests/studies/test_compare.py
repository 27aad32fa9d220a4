"""cosim compare, on made-up trials whose answer is known."""

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.compare.compare import explained, measure
from cosim.trials.camera import FRAME_RATE, film, frame_times, hermite, velocities
from cosim.trials.tracked import read


def write_trial(path: Path, time: np.ndarray, surface: np.ndarray, part: np.ndarray) -> None:
    """A trial in the published form, mm; velocities are left to the reader's differences."""
    rows = ["t,xp,zp,vxp,vzp,xo,zo"]
    rows += [
        f"{t:.8f},0,{1e3 * s!r},0,,0,{1e3 * p!r}"
        for t, s, p in zip(time.tolist(), surface.tolist(), part.tolist(), strict=True)
    ]
    path.write_text("\r\n".join(rows), encoding="utf-8")


def test_a_run_compared_with_itself_through_the_camera(tmp_path: Path) -> None:
    scene = load("ideal-current", ["run.duration=0.8", "run.settle=0.3"])
    waves = simulate(scene).columns
    frames = film(waves, frame_times(0.3125, 300), 0.0)
    write_trial(tmp_path / "own.csv", frames.time, frames.z_surface, frames.z_part)
    metrics, simulated, measured = measure(waves, read(tmp_path / "own.csv"), 0.3, 0.05)
    # The phase is searched on a grid of an eighth of a millisecond; the true one is on it.
    assert metrics.start == pytest.approx(0.3125, abs=1.3e-4)
    assert metrics.velocity_r2 > 0.999
    assert metrics.mean_error_mm < 0.01
    assert metrics.drift_error == pytest.approx(0.0, abs=5e-5)
    assert metrics.kick_simulated == pytest.approx(metrics.kick_measured, rel=0.1)
    assert metrics.horizontal_share == 0.0
    assert len(simulated.time) == len(measured.time) == 300


def test_metrics_of_a_known_difference(tmp_path: Path) -> None:
    scene = load("ideal-current", ["run.duration=0.8", "run.settle=0.3"])
    waves = simulate(scene).columns
    frames = film(waves, frame_times(0.3, 300), 0.0)
    slower = frames.z_part - 2e-3 * frames.time  # drifts 2 mm/s less
    write_trial(tmp_path / "own.csv", frames.time, frames.z_surface, slower)
    metrics, _, _ = measure(waves, read(tmp_path / "own.csv"), 0.3, 0.05)
    assert metrics.drift_error == pytest.approx(2e-3, abs=1e-4)
    span = 299 / FRAME_RATE
    assert metrics.mean_error_mm == pytest.approx(2.0 * span / 2, rel=0.03)


def test_command_writes_table_and_figure(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    run = tmp_path / "run"
    assert main(["run", "ideal-current", "--set", "run.duration=0.8", "--out", str(run)]) == 0
    time = np.arange(200) / FRAME_RATE
    write_trial(tmp_path / "t.csv", time, 4e-4 * np.sin(126 * time), 1e-2 * time)
    out = tmp_path / "out"
    assert main(["compare", str(run), str(tmp_path / "t.csv"), "--out", str(out)]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {"compare.json", "compare.csv", "frames.csv", "compare.png"}
    numbers = json.loads((out / "compare.json").read_text())
    assert numbers["drift_measured"] == pytest.approx(0.01, rel=1e-6)
    assert "mean_error_mm" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, told",
    [
        (["paper", "gone.csv"], "gone.csv"),
        (["nosuch", "t.csv"], "nosuch"),
        (["run", "t.csv", "--set", "run.duration=1"], "finished run"),
    ],
)
def test_bad_input(
    arguments: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    time = np.arange(50) / FRAME_RATE
    write_trial(tmp_path / "t.csv", time, 0.0 * time, 0.0 * time)
    assert main(["compare", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_interpolation_is_exact_for_cubics() -> None:
    time = np.linspace(0.0, 1.0, 11)
    at = np.linspace(0.0, 1.0, 57)
    z, v = 2 * time**3 - time**2 + 0.5, 6 * time**2 - 2 * time
    np.testing.assert_allclose(hermite(at, time, z, v), 2 * at**3 - at**2 + 0.5, atol=1e-14)


def test_differences_and_r2() -> None:
    time = np.arange(20) / FRAME_RATE
    v = velocities(time, 3.0 * time**2)
    assert np.isnan(v[[0, -1]]).all()
    np.testing.assert_allclose(v[1:-1], 6.0 * time[1:-1], atol=1e-9)
    wanted = np.sin(time * 300)
    assert explained(wanted, wanted) == 1.0
    assert explained(np.full(20, wanted.mean()), wanted) == pytest.approx(0.0, abs=1e-12)
