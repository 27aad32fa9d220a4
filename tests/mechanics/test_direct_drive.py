"""Direct drive, the ram standing on the ground: against closed forms and the reference solution."""

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.linalg import expm

from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import COMPLIANT, FREE_BODIES, RIGID, Bench
from tests.reference import monolithic

pytestmark = pytest.mark.physics

G = 9.81
SURFACE, PART = 0.0145, 0.009  # kg
MU_K = 0.59
TIGHT = {"tolerance": 1e-13, "ram_fixed": 1}


@pytest.mark.parametrize("sticks", [True, False])
def test_linear_phases(sticks: bool):
    # M z'' = −Bl i − (k_f + k_1) z − (c_f + c_m) z' − load, measured from where it rests
    normal = 5.0 if sticks else 0.3 * PART * G / 0.72
    body = SURFACE + PART if sticks else SURFACE
    drag = 0.0 if sticks else PART * G - MU_K * normal  # what no longer hangs on the surface
    a = np.zeros((5, 5))  # of (z − rest, v, i, di/dt, 1)
    a[0, 1] = a[2, 3] = 1.0
    a[1] = np.array([-600.0, -0.86, -0.6, 0.0, drag]) / body
    with Bench(suspension_k3=0.0, travel=0.1, normal_force=normal, **TIGHT) as bench:
        rest = bench["z_surface"]
        assert rest == pytest.approx(-(SURFACE + PART) * G / 560.0, rel=1e-15)
        state = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
        for n, (current, slope) in enumerate(((0.1, 20.0), (-0.3, -5.0), (0.2, 0.0))):
            state[2:4] = current, slope
            state = expm(a * 0.01) @ state
            bench.run_to(0.01 * (n + 1), current=current, current_slope=slope)
            assert bench["sticking"] == sticks
            assert bench["z_surface"] - rest == pytest.approx(state[0], abs=1e-14)
            assert bench["v_surface"] == pytest.approx(state[1], abs=1e-12)
            assert bench.get("z_ram", "v_ram") == [rest, 0.0]
            assert bench["back_emf"] == pytest.approx(-0.6 * state[1], abs=1e-12)


@pytest.mark.parametrize(
    ("law", "force"),
    [
        ({"suspension": 2, "suspension_knee": 5e-4, "suspension_hardening": 4e5}, 4e5 * 5e-4**2),
        ({"suspension": 2, "suspension_knee": -5e-4, "suspension_hardening": 4e5}, 0.0),
        ({"suspension": 3, "suspension_repulsion": 0.08, "suspension_distance": 3e-3}, 0.08),
    ],
)
def test_starts_in_equilibrium_with_what_the_suspension_pushes(law: dict[str, float], force: float):
    # at q = 0: k_f z = −(m_s + m_p) g − F_m(0), and nothing moves
    with Bench(normal_force=5.0, **law, **TIGHT) as bench:
        rest = -((SURFACE + PART) * G + force) / 560.0
        assert bench.get("z_surface", "z_ram") == pytest.approx([rest, rest], rel=1e-14)
        assert bench["a_surface"] == pytest.approx(0.0, abs=1e-12)
        bench.run_to(0.01)
        assert bench["z_surface"] == pytest.approx(rest, rel=1e-12)


def test_a_rigid_stop_throws_the_surface_back_and_the_part_slips_on():
    # from rest under F the surface (with the part) reaches the stop at v = √(2 F travel/M)
    force, travel, restitution = 0.5, 1e-3, 0.6
    parameters = FREE_BODIES | {"contact": RIGID, "travel": travel, "restitution": restitution}
    closing = np.sqrt(2.0 * force * travel / (SURFACE + PART))
    arrival = np.sqrt(2.0 * travel * (SURFACE + PART) / force)
    with Bench(**parameters, **TIGHT) as bench:
        bench.run_to(arrival * (1.0 + 1e-9), current=-force)
        assert bench["impacts"] == 1
        assert bench["sticking"] == 0
        assert bench["v_surface"] == pytest.approx(-restitution * closing, rel=1e-7)
        assert bench["v_part"] == pytest.approx(closing, rel=1e-7)
        lost = 0.5 * SURFACE * (1.0 - restitution**2) * closing**2
        assert bench["energy_impact"] == pytest.approx(lost, rel=1e-9)
        bench.run_to(1.0, h=0.05)
        assert bench["wall_contact"] == -1  # at rest against the stop, held there by the coil
        assert bench["z_surface"] == pytest.approx(travel, rel=1e-12)
        assert bench.get("v_surface", "a_surface") == [0.0, 0.0]
        assert bench["wall_force"] == pytest.approx(force, rel=1e-6)
        bench.run_to(1.0 + 1e-3, current=force)
        assert bench["wall_contact"] == 0
        assert bench["v_surface"] < 0.0


