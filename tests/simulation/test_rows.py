"""All columns of a row are of one instant and one side: at a jump, of what is before it."""

from pathlib import Path

import numpy as np
import pytest

from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate

pytestmark = pytest.mark.physics

# Falls, and the square's rises, are on rows.
DRIVES = {
    "sawtooth": [],
    "square": ["drive.waveform=square"],
    "staircase": ["drive.quantised=true"],
    "square, stronger grip": ["drive.waveform=square", "friction.normal_force=2"],
}


def missing(scene: Scene, w: dict[str, np.ndarray]) -> np.ndarray:
    """What a row leaves of the surface's m z̈ = sum of forces, N."""
    coil, m = scene.coil, scene.mechanics
    q, speed = w["z_ram"] - w["z_surface"], w["v_ram"] - w["v_surface"]
    on_ram = coil.force_factor * w["current"] - m.suspension_damping * speed
    on_ram -= q * (m.suspension_k1 + q * (m.suspension_k2 + q * m.suspension_k3))
    depth, side = np.maximum(np.abs(q) - m.travel, 0.0), np.sign(q)
    push = np.maximum(1.0 + m.contact_damping * side * speed, 0.0)
    on_ram -= side * m.contact_stiffness * depth**1.5 * push
    springs = m.flexure_stiffness * w["z_surface"] + m.flexure_damping * w["v_surface"]
    on_surface = -on_ram - springs - w["friction_force"] - m.surface_mass * m.gravity
    return m.surface_mass * w["a_surface"] - on_surface


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("model", ["ideal", "limited", "amplifier"])
def test_forces_balance_in_every_row(model: str, drive: str) -> None:
    settings = [f"circuit.model={model}", "run.duration=0.2", "run.settle=0.1", *DRIVES[drive]]
    scene = load("reference", settings)
    w = simulate(scene).columns
    jumps = np.flatnonzero(np.abs(np.diff(w["command"])) > 4.0)
    assert len(jumps) >= 3
    np.testing.assert_allclose(missing(scene, w), 0.0, rtol=0, atol=1e-10)
    # The first row: at rest, before the command begins.
    assert [w[name][0] for name in ("command", "current", "coil_voltage", "v_part")] == [0.0] * 4
    # Just before each period's end the sawtooth is at its peak, the square at its lowest.
    ends = w["command"][np.searchsorted(w["time"], [0.05, 0.1, 0.15])]
    expected = -5.2 if drive.startswith("square") else 2.8
    np.testing.assert_allclose(ends, expected, rtol=0, atol=0.02)
    if model == "ideal":
        np.testing.assert_allclose(w["current"], w["command"] / 4.0, rtol=0, atol=1e-14)
    if model == "ideal" and drive == "sawtooth":
        slope = 8.0 * 20.0 / 4.0  # A/s
        coil = scene.coil.resistance * w["current"] + scene.coil.inductance * slope + w["back_emf"]
        np.testing.assert_allclose(w["coil_voltage"][1:], coil[1:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("model", ["ideal", "limited"])
def test_so_they_do_with_two_surfaces(model: str) -> None:
    settings = [f"circuit.model={model}", "drive.phase_deg=90", "run.duration=0.2"]
    scene = load("two-surfaces", [*settings, "drive.frequency=20", "run.output_step=1e-4"])
    w = simulate(scene).columns
    assert np.abs(np.diff(w["command_2"])).max() > 4.0
    np.testing.assert_allclose(missing(scene, w), 0.0, rtol=0, atol=1e-10)
    names = [name.removesuffix("_2") for name in w if name.endswith("_2")]
    other = {name: w[f"{name}_2"] for name in names}
    np.testing.assert_allclose(missing(scene, other), 0.0, rtol=0, atol=1e-10)


def test_friction_belongs_to_the_normal_force_of_its_row(tmp_path: Path) -> None:
    grip = tmp_path / "grip.csv"
    grip.write_text("time [s],normal_force [N]\n0,0.5\n0.05,0.5\n0.05,0.9\n0.08,0.3\n")
    settings = [f"friction.normal_force_file={grip}", "run.duration=0.1", "run.settle=0"]
    w = simulate(
        load("reference", ["circuit.model=ideal", "drive.frequency=70", *settings])
    ).columns
    jump = np.searchsorted(w["time"], 0.05)
    assert w["normal_force"][jump] == 0.5 < w["normal_force"][jump + 1]
    slips = w["sticking"] == 0.0
    assert 0.2 < slips.mean() < 0.8
    pull = np.abs(w["friction_force"])
    np.testing.assert_allclose(pull[slips], 0.59 * w["normal_force"][slips], rtol=1e-9)
    assert (pull <= 0.72 * w["normal_force"] * (1 + 1e-9)).all()


@pytest.mark.parametrize("scene", ["trial-05", "paper", "quaid"])
def test_a_slope_does_not_depend_on_the_rows(scene: str) -> None:
    """That of the straight line through the part's heights at settle + k/960 s, where rows lie."""
    frames, settle = 240, 0.31
    duration = settle + frames / 960
    settings = [f"run.settle={settle}", f"run.duration={duration!r}", "run.average=slope"]
    if scene != "quaid":
        settings.append("circuit.model=limited")
    found = [
        simulate(load(scene, [*settings, f"run.output_step={step!r}"]))
        for step in (1 / 96000, 7e-3, 0.1)
    ]
    fine = found[0].columns
    time = settle + np.arange(frames + 1) / 960
    heights = np.interp(time, fine["time"], fine["z_part"])
    truth = np.polyfit(time - settle, heights, 1)[0]
    for result in found:
        assert result.summary["v_average"] == pytest.approx(truth, rel=1e-6)
