"""Two surfaces that move by themselves: against one surface, closed forms and a reference."""

from math import floor

import numpy as np
import pytest

from cosim.errors import BadInput
from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import COMPLIANT, FREE_BODIES, RIGID, Bench
from tests.reference import two_surfaces

pytestmark = pytest.mark.physics

SURFACE, PART, MU_S, MU_K, NORMAL = 0.0145, 0.009, 0.72, 0.59, 0.5
PAIR = {"independent": 1, "n_surfaces": 2}
EXACT = "mechanics.tolerance=1e-10"
TWICE = [  # the rig of the scene reference
    "circuit.model=limited", "drive.phase_deg=90", "mechanics.n_surfaces=2",
    "mechanics.part_mass=0.018",
]  # fmt: skip
ENERGIES = ("energy_in", "energy_friction", "energy_impact", "energy_damping", "energy_stored")


@pytest.mark.parametrize("contact", [COMPLIANT, RIGID])
def test_in_phase_they_are_one_surface_with_half_the_part(contact: int):
    names = ("z_surface", "z_ram", "z_part", "v_part", "friction_force")
    common = {"contact": contact, "tolerance": 1e-13}
    with (
        Bench(part_mass=PART, **common) as one,
        Bench(part_mass=2.0 * PART, **PAIR, **common) as two,
    ):
        generator = np.random.default_rng(3)
        for n in range(300):
            current, slope = generator.uniform((-1.0, -300.0), (1.0, 300.0))
            one.run_to(1e-3 * (n + 1), current=current, current_slope=slope)
            two.run_to(
                1e-3 * (n + 1),
                current=current,
                current_slope=slope,
                current_2=current,
                current_2_slope=slope,
            )
            assert two.get(*names) == pytest.approx(one.get(*names), rel=1e-9, abs=1e-10)
            assert two["z_surface_2"] == pytest.approx(two["z_surface"], abs=1e-13)
            assert two["sticking"] == two["sticking_2"] == one["sticking"]
        assert one["impacts"] > 5 and one["stick_slip_events"] > 30
        assert two.get("impacts", "stick_slip_events") == [
            2.0 * count for count in one.get("impacts", "stick_slip_events")
        ]
        for name in ENERGIES:
            assert two[name] == pytest.approx(2.0 * one[name], rel=1e-10)


