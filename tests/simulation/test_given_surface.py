"""Runs with a given surface: against the theory, and against the FMU in its prescribed mode."""

import json
import math
import warnings
from pathlib import Path

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.drive.surface.formulas import Transport, average_velocity
from cosim.drive.surface.waveforms import quaid_cycle, quaid_velocity
from cosim.errors import BadInput, Note
from cosim.mechanics import part
from cosim.scene import Scene, load
from cosim.simulation.rungs import given_surface as prescribed
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import Bench
from tests.helpers.sine_part import SinePart

pytestmark = [pytest.mark.physics, pytest.mark.usefixtures("undrawn")]


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


def sine_scene(half: float, mu_plate: float = 0.0, *more: str) -> Scene:
    """A surface that moves as a sine of 20 Hz; averages from its second period on."""
    sine = ["drive.waveform=sine", f"drive.velocity_amplitude={half}"]
    times = ["run.settle=0.1", "run.duration=0.52"]
    return load("optimal", [*sine, f"friction.mu_plate={mu_plate}", *times, *more])


def test_sine_gives_the_surface_its_motion() -> None:
    waves = simulate(sine_scene(0.2)).columns
    turn = 2 * np.pi * 20.0
    phase = turn * waves["time"]
    for name, expected in (
        ("z_surface", 0.2 / turn * (1 - np.cos(phase))),
        ("v_surface", 0.2 * np.sin(phase)),
        ("a_surface", 0.2 * turn * np.cos(phase)),
    ):
        scale = np.abs(expected).max()
        np.testing.assert_allclose(waves[name], expected, rtol=0, atol=1e-12 * scale, err_msg=name)


@pytest.mark.parametrize("mu_plate", [0.0, 0.1])
@pytest.mark.parametrize("half", [0.15, 0.2, 0.35, 0.6])
def test_a_sine_agrees_with_another_solver(half: float, mu_plate: float) -> None:
    scene = sine_scene(half, mu_plate, "run.output_step=0.02", "coil.count=3")
    mass, force = scene.mechanics.part_mass, prescribed.force_per_mass(scene)
    mu_s, mu_k = scene.friction.mu_s, scene.friction.mu_k
    other = SinePart(half, scene.drive.frequency, mu_s * force, mu_k * force, mu_plate * force)
    settled, end = other.height_at(0.1), other.height_at(0.52)
    found = simulate(scene).summary
    assert found["v_average"] == pytest.approx((end - settled) / 0.42, rel=1e-9)
    assert found["stick_slip_events"] == sum(0.1 <= t < 0.52 for t in other.events)
    assert found["energy_in"] == pytest.approx(3 * mass * other.work, rel=1e-10)
    assert found["energy_friction"] == pytest.approx(3 * mass * other.heat, rel=1e-10, abs=1e-18)
    assert found["energy_residual"] < 1e-13


def test_extremes_are_those_of_the_motion_however_far_apart_the_rows() -> None:
    found = simulate(sine_scene(0.2, 0.0, "run.output_step=0.02")).summary
    turn = 2 * np.pi * 20.0
    for name, half in (("v", 0.2), ("a", 0.2 * turn)):
        assert found[f"{name}_surface_max"] == pytest.approx(half, rel=1e-14)
        assert found[f"{name}_surface_min"] == pytest.approx(-half, rel=1e-14)
    assert found["z_surface_pp"] == pytest.approx(2 * 0.2 / turn, rel=1e-12)
    scene = load("quaid", ["run.output_step=0.02", "run.settle=0.0613"])
    found = simulate(scene).summary
    slow = (0.7 * 5 - 1) * 9.81
    cycle = quaid_cycle(slow, scene.drive.acceleration_max, 0.05)
    top = cycle.knots()[1].max()
    assert (found["v_surface_max"], found["v_surface_min"]) == pytest.approx((top, -top), rel=1e-8)
    assert found["z_surface_pp"] == pytest.approx(cycle.stroke(), rel=1e-8)
    # Before the surface turns back for the first time.
    found = simulate(load("quaid", ["run.settle=0.001", "run.duration=0.011"])).summary
    assert found["v_surface_max"] == pytest.approx(0.011 * slow, rel=1e-8)
    assert found["v_surface_min"] == pytest.approx(0.001 * slow, rel=1e-8)
    assert found["z_surface_pp"] == pytest.approx(slow * (0.011**2 - 0.001**2) / 2, rel=1e-8)


GIVEN = ["circuit.model=none", "drive.waveform=file"]


def test_own_waveforms_move_the_part_again(tmp_path: Path) -> None:
    from cosim.waveforms.storage import write_csv

    first = simulate(load("reference", ["circuit.model=ideal", "run.duration=0.2"]))
    write_csv(tmp_path / "w.csv", first.columns, dict.fromkeys(first.columns, "s"))
    text = (tmp_path / "w.csv").read_text().replace("v_surface [s]", "v_surface [m/s]")
    (tmp_path / "w.csv").write_text(text)
    given = [*GIVEN, f"drive.file={tmp_path / 'w.csv'}", "run.output_step=1e-4"]
    again = simulate(load("reference", [*given, "run.duration=0.2", "run.settle=0.1"]))
    assert again.summary["v_average"] == pytest.approx(first.summary["v_average"], rel=0.04)