@pytest.mark.parametrize("contact", ["rigid", "compliant"])
def test_against_the_reference_with_an_endless_ram(contact: str):
    # Without gravity, a ram of 10⁹ kg is ground.
    values = {"part_mass": 0.009, "flexure_stiffness": 936.0, "flexure_damping": 0.475}
    values |= {"surface_mass": 0.00783, "travel": 3e-3, "gravity": 0.0, "contact_stiffness": 1e7}
    coil = {"force_factor": -4.38, "resistance": 4.3, "inductance": 0.83e-3}
    drive = {"frequency": 20.0, "amplitude": 6.0, "offset": -1.0}
    springs = {f"suspension_{key}": 0.0 for key in ("k1", "k3", "damping")}
    times = [0.011, 0.023, 0.037, 0.0521, 0.059]
    expected = monolithic.simulate(
        values | coil | drive | springs | {"ram_mass": 1e9},
        duration=0.06,
        settle=0.0,
        contact=contact,
        circuit="ideal",
        tol=1e-11,
        times=times,
        state={"q": 0.0},
        energies=True,
    )
    tables = {"mechanics": values | springs, "coil": coil, "drive": drive}
    scene = load(
        "reference",
        [f"{table}.{key}={value}" for table, keys in tables.items() for key, value in keys.items()]
        + [f"mechanics.contact={contact}", "mechanics.actuator=direct", "circuit.model=ideal"]
        + ["run.duration=0.06", "run.settle=0", "run.output_step=1e-4"],
    )
    result = simulate(scene)
    assert expected.impacts >= 3 and expected.stick_slip_events >= 2
    assert result.summary["impacts"] == expected.impacts_all
    assert result.summary["stick_fraction"] == pytest.approx(expected.stick_fraction, abs=1e-6)
    rows = np.round(np.array(times) / 1e-4).astype(int)
    for name, scale in (("z_surface", 1e-3), ("v_surface", 1.0), ("z_part", 1e-3), ("v_part", 1.0)):
        found = result.columns[name][rows]
        np.testing.assert_allclose(found, expected.samples[name], rtol=0, atol=2e-7 * scale)
    for name in ("friction", "impact", "damping"):
        assert result.summary[f"energy_{name}"] == pytest.approx(
            expected.energies[name], rel=1e-6, abs=1e-9
        )
    assert result.summary["energy_residual"] < 1e-9  # pyright: ignore[reportOperatorIssue]
    assert not {"z_ram", "v_ram"} & set(result.columns)


@pytest.mark.parametrize("contact", [RIGID, COMPLIANT])
@pytest.mark.parametrize("mu_plate", [0.0, 0.2])
def test_the_energy_account_closes(contact: int, mu_plate: float):
    parameters = {"force_factor": 4.38, "contact": contact, "mu_plate": mu_plate, "travel": 5e-4}
    with Bench(**parameters, **TIGHT, surface_mass=0.008) as bench:
        generator = np.random.default_rng(7)
        for n in range(200):
            current, slope = generator.uniform((-1.0, -100.0), (1.0, 100.0))
            bench.run_to(1e-3 * (n + 1), current=current, current_slope=slope)
        assert bench["impacts"] > 20
        gains = bench["energy_in"]
        names = ("energy_friction", "energy_impact", "energy_damping", "energy_stored")
        assert gains == pytest.approx(sum(bench.get(*names)), rel=1e-9)
        assert bench["q"] == pytest.approx(bench["z_ram"] - bench["z_surface"], abs=1e-12)
        assert bench["q_rate"] == pytest.approx(-bench["v_surface"], abs=1e-10)


@pytest.mark.parametrize("lift", [1e-3, -1e-3])
def test_a_surface_may_begin_within_a_compliant_wall_and_not_beyond_a_rigid_one(lift: float):
    rig = {"initial_lift": lift, "travel": 9e-4, "mu_s": 0.0, "mu_k": 0.0}
    names = ("energy_friction", "energy_impact", "energy_damping", "energy_stored")
    with Bench(**rig, **TIGHT, contact=COMPLIANT) as bench:
        assert bench["wall_contact"] == (-1 if lift > 0 else 1)
        assert bench["q"] == -lift
        bench.run_to(0.05, h=1e-3)
        assert bench["energy_in"] == 0.0
        assert sum(bench.get(*names)) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(FMICallException):
        Bench(**rig, **TIGHT, contact=RIGID)