@pytest.mark.parametrize("model", ["ideal", "limited"])
def test_a_scene_in_phase_is_the_scene_of_one(model: str):
    run = [f"circuit.model={model}", "run.duration=0.5", "run.settle=0.25", EXACT]
    one = simulate(load("reference", run)).summary
    result = simulate(load("reference", [*TWICE, *run, "drive.phase_deg=0"]))
    two, waves = result.summary, result.columns
    assert two["v_average"] == pytest.approx(one["v_average"], rel=1e-7)
    assert two["stick_fraction"] == pytest.approx(one["stick_fraction"], rel=1e-8)
    assert two["stick_fraction_2"] == pytest.approx(two["stick_fraction"], rel=1e-8)
    for name in (*ENERGIES[:-1], "energy_copper"):
        assert two[name] == pytest.approx(2.0 * one[name], rel=1e-7)  # pyright: ignore
    for name in ("current", "coil_voltage", "v_surface", "friction_force"):
        np.testing.assert_allclose(waves[f"{name}_2"], waves[name], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("model", ["ideal", "limited"])
@pytest.mark.parametrize("contact", ["compliant", "rigid"])
def test_the_energy_account_closes_at_any_phase(model: str, contact: str):
    for phase in (0, 45, 180, 299):
        keys = [f"circuit.model={model}", f"mechanics.contact={contact}"]
        run = ["run.duration=0.3", "run.settle=0.1", "run.output_step=1e-3", EXACT]
        scene = load("reference", [*TWICE, *keys, f"drive.phase_deg={phase}", *run])
        assert simulate(scene).summary["energy_residual"] < 1e-9  # pyright: ignore


def test_forces_against_each_other_hold_until_one_breaks_away():
    # Pushed apart by ±F(t) all stands still until F = mu_s F_n. With one surface sliding, kinetic
    # friction pulls the part less, and static friction holds it to the other a while longer, until
    # (m F + m_s mu_k F_n)/(m + m_s) = mu_s F_n.
    slope = 20.0  # N/s
    release = MU_S * NORMAL / slope
    second = (MU_S + SURFACE / PART * (MU_S - MU_K)) * NORMAL / slope

    def gained(since: float) -> float:  # impulse of what exceeds kinetic friction, N s
        return (MU_S - MU_K) * NORMAL * since + 0.5 * slope * since**2

    with Bench(**FREE_BODIES, **PAIR, travel=1.0, part_mass=PART, tolerance=1e-13) as bench:
        bench.run_to(0.9 * release, current_slope=slope, current_2_slope=-slope)
        held = slope * 0.9 * release
        assert bench.get("friction_force", "friction_force_2") == pytest.approx([-held, held])
        assert bench["v_part"] == pytest.approx(0.0, abs=1e-15)
        bench.run_to(1.2 * release)
        common = gained(0.2 * release) / (SURFACE + PART)
        speeds = sorted(bench.get("v_surface", "v_surface_2"), key=abs)
        assert np.abs(speeds) == pytest.approx([common, gained(0.2 * release) / SURFACE], rel=1e-9)
        assert bench["v_part"] == pytest.approx(speeds[0], rel=1e-12)
        assert bench["stick_slip_events"] == 1.0
        bench.run_to(second * (1.0 - 1e-9))
        assert bench["stick_slip_events"] == 1.0
        bench.run_to(second * (1.0 + 1e-9))
        assert bench.get("sticking", "sticking_2", "stick_slip_events") == [0.0, 0.0, 2.0]
        stuck = sorted(bench.get("stick_time", "stick_time_2"))
        assert stuck == pytest.approx([release, second], rel=1e-9)


def test_a_surface_torn_away_drags_the_part_and_the_other_surface():
    # The other keeps the part; kinetic friction of the first drags both.
    force = 3.0
    with Bench(**FREE_BODIES, **PAIR, travel=1.0, part_mass=PART, tolerance=1e-13) as bench:
        bench.run_to(0.01, current=-force)
        drag = MU_K * NORMAL
        assert bench.get("sticking", "sticking_2") == [0.0, 1.0]
        assert bench["v_surface"] == pytest.approx((force - drag) / SURFACE * 0.01, rel=1e-8)
        common = drag / (SURFACE + PART)
        assert bench.get("v_surface_2", "v_part") == pytest.approx([common * 0.01] * 2, rel=1e-8)
        assert bench["friction_force_2"] == pytest.approx(-SURFACE * common, rel=1e-8)
        assert bench["friction_force"] == pytest.approx(drag)


@pytest.mark.parametrize("phase", [20.0, 100.0, 233.0])
def test_against_the_reference(phase: float):
    frequency, amplitude, offset, sense = 20.0, 8.0, -1.2, 4.0
    lag = phase / 360.0 / frequency
    run = ["circuit.model=ideal", f"drive.phase_deg={phase}", "run.duration=0.1", "run.settle=0"]
    scene = load("reference", [*TWICE, *run, "run.output_step=1e-4"])
    waves = simulate(scene).columns
    jumps = [n / frequency for n in range(1, 3)] + [n / frequency + lag for n in range(2)]

    def sawtooth(late: float) -> two_surfaces.Current:
        def current(t: float, within: float) -> float:
            cycle = floor((within - late) * frequency)
            return (offset + amplitude * ((t - late) * frequency - cycle - 0.5)) / sense

        return current

    times = [0.012, 0.025, 0.0402, 0.0561, 0.071, 0.0999]
    names = ("force_factor", "suspension_damping", "suspension_k1", "suspension_k3", "travel")
    names += ("contact_damping", "contact_stiffness", "flexure_stiffness", "flexure_damping")
    names += ("surface_mass", "ram_mass", "part_mass", "gravity", "mu_s", "mu_k", "normal_force")
    tables = (scene.coil, scene.mechanics, scene.friction)
    values = {key: value for table in tables for key, value in table.model_dump().items()}
    parameters = {name: float(values[name]) for name in names}
    expected, changes = two_surfaces.simulate(
        parameters, [sawtooth(0.0), sawtooth(lag)], jumps, times
    )
    assert changes >= 10
    rows = np.round(np.array(times) / 1e-4).astype(int)
    places = {"z_surface": 0, "z_ram": 2, "z_surface_2": 4, "z_ram_2": 6, "z_part": 8}
    for name, place in places.items():
        np.testing.assert_allclose(
            waves[name][rows], expected[:, place], rtol=0, atol=3e-9, err_msg=name
        )
    np.testing.assert_allclose(waves["v_part"][rows], expected[:, 9], rtol=0, atol=5e-7)


@pytest.mark.parametrize(
    "key", ["circuit.model=amplifier", "coil.count=2", "mechanics.n_surfaces=1",
            "mechanics.actuator=direct", "friction.mu_plate=0.1"],
)  # fmt: skip
def test_what_two_surfaces_cannot_do_is_refused(key: str):
    with pytest.raises(BadInput, match=key.partition("=")[0].replace(".", r"\.")):
        load("reference", [*TWICE, key])
