"""A normal force that changes in time: against closed forms and the reference solution."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cosim.evaluate.point import evaluate
from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.reference import monolithic

pytestmark = pytest.mark.physics

G, PART, MU_S, MU_K = 9.81, 0.009, 0.72, 0.59


def written(folder: Path, rows: Sequence[tuple[float, float]]) -> str:
    """The override that takes the normal force (N) over time (s) from a file."""
    path = folder / "grip.csv"
    lines = ["time [s],normal_force [N]", *(f"{t!r},{force!r}" for t, force in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"friction.normal_force_file={path}"


def test_a_part_is_let_go_where_friction_no_longer_carries_it(tmp_path: Path):
    # mu_s F_n(t) = m g; from there m v' = mu_k F_n(t) − m g, until the file ends: then F_n stays
    normal, rate, end = 0.5, -2.0, 0.21
    release = (normal - PART * G / MU_S) / -rate
    force = written(
        tmp_path, [(0.0, normal), (0.05, normal + rate * 0.05), (end, normal + rate * end)]
    )
    run = ["run.duration=0.3", "run.settle=0", "run.output_step=1e-4", "mechanics.tolerance=1e-12"]
    waves = simulate(load("held", [force, *run])).columns
    time = waves["time"]
    since = np.clip(time - release, 0.0, None)
    falling = np.minimum(since, end - release)
    weight_less_friction = MU_K * (normal + rate * release) / PART - G
    v = weight_less_friction * falling + 0.5 * MU_K * rate / PART * falling**2
    v += (MU_K * (normal + rate * end) / PART - G) * (since - falling)
    slips = time[np.argmax(waves["sticking"] == 0.0)]
    assert 0.0 < slips - release <= 1e-4
    after = time > release
    drop = waves["v_part"] - v
    np.testing.assert_allclose(drop[after], 0.0, atol=1e-7)
    np.testing.assert_allclose(waves["v_part"][~after], 0.0, atol=1e-12)
    expected = np.interp(time, [0.0, end], [normal, normal + rate * end])
    np.testing.assert_allclose(waves["normal_force"], expected, atol=1e-15)


def test_a_jump_of_the_force_lets_go_and_catches_at_its_time(tmp_path: Path):
    # between 0.1 and 0.12 s the part falls freely, then mu_k F_n stops it, and it stays
    caught = 0.6
    force = written(tmp_path, [(0.0, 0.5), (0.1, 0.5), (0.1, 0.0), (0.12, 0.0), (0.12, caught)])
    run = ["run.duration=0.2", "run.settle=0", "run.output_step=1e-3", "mechanics.tolerance=1e-10"]
    # a surface that hardly gives, so that it is at rest when the part stops against it
    still = ["mechanics.flexure_stiffness=1e9", "mechanics.flexure_damping=1e4"]
    result = simulate(load("held", [force, *run, *still]))
    waves = result.columns
    brake = MU_K * caught / PART - G
    fall, stop = 0.02, G * 0.02 / brake
    assert result.summary["stick_slip_events"] == 2
    height = waves["z_part"] - waves["z_part"][0]
    assert height[100] == pytest.approx(0.0, abs=1e-9)
    assert waves["v_part"][120] == pytest.approx(-G * fall, rel=1e-9)
    assert height[120] == pytest.approx(-0.5 * G * fall**2, rel=1e-6)
    assert height[-1] == pytest.approx(-0.5 * G * fall * (fall + stop), rel=1e-5)
    stuck = waves["time"][120:][waves["sticking"][120:] == 1.0][0]
    assert 0.0 <= stuck - (0.12 + stop) <= 1e-3 + 1e-5


@pytest.mark.parametrize("contact", ["compliant", "rigid"])
def test_against_the_reference(contact: str, tmp_path: Path):
    # the same straight line in two pieces: the corner must make no difference
    start, slope = 0.7, -4.0
    times = [0.0037, 0.0141, 0.0277, 0.0419, 0.0581]
    expected = monolithic.simulate(
        {"normal_force": start, "normal_force_slope": slope},
        duration=0.06,
        settle=0.0,
        contact=contact,
        circuit="ideal",
        tol=1e-11,
        times=times,
    )
    rows = [(t, start + slope * t) for t in (0.0, 0.0212345, 0.07)]
    run = ["run.duration=0.06", "run.settle=0", "run.output_step=1e-4"]
    scene = load(
        "reference",
        ["circuit.model=ideal", written(tmp_path, rows), f"mechanics.contact={contact}", *run],
    )
    result = simulate(scene)
    assert expected.stick_slip_events > 8
    assert result.summary["stick_fraction"] == pytest.approx(expected.stick_fraction, abs=1e-6)
    at = np.round(np.array(times) / 1e-4).astype(int)
    for name, allowed in (("z_surface", 2e-9), ("z_part", 2e-9), ("v_part", 5e-7)):
        found = result.columns[name][at]
        np.testing.assert_allclose(found, expected.samples[name], rtol=0, atol=allowed)
    assert result.summary["energy_residual"] < 1e-7  # pyright: ignore[reportOperatorIssue]


@pytest.mark.parametrize("model", ["none", "ideal", "amplifier", "full"])
def test_a_constant_force_in_a_file_is_a_constant_force(model: str, tmp_path: Path):
    run = [f"circuit.model={model}", "run.duration=0.05"]
    scene = load("reference", [written(tmp_path, [(0.0, 0.6), (0.01, 0.6), (0.02, 0.6)]), *run])
    found = evaluate(scene, {"run.duration": 0.05}, whole_periods=False)
    expected = evaluate(
        load("reference", ["friction.normal_force=0.6", *run]), {}, whole_periods=False
    )
    assert not found.failure
    assert found.numbers["v_average"] == pytest.approx(
        expected.numbers["v_average"], rel=1e-4, abs=1e-9
    )
    assert found.numbers["stick_slip_events"] == expected.numbers["stick_slip_events"]