@pytest.mark.parametrize(
    "text, told",
    [
        (
            "time [s],v_surface [m/s]\n0,0\n1e-3,x\n",
            "row 3, column v_surface .*: “x” is not a number",
        ),
        ("time [s],v_surface [m/s]\n0,0\n", "at least two rows"),
        ("time [s],v_surface [m/s]\n0,0\n2,1\n1,1\n", "row 4: the time must not fall"),
        ("time [s],v_surface [m/s]\n0,0\n0.01,1\n", "run.duration = 0.32 s must be at most 0.01 s"),
    ],
)
def test_bad_surface_files(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=told):
        simulate(load("trial", [f"drive.file={path}"]))


def test_a_gap_in_the_surface_is_told(tmp_path: Path) -> None:
    rows = [f"{k},{100 * (k % 2)}" for k in range(200)]
    path = tmp_path / "own.csv"
    given = [f"drive.file={path}", "run.duration=0.15", "run.settle=0"]
    for row in (None, 0, 60):  # none, before the first one, between two
        table = [f"{k}," if k == row else text for k, text in enumerate(rows)]
        path.write_text("\n".join(["time [ms],v_surface [mm/s]", *table, ""]))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", Note)
            simulate(load("trial", given))
        said = [
            str(one.message) for one in told if "no velocity of the surface" in str(one.message)
        ]
        assert len(said) == (row == 60), said
    assert "own.csv: no velocity of the surface from 0.059 to 0.061 s; a straight line" in said[0]


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


@pytest.mark.parametrize("mu_plate", [0.0, 0.05])
def test_energies_against_a_fine_quadrature(mu_plate: float) -> None:
    settings = ["run.duration=0.2", f"friction.mu_plate={mu_plate}"]
    fine = simulate(load("quaid", [*settings, "run.output_step=1e-6"]))
    w, friction = fine.columns, fine.scene.friction
    power_in = w["friction_force"] * w["v_surface"]
    lost = w["friction_force"] * (w["v_surface"] - w["v_part"])
    lost += mu_plate * friction.normal_force * np.abs(w["v_part"])
    h = np.diff(w["time"])
    coarse = simulate(load("quaid", [*settings, "run.output_step=0.02"])).summary
    assert np.dot(power_in[1:], h) == pytest.approx(coarse["energy_in"], rel=1e-4)
    assert np.dot(lost[1:], h) == pytest.approx(coarse["energy_friction"], rel=1e-4)
    for name in ("energy_in", "energy_friction", "energy_stored"):
        assert coarse[name] == pytest.approx(fine.summary[name], rel=1e-10), name
    assert coarse["energy_residual"] < 1e-12


def test_rows_are_of_one_side_of_a_corner(tmp_path: Path) -> None:
    """Corners and jumps of the surface's velocity are on rows, which hold what is before them."""
    knots = np.arange(21) * 0.01
    speeds = np.cumsum(np.random.default_rng(2).choice([-0.9, -0.25, 0.3, 0.6], 21))
    times = np.insert(knots, 11, knots[10])  # a jump
    speeds = np.insert(speeds, 11, speeds[10] + 0.1)
    table = "\n".join(f"{t!r},{v!r}" for t, v in zip(times.tolist(), speeds.tolist(), strict=True))
    (tmp_path / "own.csv").write_text(f"time [s],v_surface [m/s]\n{table}\n")
    settings = [f"drive.file={tmp_path / 'own.csv'}", "friction.mu_plate=0.05"]
    times_of_run = ["run.duration=0.2", "run.settle=0", "run.output_step=1e-3"]
    scene = load("reference", [*GIVEN, *settings, *times_of_run])
    w, friction, mechanics = simulate(scene).columns, scene.friction, scene.mechanics

    slopes = np.diff(speeds)[np.diff(times) > 0] / 0.01
    piece = np.maximum(np.ceil(np.arange(201) / 10).astype(int) - 1, 0)
    np.testing.assert_allclose(w["a_surface"], slopes[piece], rtol=0, atol=1e-9)
    assert w["v_surface"][100] == pytest.approx(speeds[10], abs=1e-12)
    plate = -0.05 * friction.normal_force * np.sign(w["v_part"])
    a_part = (w["friction_force"] + plate) / mechanics.part_mass - mechanics.gravity
    sticks = w["sticking"] == 1.0
    assert 20 < sticks.sum() < 180
    np.testing.assert_allclose(a_part[sticks], w["a_surface"][sticks], rtol=0, atol=1e-9)
    # Means of the steps that end in the rows, of those in which nothing changes.
    mean = np.diff(w["v_part"]) / 1e-3
    whole = np.abs(np.diff(w["friction_force"]) + np.diff(plate)) < 1e-12
    assert whole.sum() > 120
    np.testing.assert_allclose(a_part[1:][whole], mean[whole], rtol=0, atol=1e-8)
    assert whole[9::10].sum() > 12  # steps that end on corners


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
