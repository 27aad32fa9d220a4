"""Runs with a given surface: against the theory, and against the FMU in its prescribed mode."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.drive.surface.formulas import Transport, average_velocity
from cosim.drive.surface.waveforms import quaid_velocity
from cosim.errors import BadInput
from cosim.mechanics import part
from cosim.scene import Scene, load
from cosim.simulation.rungs import given_surface as prescribed
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import Bench

pytestmark = pytest.mark.physics


def fmu_part(
    times: np.ndarray,
    velocities: np.ndarray,
    *,
    mu_s: float,
    mu_k: float,
    normal_force: float,
    part_mass: float = 0.009,
    gravity: float = 9.81,
    mu_plate: float = 0.0,
) -> np.ndarray:
    """Heights of the part at the knots, by the FMU; a time given twice is a jump."""
    heights = [0.0]
    with Bench(
        prescribed=1,
        mu_s=mu_s,
        mu_k=mu_k,
        mu_plate=mu_plate,
        normal_force=normal_force,
        part_mass=part_mass,
        gravity=gravity,
        surface_velocity=float(velocities[0]),
    ) as bench:
        for k in range(len(times) - 1):
            h = float(times[k + 1] - times[k])
            if h > 0.0:
                slope = float(velocities[k + 1] - velocities[k]) / h
                bench.set(surface_velocity=float(velocities[k]), surface_acceleration=slope)
                bench.step(h)
            heights.append(bench.get("z_part")[0])
    return np.array(heights)


@pytest.mark.parametrize("mu_plate", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(6))
def test_fmu_follows_the_closed_form(seed: int, mu_plate: float) -> None:
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(1e-4, 5e-3, 120))
    times -= times[0]
    velocities = np.cumsum(random.normal(0.0, 0.03, 120)) * random.uniform(0.2, 1.0)
    if seed % 2:  # jumps
        times[50] = times[49]
        times[80] = times[79]
    mu_s, mu_k = 0.72, 0.59 if seed < 4 else 0.72
    exact = part.exact(
        times, velocities, force_per_mass=0.5 / 0.009, mu_plate=mu_plate, mu_s=mu_s, mu_k=mu_k
    )
    found = fmu_part(times, velocities, normal_force=0.5, mu_plate=mu_plate, mu_s=mu_s, mu_k=mu_k)
    assert exact.stick_slip_events > 5
    np.testing.assert_allclose(found, exact.z, rtol=0, atol=1e-9)


@pytest.mark.parametrize("number", range(1, 11))
def test_fmu_follows_every_trial(number: int, trials: Path) -> None:
    times, velocities = prescribed.read_surface(trials / f"Trial #{number}.csv")
    exact = part.exact(times, velocities, mu_s=0.72, mu_k=0.59, force_per_mass=7.0 * 9.81)
    found = fmu_part(times, velocities, mu_s=0.72, mu_k=0.59, normal_force=7.0 * 9.81 * 0.009)
    np.testing.assert_allclose(found, exact.z, rtol=0, atol=1e-9)


def test_optimal_scene_meets_the_closed_form() -> None:
    scene = load("optimal")
    found = simulate(scene).summary["v_average"]
    expected = average_velocity(Transport(0.7, 0.6, 98.1, 5.0, 0.05))
    assert found == pytest.approx(expected, rel=1e-7)
    assert found == pytest.approx(0.3106508876 * 9.81 * 0.05, rel=1e-7)


def average(scene: Scene) -> float:
    found = simulate(scene).summary["v_average"]
    assert isinstance(found, float)
    return found


@pytest.mark.parametrize("optimum, sign", [("up", 1), ("robust", 1), ("down", -1)])
def test_variants(optimum: str, sign: int) -> None:
    scene = load("optimal", [f"drive.optimum={optimum}"])
    found = average(scene)
    direction = "down" if optimum == "down" else "up"
    robust = optimum == "robust"
    expected = average_velocity(Transport(0.7, 0.6, 98.1, 5.0, 0.05, direction, robust))
    assert sign * found > 0
    assert found == pytest.approx(expected, rel=1e-6)


def test_quaid_scene_meets_the_closed_form() -> None:
    found = simulate(load("quaid")).summary["v_average"]
    assert found == pytest.approx(quaid_velocity(Transport(0.7, 0.6, 98.1, 5.0, 0.05)), rel=1e-6)


def test_horizontal_scene_meets_the_closed_form() -> None:
    # Umbanhowar and Lynch: phases at +µ_s g, -a, +a, the part slowed by µ_k g while it slips.
    mu_s, mu_k, a, period, g = 0.7, 0.6, 19.62, 0.05, 9.81
    first = period * mu_k / (mu_s + mu_k)
    second = 0.5 * (period + first * (1 + mu_s * g / a))
    # The part's velocity over the surface's mean: exact kinematics of the three phases.
    v = np.array([0.0, mu_s * g * first])
    v = np.append(v, v[-1] - a * (second - first))
    v = np.append(v, v[-1] + a * (period - second))
    t = np.array([0.0, first, second, period])
    surface = 0.5 * np.dot(v[1:] + v[:-1], np.diff(t))
    slipped = v[1] * (period - first) - 0.5 * mu_k * g * (period - first) ** 2
    moved = 0.5 * v[1] * first + slipped
    expected = (moved - surface) / period
    found = simulate(load("umbanhowar")).summary["v_average"]
    assert found == pytest.approx(expected, rel=1e-6)


def test_sine_gives_the_surface_its_velocity() -> None:
    scene = load("optimal", ["drive.waveform=sine", "drive.velocity_amplitude=0.2"])
    waves = simulate(scene).columns
    expected = 0.2 * np.sin(2 * np.pi * 20.0 * waves["time"])
    np.testing.assert_allclose(waves["v_surface"], expected, rtol=0, atol=3e-7)


def test_own_waveforms_move_the_part_again(tmp_path: Path) -> None:
    from cosim.waveforms.storage import write_csv

    first = simulate(load("paper", ["circuit.model=ideal", "run.duration=0.2"]))
    write_csv(tmp_path / "w.csv", first.columns, dict.fromkeys(first.columns, "s"))
    text = (tmp_path / "w.csv").read_text().replace("v_surface [s]", "v_surface [m/s]")
    (tmp_path / "w.csv").write_text(text)
    again = simulate(
        load("trial", [f"drive.file={tmp_path / 'w.csv'}", "run.duration=0.2", "run.settle=0.1"])
    )
    assert again.summary["v_average"] == pytest.approx(first.summary["v_average"], rel=0.04)


@pytest.mark.parametrize(
    "text, told",
    [
        ("time,velocity\n0,0\n1e-3,x\n", "row 3, column 2: a number is needed"),
        ("time,velocity\n0,0\n", "at least two rows"),
        ("time,velocity\n0,0\n2,1\n1,1\n", "row 4: the time must not fall"),
        ("time,velocity\n0,0\n0.01,1\n", "run.duration = 0.32 s must be at most 0.01 s"),
    ],
)
def test_bad_surface_files(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=told):
        simulate(load("trial", [f"drive.file={path}"]))


def test_trial_needs_a_file() -> None:
    with pytest.raises(BadInput, match=r"drive\.file must name"):
        simulate(load("trial"))


@pytest.mark.parametrize("name", ["optimal", "quaid", "umbanhowar"])
def test_command_writes_only_what_the_scene_has(name: str, tmp_path: Path) -> None:
    assert main(["run", name, "--set", "run.duration=0.3", "--out", str(tmp_path)]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "waveforms.csv",
        "waveforms.nc",
        "summary.json",
        "scene.toml",
        "figure.png",
    }
    header = (tmp_path / "waveforms.csv").read_text().partition("\n")[0]
    assert header == (
        "time [s],z_surface [m],v_surface [m/s],a_surface [m/s2],z_part [m],v_part [m/s],"
        "friction_force [N],sticking [1]"
    )
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["energy_residual"] < 1e-9
    assert summary["method"] == "exact" and summary["fmu_steps"] == 0


def test_energies_against_a_fine_quadrature() -> None:
    result = simulate(load("quaid", ["run.duration=0.2", "run.output_step=1e-6"]))
    w, summary = result.columns, result.summary
    power_in = w["friction_force"] * w["v_surface"]
    lost = w["friction_force"] * (w["v_surface"] - w["v_part"])
    h = np.diff(w["time"])
    assert np.dot(power_in[:-1], h) == pytest.approx(summary["energy_in"], rel=1e-3)
    assert np.dot(lost[:-1], h) == pytest.approx(summary["energy_friction"], rel=1e-3)


def test_a_shutter_blurs_a_sine_as_the_closed_form_has_it() -> None:
    """Over an exposure ε a sine of frequency f shrinks by sin(π f ε)/(π f ε), and Tracker's
    five-point difference takes (4 cos 2φ − 2 cos φ − 2)/(7 Δt²) of it, φ = 2 π f Δt.
    """
    f, dt, speed = 80.0, 1 / 960, 0.1
    scene = ["drive.waveform=sine", f"drive.frequency={f}", f"drive.velocity_amplitude={speed}"]
    phase = 2 * math.pi * f * dt
    differenced = (4 * math.cos(2 * phase) - 2 * math.cos(phase) - 2) / (7 * dt**2)
    sharp = speed / (2 * math.pi * f) * abs(differenced)
    for shutter in (0.0, 0.4, 1.0):
        found = simulate(load("optimal", [*scene, "run.duration=0.5", f"run.shutter={shutter}"]))
        blur = np.sinc(f * shutter * dt)
        for extreme in ("max", "min"):  # twelve frames a period meet both crests
            read = abs(found.summary[f"a_camera_{extreme}"])
            assert read == pytest.approx(blur * sharp, rel=2e-4), (shutter, extreme)
