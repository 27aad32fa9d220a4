"""The mechanics' FMU against closed forms, an independent solver, and its own energy account.

Nothing here uses the FMU's formulas: each test states its own. "Free bodies" are ram and surface
without springs, dampers and gravity, so that the coil's constant force F gives parabolas.
"""

import math
import random
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import root_scalar

from tests.helpers.examples import examples
from tests.helpers.fmu_bench import COMPLIANT, FREE_BODIES, RIGID, Bench, ends

pytestmark = pytest.mark.physics

G = 9.81
RAM, SURFACE, PART = 0.004, 0.0145, 0.009  # kg
REDUCED = RAM * SURFACE / (RAM + SURFACE)  # of ram and surface
MU_S, MU_K = 0.72, 0.59
TIGHT = {"tolerance": 1e-13}


def near(actual: float, expected: float, relative: float, scale: float | None = None) -> None:
    allowed = relative * (abs(expected) if scale is None else scale)
    assert abs(actual - expected) <= allowed, f"{actual!r} is not {expected!r} ± {allowed:.2g}"


def root(function: Callable[[float], float], low: float, high: float) -> float:
    return root_scalar(function, bracket=(low, high), xtol=1e-15).root


# Rest and free fall


def test_a_held_part_does_not_creep():
    with Bench() as bench:
        height = bench["z_surface"]
        near(height, -(RAM + SURFACE + PART) * G / 560.0, 1e-15)  # static equilibrium
        bench.run_to(10.0, h=0.1)
        assert bench["slip"] == 0.0
        near(bench["z_surface"], height, 1e-12, scale=1.0)  # m
        assert bench["stick_slip_events"] == 0
        near(bench["stick_time"], 10.0, 1e-14)


def test_a_part_beyond_the_limit_of_friction_falls():
    # z = z0 − (g − mu_k F_n/m_p) t²/2
    normal = 0.999 * PART * G / MU_S
    fall = G - MU_K * normal / PART
    with Bench(normal_force=normal) as bench:
        start = bench["z_part"]
        assert bench["sticking"] == 0
        near(bench["a_part"], -fall, 1e-14)
        for time in (1e-3, 0.01, 0.1, 1.0):
            bench.run_to(time)
            near(bench["z_part"] - start, -0.5 * fall * time**2, 1e-12)
            near(bench["v_part"], -fall * time, 1e-12)


def test_the_limit_of_friction_itself_holds_the_part():
    # F_n = m_p g/mu_s with mu_k = mu_s: the weight to the last bit, and no chatter
    for mu, mass in ((0.5, 0.009), (0.59, 0.0034), (0.7, 0.01), (0.3, 0.005)):
        rig = {"mu_s": mu, "mu_k": mu, "part_mass": mass, "normal_force": mass * G / mu}
        with Bench(**rig, **TIGHT) as bench:
            bench.run_to(0.1, h=1e-3)
            near(bench["slip"], 0.0, 1e-12, scale=1.0)
            assert bench["stick_slip_events"] <= 2


def test_release_by_a_falling_normal_force():
    # lets go at mu_s F_n(t) = m_p g; then v = −g t + mu_k ∫F_n dt/m_p; free fall once F_n = 0
    normal, rate = 0.5, 2.0
    release, zero = (normal - PART * G / MU_S) / rate, normal / rate

    def speed(t: float) -> float:
        friction = normal * (t - release) - 0.5 * rate * (t**2 - release**2)
        return -G * (t - release) + MU_K * friction / PART

    with Bench(normal_force=normal, normal_force_slope=-rate, **TIGHT) as bench:
        bench.run_to(release * (1 - 1e-9))
        assert bench["sticking"] == 1
        bench.run_to(release * (1 + 1e-9))
        assert bench["sticking"] == 0
        bench.run_to(0.9 * zero)
        near(bench["v_part"], speed(0.9 * zero), 1e-11)
        bench.run_to(zero)
        near(bench["normal_force"], 0.0, 1e-15, scale=normal)
        near(bench["v_part"], speed(zero), 1e-11)
        bench.run_to(zero + 0.01, normal_force=0.0, normal_force_slope=0.0)
        near(bench["v_part"], speed(zero) - G * 0.01, 1e-11)


# Linear phases against the matrix exponential

RAMPS = ((0.02, 1.5), (-0.01, -3.0), (0.03, 0.0), (0.0, 4.0), (0.04, -5.0))  # A, A/s; 10 ms each


def linear_matrix(body: float, load: float, stiffness: float, damping: float) -> np.ndarray:
    """d/dt of (z_s, v_s, z_r, v_r, i, di/dt, 1): ``body`` moves with the surface under a constant
    ``load``; stiffness and damping are those between ram and surface."""
    a = np.zeros((7, 7))
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    link = np.array([stiffness, damping, -stiffness, -damping, 0.6, 0.0, 0.0])
    a[1] = -link / body
    a[1, :2] -= np.array([560.0, 0.84]) / body
    a[1, 6] += load / body
    a[3] = link / RAM
    a[3, 6] -= G
    return a


@pytest.mark.parametrize("sticks", [True, False])
def test_linear_phases(sticks: bool):
    normal = 5.0 if sticks else 0.3 * PART * G / MU_S
    # a slipping part falls and pulls at the surface with mu_k F_n
    body, load = (
        (SURFACE + PART, -(SURFACE + PART) * G)
        if sticks
        else (SURFACE, -SURFACE * G - MU_K * normal)
    )
    matrix = linear_matrix(body, load, 40.0, 0.02)
    with Bench(suspension_k3=0.0, travel=0.1, normal_force=normal, **TIGHT) as bench:
        start = bench.get("z_surface", "z_ram")
        state = np.array([start[0], 0.0, start[1], 0.0, 0.0, 0.0, 1.0])
        for n, (current, slope) in enumerate(RAMPS):
            state[4:6] = current, slope
            state = expm(matrix * 0.01) @ state
            bench.run_to(0.01 * (n + 1), current=current, current_slope=slope)
            assert bench["sticking"] == sticks
            for name, expected, scale in zip(
                ("z_surface", "v_surface", "z_ram", "v_ram"), state, (1e-3, 0.1) * 2, strict=False
            ):
                near(bench[name], expected, 1e-11, scale)


def test_ram_at_rest_on_a_rigid_wall():
    # one body of ram and surface after the part has fallen off; the current is an inner force
    normal = 0.3 * PART * G / MU_S
    free = {"suspension_k1": 0.0, "suspension_k3": 0.0, "normal_force": normal, "contact": RIGID}
    mass = SURFACE + RAM
    stiffness, damping = 560.0, 0.84
    matrix = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    settled = -(mass * G + MU_K * normal) / stiffness
    with Bench(**free, **TIGHT) as bench:
        assert bench["wall_contact"] == -1
        state = np.array([bench["z_surface"] - settled, 0.0])
        for n, (current, slope) in enumerate(RAMPS):
            state = expm(matrix * 0.01) @ state
            bench.run_to(0.01 * (n + 1), current=current, current_slope=slope)
            assert bench["q"] == -1.9e-3
            near(bench["z_surface"], settled + state[0], 1e-11, 1e-3)
            near(bench["v_surface"], state[1], 1e-11, 0.1)
            # m_r (a + g) = Bl i + F_w
            near(
                bench["wall_force"],
                RAM * (bench["a_surface"] + G) - 0.6 * bench["current"],
                1e-13,
                RAM * G,
            )


def test_ram_leaves_its_wall_as_the_coil_lifts_its_weight():
    # Bl i = m_r g
    free = {"suspension_k1": 0.0, "suspension_k3": 0.0, "contact": RIGID, "current_slope": 0.5}
    release = RAM * G / 0.6 / 0.5
    assert ends(free, release * (1 - 1e-9), ["wall_contact"]) == [-1]
    assert ends(free, release * (1 + 1e-9), ["wall_contact"]) == [0]


# Rigid walls, free bodies


def test_bouncing_comes_to_rest():
    # ball on a wall: speeds v e^n, flights 2 v e^n/a; at rest after t1 + (2 v/a) e/(1 − e)
    force, heavy, travel, e = 0.1, 1e3, 1e-3, 0.6
    a = force * (1 / RAM + 1 / heavy)
    first = math.sqrt(2 * travel / a)
    v = a * first
    rig = {**FREE_BODIES, **TIGHT, "contact": RIGID, "restitution": e, "surface_mass": heavy}
    with Bench(**rig, travel=travel, normal_force=0.0, current=force) as bench:
        landing = first
        for n in range(1, 15):
            flight = 2 * v * e**n / a
            bench.run_to(landing + 0.5 * flight)  # the top of the bounce
            assert bench["impacts"] == n
            near(bench["q"], travel - (v * e**n) ** 2 / (2 * a), 1e-12, travel)
            near(bench["q_rate"], 0.0, 1e-12, v)
            landing += flight
        rest = first + 2 * v / a * e / (1 - e)
        bench.run_to(rest - 1e-6)
        assert bench["wall_contact"] == 0
        bench.run_to(rest + 1e-9)  # bounces below 1e-7 s are left out
        assert bench.get("wall_contact", "q", "q_rate") == [1, travel, 0.0]
        near(bench["wall_force"], -force, 1e-5)
        near(bench["energy_impact"], force * travel, 1e-9)  # all that the coil gave

        # release when the force reverses, then q = travel − s t³/6 (1/m_r + 1/m_s)
        ramp = 5.0
        start = bench.time
        bench.run_to(start + force / ramp - 1e-9, current_slope=-ramp)
        assert bench.get("wall_contact", "q") == [1, travel]
        bench.run_to(start + force / ramp + 5e-3)
        near(bench["q"], travel - ramp * 5e-3**3 / 6 * (1 / RAM + 1 / heavy), 1e-9, travel)


def test_impact_is_between_ram_and_surface_alone():
    # e = u+/u−, m_r v_r + m_s v_s kept, the part's velocity kept: it sticks before and slips after
    force, travel, e = 0.2, 1e-3, 0.4
    rig = {**FREE_BODIES, **TIGHT, "contact": RIGID, "restitution": e, "travel": travel}
    a_surface = -force / (SURFACE + PART)
    a_q = force / RAM - a_surface
    time = math.sqrt(2 * travel / a_q)
    u = a_q * time
    with Bench(**rig, normal_force=1.0, current=force) as bench:
        bench.run_to(time - 1e-12)
        assert bench.get("sticking", "impacts") == [1, 0]
        before = bench.get("v_ram", "v_surface", "v_part")
        near(before[1], a_surface * time, 1e-9)
        bench.run_to(time + 1e-12)
        assert bench.get("sticking", "impacts") == [0, 1]
        ram, surface, part = bench.get("v_ram", "v_surface", "v_part")
        near(part, before[2], 1e-8)
        near(ram - surface, -e * u, 1e-9)
        momentum = RAM * before[0] + SURFACE * before[1]
        near(RAM * ram + SURFACE * surface, momentum, 1e-9, RAM * u)
        near(bench["energy_impact"], 0.5 * REDUCED * (1 - e**2) * u**2, 1e-9)


@pytest.mark.parametrize("normal", [0.0, 1e6])  # without and with the part
def test_a_landing_too_gentle_to_bounce_keeps_momentum(normal: float):
    rig = {**FREE_BODIES, **TIGHT, "contact": RIGID, "restitution": 0.5, "travel": 1e-4}
    with Bench(**rig, normal_force=normal, current=0.1) as bench:
        bench.run_to(0.05)
        assert bench["wall_contact"] == 1
        bench.step(1e-6, current=-1e-3)  # off by 1e-13 m
        assert bench["wall_contact"] == 0
        bench.step(1e-5, current=1e3)  # back at 3e-4 m/s
        assert bench["wall_contact"] == 1
        ram, surface, part = bench.get("v_ram", "v_surface", "v_part")
        near(RAM * ram + SURFACE * surface + PART * part, 0.0, 1e-4, RAM * 3e-4)


def test_a_ram_lifted_for_an_instant_is_at_rest():
    # lifted by less than a bit of q within 1e-10 s
    rig = {**FREE_BODIES, "contact": RIGID, "travel": 1e-4, "normal_force": 0.0}
    with Bench(**rig, current=0.1) as bench:
        bench.run_to(0.05)
        bench.step(1e-3, current=-1e-6, current_slope=1e4)
        assert bench.get("wall_contact", "q") == [1, 1e-4]


@pytest.mark.parametrize("hold", [0.0, 1.0])
def test_a_wall_does_not_pull_where_it_would_press_again_at_the_end_of_a_step(hold: float):
    # q = travel − (J t²/2 − s t³/6) (1/m_r + 1/m_s) after the force has jumped to −J + s t
    jump, ramp, h, heavy = 0.1, 150.0, 1e-3, 1e3
    rig = {**FREE_BODIES, **TIGHT, "contact": RIGID, "travel": 1e-4, "surface_mass": heavy}
    with Bench(**rig, normal_force=0.0, current=0.1) as bench:
        bench.run_to(0.05)
        assert bench["wall_contact"] == 1
        bench.step(h, current=-jump, current_slope=ramp, inputs_hold_for=hold)
        assert bench["wall_contact"] == 0
        gone = (jump * h**2 / 2 - ramp * h**3 / 6) * (1 / RAM + 1 / heavy)
        near(bench["q"], 1e-4 - gone, 1e-10, 1e-4)
        near(bench["q_rate"], (ramp * h**2 / 2 - jump * h) * (1 / RAM + 1 / heavy), 1e-10)


def test_elastic_walls_keep_the_energy():
    rig = {"gravity": 0.0, "flexure_damping": 0.0, "suspension_damping": 0.0, "restitution": 1.0}
    with Bench(**rig, **TIGHT, contact=RIGID, normal_force=0.0, current=0.3) as bench:
        bench.run_to(0.2)
        assert bench["impacts"] > 10
        assert bench["energy_impact"] == 0.0
        near(bench["energy_stored"], bench["energy_in"], 1e-11, 0.3 * 0.6 * 1.9e-3)


@pytest.mark.parametrize("contact", [COMPLIANT, RIGID])
def test_grazing(contact: int):
    # on a spring k the force F moves the ram to (F/k)(1 − cos ωt), at most 2 F/k
    for margin, expected in ((-1e-9, 1), (1e-9, 0)):
        rig = {**FREE_BODIES, **TIGHT, "suspension_k1": 50.0, "contact": contact}
        travel = 2 * 0.02 / 50.0 * (1 + margin)
        period = 2 * math.pi * math.sqrt(REDUCED / 50.0)
        impacts = ends(
            {**rig, "travel": travel, "normal_force": 0.0, "current": 0.02},
            0.9 * period,
            ["impacts"],
        )
        assert impacts == [expected]


# Compliant walls, free bodies


def thrown_at_the_wall(stiffness: float, damping: float) -> tuple[Bench, float, float]:
    """Before contact; with the time at which it begins, and its speed."""
    force, travel, push = 0.4, 1.9e-3, 3e-3
    bench = Bench(
        **FREE_BODIES,
        **TIGHT,
        contact_stiffness=stiffness,
        contact_damping=damping,
        normal_force=0.0,
        current=force,
    )
    bench.run_to(push)
    bench.set(current=0.0)
    speed = force / REDUCED * push
    return bench, push + (travel - 0.5 * speed * push) / speed, speed


@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e11])
def test_hertz_contact(stiffness: float):
    # F = K δ^1.5, no losses: m v²/2 = (2/5) K δ_m^2.5, T = 2 (δ_m/v) ∫dx/√(1 − x^2.5) = 2.943 δ_m/v
    bench, begin, v = thrown_at_the_wall(stiffness, 0.0)
    depth = (5 * REDUCED * v**2 / (4 * stiffness)) ** 0.4
    # x = 1 − s²; 1.471 in the books, e.g. Johnson, Contact Mechanics, section 11.4
    integral = quad(lambda s: 2 * s / math.sqrt(1 - (1 - s * s) ** 2.5), 0, 1, epsabs=1e-13)[0]
    duration = 2 * depth / v * integral
    near(2 * integral, 2.9432, 1e-4)
    with bench:
        bench.run_to(begin - 1e-9 * duration)
        assert bench["wall_contact"] == 0
        bench.run_to(begin + 0.5 * duration)
        near(bench["q"] - 1.9e-3, depth, 1e-9)
        near(bench["wall_force"], -stiffness * depth**1.5, 1e-9)
        bench.run_to(begin + duration * (1 - 1e-7))
        assert bench["wall_contact"] == 1
        bench.run_to(begin + duration * (1 + 1e-7))
        assert bench["wall_contact"] == 0
        near(bench["q_rate"], -v, 1e-9)
        near(bench["energy_impact"], 0.0, 1e-15, REDUCED * v**2)


@pytest.mark.parametrize("damping", [0.1, 0.38, 3.0, 30.0])
def test_hunt_crossley_restitution(damping: float):
    # m v dv/dδ = −K δ^1.5 (1 + λ v): both ways through the same δ, ∫v dv/(1 + λ v) is the same
    bench, begin, v = thrown_at_the_wall(1e8, damping)
    way_in = quad(lambda s: s / (1 + damping * s), 0, v, epsabs=1e-14)[0]

    def mismatch(w: float) -> float:
        return quad(lambda s: s / (1 - damping * s), 0, w, epsabs=1e-14)[0] - way_in

    rebound = root(mismatch, 0, min(v, (1 - 1e-9) / damping))
    with bench:
        bench.run_to(begin + 0.01)
        assert bench.get("wall_contact", "impacts") == [0, 1]
        near(bench["q_rate"], -rebound, 1e-9, v)
        near(bench["energy_impact"], 0.5 * REDUCED * (v**2 - rebound**2), 1e-8)


def test_penetration_at_rest():
    # K δ^1.5 = m_r g, from the start and after settling
    rig = {"suspension_k1": 0.0, "suspension_k3": 0.0, "contact_damping": 100.0}
    depth = (RAM * G / 1e8) ** (2 / 3)
    with Bench(**rig) as bench:
        near(bench["q"], -1.9e-3 - depth, 1e-12)
        bench.run_to(0.001, current=1.0)
        assert bench["wall_contact"] == 0
        bench.run_to(2.0, current=0.0)
        near(-bench["q"] - 1.9e-3, depth, 1e-7)


def test_pulled_off_a_viscous_wall():
    # μ du/dt = −F − K δ^1.5 max(0, 1 + λ u): the wall never pulls, and the ram outruns it
    bench, begin, v = thrown_at_the_wall(1e7, 20.0)
    pull = 10.0
    with bench:
        bench.run_to(begin)
        bench.set(current=-pull)

        def rates(_: float, y: np.ndarray) -> list[float]:
            wall = 1e7 * max(y[0], 0.0) ** 1.5 * max(0.0, 1 + 20.0 * y[1])
            return [y[1], -(pull + wall) / REDUCED]

        checks = np.linspace(1e-5, 2.5e-4, 25)
        solved = solve_ivp(
            rates, (0, checks[-1]), [0.0, v], "DOP853", checks, rtol=1e-12, atol=1e-16,
            max_step=1e-7,
        )  # fmt: skip
        outran = 0
        for t, depth, u in zip(checks, *solved.y, strict=True):
            bench.run_to(begin + t)
            near(bench["q"] - 1.9e-3, depth, 1e-7, 1e-5)
            near(bench["q_rate"], u, 1e-7, v)
            assert bench["wall_force"] <= 0.0
            outran += depth > 0 and u < -1 / 20.0
            account = bench["energy_in"] - bench["energy_impact"] - bench["energy_stored"]
            near(account, 0.0, 1e-10, REDUCED * v**2)
        assert outran > 5


# Stick and slip, free bodies


def test_break_away_slip_and_stick_again():
    # ram pushed with F = s t: m_p a = mu_s F_n at t1; after t2 no force, slip ends by friction
    s, normal = 10.0, 0.05
    friction = MU_K * normal
    t1 = MU_S * normal * (SURFACE + PART) / (PART * s)
    t2 = 1.6 * t1
    rig = {**FREE_BODIES, **TIGHT, "travel": 1.0, "normal_force": normal}
    with Bench(**rig, current_slope=s) as bench:
        bench.run_to(t1 * (1 - 1e-8))
        assert bench["sticking"] == 1
        near(bench["friction_force"], -MU_S * normal, 3e-8)
        bench.run_to(t1 * (1 + 1e-8))
        assert bench["sticking"] == 0
        near(bench["a_part"], -friction / PART, 1e-14)
        bench.run_to(t2)
        slip_rate = (0.5 * s * (t2**2 - t1**2) - friction * (t2 - t1)) / SURFACE - friction * (
            t2 - t1
        ) / PART
        near(bench["v_part"] - bench["v_surface"], slip_rate, 1e-8)
        lasts = slip_rate / (friction * (1 / PART + 1 / SURFACE))
        bench.set(current=0.0, current_slope=0.0)
        bench.run_to(t2 + lasts * (1 - 1e-7))
        assert bench["sticking"] == 0
        bench.run_to(t2 + lasts * (1 + 1e-7))
        assert bench["sticking"] == 1
        together = -0.5 * s * t2**2 / (SURFACE + PART)  # momentum
        near(bench["v_part"], together, 1e-8)
        near(bench["v_surface"], together, 1e-8)
        slipped = bench["slip"]
        bench.run_to(1.0)
        assert bench["slip"] == slipped
        near(bench["energy_friction"], friction * slipped, 1e-11)


def test_part_slides_on_surface_and_plate():
    # a = −g + (mu_k + mu_plate) F_n/m_p
    normal = 0.05
    with Bench(mu_plate=0.4, normal_force=normal) as bench:
        start = bench["z_part"]
        a = -G + (MU_K + 0.4) * normal / PART
        bench.run_to(0.1)
        near(bench["v_part"], a * 0.1, 1e-11)
        near(bench["z_part"] - start, 0.5 * a * 0.1**2, 1e-11)
        near(bench["plate_force"], 0.4 * normal, 1e-15)


def test_plate_holds_the_part():
    # the surface is held through the part until s t = mu_s F_n, then m_s a = −s t + mu_k F_n
    s, normal = 10.0, 0.05
    t1 = MU_S * normal / s
    rig = {**FREE_BODIES, **TIGHT, "travel": 1.0, "normal_force": normal, "mu_plate": 1.0}
    with Bench(**rig, current_slope=s) as bench:
        bench.run_to(t1 * (1 - 1e-12))
        assert bench.get("sticking", "v_surface", "z_surface") == [1, 0.0, 0.0]
        near(bench["plate_force"], MU_S * normal, 1e-11)
        end = 3 * t1
        bench.run_to(end)
        assert bench.get("sticking", "v_part", "z_part") == [0, 0.0, 0.0]
        speed = (-0.5 * s * (end**2 - t1**2) + MU_K * normal * (end - t1)) / SURFACE
        near(bench["v_surface"], speed, 1e-9)
        near(bench["plate_force"], MU_K * normal, 1e-15)


def test_two_surfaces_are_one_with_half_the_part():
    names = ("z_surface", "v_surface", "z_ram", "z_part", "v_part", "energy_friction", "energy_in")
    rig = {"normal_force": 0.2, "current": -0.8, "current_slope": 15.0, "mu_plate": 0.1}
    one = ends({**rig, "part_mass": 0.5 * PART}, 0.1, names)
    assert ends({**rig, "part_mass": PART, "n_surfaces": 2}, 0.1, names) == one
    assert one[5] > 0.0


def test_a_force_that_reverses_at_once():
    # frictionless: no mode is consistent for longer than 1e-54 s, and none must be tried for ever
    rig = {**FREE_BODIES, "mu_s": 0.0, "mu_k": 0.0, "mu_plate": 0.5, "normal_force": 0.0}
    with Bench(**rig) as bench:
        bench.step(1e-3, current=-1e-52, current_slope=100.0)
        near(bench["v_surface"], -0.5 * 100.0 * 1e-3**2 / SURFACE, 1e-9)
        assert bench["v_part"] == 0.0


# Impact and friction together, free bodies


def after_impact(
    v_surface: float, u: float, v_part: float, force: float, normal: float, e: float
) -> Callable[[float], tuple[float, float]]:
    """Velocities of surface and part from an impact at closing speed u on, where the surface has
    been kicked upwards past the part: friction drags the part up."""
    kicked = v_surface + (1 + e) * RAM / (RAM + SURFACE) * u
    assert kicked > v_part
    drag = MU_K * normal
    return lambda t: (kicked - (force + drag) / SURFACE * t, v_part + drag / PART * t)


def test_impact_reverses_the_slip():
    force, normal, travel, e = 1.0, 0.05, 1e-3, 0.5
    a_surface = (-force + MU_K * normal) / SURFACE
    a_q = force / RAM - a_surface
    time = math.sqrt(2 * travel / a_q)
    v_part = -MU_K * normal / PART * time
    after = after_impact(a_surface * time, a_q * time, v_part, force, normal, e)
    rig = {**FREE_BODIES, **TIGHT, "travel": travel, "restitution": e, "contact": RIGID}
    with Bench(**rig, normal_force=normal, current=force) as bench:
        assert bench["sticking"] == 0
        bench.run_to(time - 1e-12)
        assert bench["friction_force"] == -MU_K * normal
        bench.run_to(time + 1e-4)
        assert bench["friction_force"] == MU_K * normal
        surface, part = after(1e-4)
        near(bench["v_surface"], surface, 1e-9)
        near(bench["v_part"], part, 1e-9)


@pytest.mark.parametrize("early", [-1e-12, 0.0, 1e-12])
def test_impact_at_the_moment_of_break_away(early: float):
    # F = s t: q = s t³/6 (1/m_r + 1/(m_s + m_p)) is the travel just when m_p a = mu_s F_n
    s, normal, e = 10.0, 0.05, 0.5
    time = MU_S * normal * (SURFACE + PART) / (PART * s)
    mobility = 1 / RAM + 1 / (SURFACE + PART)
    v = -0.5 * s * time**2 / (SURFACE + PART)
    after = after_impact(v, 0.5 * s * time**2 * mobility, v, s * time, normal, e)
    travel = s * time**3 / 6 * mobility * (1 + early)
    rig = {**FREE_BODIES, **TIGHT, "travel": travel, "restitution": e, "contact": RIGID}
    with Bench(**rig, normal_force=normal, current_slope=s) as bench:
        bench.run_to(time - 1e-9)
        assert bench.get("sticking", "impacts") == [1, 0]
        bench.run_to(time)
        bench.run_to(time + 1e-4, current_slope=0.0)
        assert bench.get("sticking", "impacts") == [0, 1]
        surface, part = after(1e-4)
        near(bench["v_surface"], surface, 1e-9)
        near(bench["v_part"], part, 1e-9)


# An independent solver

FULL = {
    "b1": 40.0,
    "b2": -3e4,
    "suspension_k2": 2e3,
    "contact_stiffness": 2e7,
    "normal_force": 0.25,
}


def solved_independently(current: Callable[[float], float], end: float) -> np.ndarray:
    """(z_s, v_s, z_r, v_r, z_p, v_p) with FULL by DOP853 from event to event. Absolute heights; a
    part that sticks has the surface's acceleration."""
    travel, grip = 1.9e-3, FULL["normal_force"]

    def forces(t: float, y: np.ndarray, side: int) -> tuple[float, float]:
        q, u = y[2] - y[0], y[3] - y[1]
        push = 0.6 * (1 + 40.0 * q - 3e4 * q**2) * current(t)
        push -= 40.0 * q + 2e3 * q**2 + 1.5e7 * q**3 + 0.02 * u
        deep = max(0.0, side * q - travel)
        push -= side * 2e7 * deep**1.5 * max(0.0, 1 + 0.38 * side * u)
        return push, -push - 560.0 * y[0] - 0.84 * y[1]

    def stick_force(t: float, y: np.ndarray, side: int) -> float:
        return PART * forces(t, y, side)[1] / (SURFACE + PART)  # m_p (a + g)

    def broken(needed: float) -> int:
        """Sign of the slip rate where sticking would need this force; 0 if it sticks."""
        return 0 if abs(needed) <= MU_S * grip else -1 if needed > 0 else 1

    def rates(t: float, y: np.ndarray, side: int, slip: int) -> list[float]:
        on_ram, on_surface = forces(t, y, side)
        friction = -slip * MU_K * grip if slip else stick_force(t, y, side)
        a_surface = (on_surface - friction) / SURFACE - G
        return [y[1], a_surface, y[3], on_ram / RAM - G, y[5], friction / PART - G]

    events: tuple[Any, ...] = (
        lambda t, y, side, slip: (y[2] - y[0] - travel) if side >= 0 else 1.0,
        lambda t, y, side, slip: (y[2] - y[0] + travel) if side <= 0 else 1.0,
        lambda t, y, side, slip: (
            (y[5] - y[1]) * slip if slip else MU_S * grip - abs(stick_force(t, y, side))
        ),
    )
    for event in events:
        event.terminal = True
    equilibrium = root(lambda q: 40 * q + 2e3 * q**2 + 1.5e7 * q**3 + RAM * G, -1e-2, 0)
    z = -(RAM + SURFACE + PART) * G / 560.0
    y, t, side = np.array([z, 0, z + equilibrium, 0, z, 0.0]), 0.0, 0
    slip = broken(stick_force(t, y, side))
    while t < end:
        run = solve_ivp(
            rates, (t, end), y, "DOP853", events=events, rtol=1e-12, atol=1e-15, max_step=1e-4,
            args=(side, slip),
        )  # fmt: skip
        t, y = float(run.t[-1]), run.y[:, -1].copy()
        if run.status != 1:
            break
        kind = next(i for i, times in enumerate(run.t_events) if len(times))
        if kind == 2:
            if slip:
                y[5] = y[1]
                slip = broken(stick_force(t, y, side))
            else:
                slip = -1 if stick_force(t, y, side) > 0 else 1
        else:
            side = 0 if side else (1, -1)[kind]
        # a hair further, or the event would be found again
        y = y + 1e-12 * np.array(rates(t, y, side, slip))
        t += 1e-12
    return y


def test_against_an_independent_solver():
    # compliant impacts at both walls, cubic suspension, Bl(q), stick and slip
    start, slope, end = -1.5, 120.0, 0.025
    expected = solved_independently(lambda t: start + slope * t, end)
    names = ("z_surface", "v_surface", "z_ram", "v_ram", "z_part", "v_part")
    with Bench(**FULL, **TIGHT, current=start, current_slope=slope) as bench:
        bench.run_to(end)
        assert bench["impacts"] >= 3
        assert bench["stick_slip_events"] >= 3
        for name, value, scale in zip(names, expected, (1e-3, 0.1) * 3, strict=True):
            near(bench[name], value, 1e-9, scale)


# The importer's steps do not matter


def zigzag(bench: Bench, end: float, amplitude: float, cuts: Sequence[float]) -> list[float]:
    """Triangular current with knots every 20 ms, in steps that end at the cuts."""
    knots = [0.02 * k for k in range(round(end / 0.02) + 1)]
    values = [amplitude * (-1) ** k for k in range(len(knots))]
    for a, b in pairwise(sorted({*knots, *cuts})):
        k = min(int(a / 0.02 + 1e-9), len(knots) - 2)
        slope = (values[k + 1] - values[k]) / 0.02
        bench.step(b - a, current=values[k] + slope * (a - knots[k]), current_slope=slope)
    return bench.get("z_surface", "v_surface", "z_ram", "v_ram", "z_part", "v_part")


@pytest.mark.parametrize(("contact", "amplitude"), [(COMPLIANT, 0.3), (RIGID, 0.5)])
def test_any_steps_give_the_same(contact: int, amplitude: float):
    chance = random.Random(7)
    cuts = [np.linspace(0, 0.2, round(0.2 / h) + 1)[1:-1].round(12) for h in (1e-3, 1e-4, 1e-5)]
    cuts.append(np.sort([chance.uniform(0, 0.2) for _ in range(500)]))
    results = []
    for choice in [[], *cuts]:
        with Bench(contact=contact, normal_force=0.25, tolerance=1e-12) as bench:
            state = zigzag(bench, 0.2, amplitude, list(choice))
            results.append([*state, *bench.get("stick_slip_events", "impacts")])
    assert results[0][-2] > 5
    scales = (1e-3, 0.1) * 3 + (1.0, 1.0)
    for other in results[1:]:
        for value, expected, scale in zip(other, results[0], scales, strict=True):
            near(value, expected, 1e-9, max(scale, abs(expected)))


# The energy account, anywhere

ZERO = st.just(0.0)


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Log-uniform."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


RIGS = st.fixed_dictionaries(
    {
        "contact": st.sampled_from([COMPLIANT, RIGID]),
        "n_surfaces": st.integers(1, 2),
        "ram_mass": spread(1e-3, 0.02),
        "surface_mass": spread(3e-3, 0.1),
        "part_mass": spread(1e-4, 0.05),
        "flexure_stiffness": spread(50.0, 5e3),
        "flexure_damping": ZERO | spread(0.01, 5.0),
        "suspension_k1": ZERO | spread(1.0, 300.0),
        "suspension_k3": ZERO | spread(1e5, 1e8),
        "suspension_damping": ZERO | spread(1e-3, 1.0),
        "travel": spread(3e-4, 3e-3),
        "restitution": st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0]),
        "contact_stiffness": spread(1e6, 1e9),
        "contact_damping": ZERO | spread(0.01, 10.0),
        "gravity": st.sampled_from([0.0, G]),
        "b1": ZERO | st.floats(-100.0, 100.0),
        "b2": ZERO | st.floats(-1e5, 0.0),
        "mu_s": ZERO | st.floats(0.01, 1.0),
        "mu_k": st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0]),  # times mu_s
        "mu_plate": ZERO | ZERO | st.floats(0.01, 1.0),
        "normal_force": ZERO | spread(1e-3, 5.0),
        "at_the_limit": st.booleans(),  # mu_s F_n is the part's weight
    }
)
AMPERES = st.sampled_from([0.05, 0.5, 5.0])
PIECES = st.lists(
    st.tuples(spread(1e-4, 1e-2), st.floats(-1, 1), st.floats(-1, 1)), min_size=5, max_size=25
)  # duration, current at the start and at the end


def check_energy(
    rig: dict[str, float], amperes: float, pieces: list[tuple[float, float, float]]
) -> None:
    rig = {**rig, "mu_k": rig["mu_k"] * rig["mu_s"], "tolerance": 1e-12}
    if rig.pop("at_the_limit") and rig["mu_s"]:
        rig["normal_force"] = rig["part_mass"] / rig["n_surfaces"] * G / rig["mu_s"]
    losses = ("energy_friction", "energy_impact", "energy_damping")
    before, passed = 0.0, 1e-5  # J; what moves at 0.1 m/s, the scale of the tolerance, has more
    with Bench(**rig) as bench:
        for h, start, end in pieces:
            slope = amperes * (end - start) / h
            bench.step(h, current=amperes * start, current_slope=slope)
            given_in, stored, *lost = bench.get("energy_in", "energy_stored", *losses)
            passed += abs(given_in - before)
            before = given_in
            assert min(lost) >= -1e-13 * passed
            near(given_in - sum(lost) - stored, 0.0, 1e-8, passed + sum(lost) + abs(stored))
            if rig["contact"] == RIGID:
                assert abs(bench["q"]) <= rig["travel"] * (1 + 4e-15)
            force, normal, sticking = bench.get("friction_force", "normal_force", "sticking")
            limit = rig["mu_s" if sticking else "mu_k"] * normal
            assert abs(force) <= limit * (1 + 1e-9) + 1e-12
            slip_rate = bench["v_part"] - bench["v_surface"]
            assert sticking or force * slip_rate <= 1e-14 * limit


AT_THE_LIMIT = {
    "contact": COMPLIANT, "n_surfaces": 1, "ram_mass": 0.012, "surface_mass": 0.0245,
    "part_mass": 0.0034, "flexure_stiffness": 115.3, "flexure_damping": 0.0255,
    "suspension_k1": 0.0, "suspension_k3": 0.0, "suspension_damping": 0.0256, "travel": 1.3e-3,
    "restitution": 1.0, "contact_stiffness": 3e6, "contact_damping": 5.0, "gravity": G, "b1": 0.0,
    "b2": -7e4, "mu_s": 0.59, "mu_k": 1.0, "mu_plate": 0.0, "normal_force": 0.0,
    "at_the_limit": True,
}  # fmt: skip


@examples(300)
@example(rig=AT_THE_LIMIT, amperes=0.05, pieces=[(1e-3, 0.0, 0.3)])
@given(rig=RIGS, amperes=AMPERES, pieces=PIECES)
def test_energy_account(rig, amperes, pieces):
    check_energy(rig, amperes, pieces)


def test_a_lifted_surface_swings_about_its_equilibrium() -> None:
    """Let go, with the part sticking to it, and a ram that is ground."""
    parameters = {"suspension_k1": 0.0, "suspension_k3": 0.0, "suspension_damping": 0.0}
    parameters |= {"flexure_damping": 0.0, "travel": 0.1, "ram_fixed": 1, "tolerance": 1e-13}
    lift, body = 2e-4, 0.0145 + 0.009
    with Bench(initial_lift=lift, normal_force=5.0, **parameters) as bench:
        rest = -body * 9.81 / 560.0
        assert bench["z_surface"] == pytest.approx(rest + lift, rel=1e-14)
        for time in (0.01, 0.037):
            bench.run_to(time)
            swung = lift * np.cos(np.sqrt(560.0 / body) * time)
            assert bench["z_surface"] - rest == pytest.approx(swung, abs=1e-12)
            assert bench["z_part"] == pytest.approx(bench["z_surface"], abs=1e-14)


@pytest.mark.parametrize(("share", "stays"), [(0.99, True), (-0.99, True), (1.01, False)])
def test_the_spring_loaded_plate_holds_a_lifted_surface(share: float, stays: bool) -> None:
    """As long as the flexure pulls with no more than the plate's friction."""
    held = 0.18 * 1.0 / 560.0
    with Bench(initial_lift=share * held, mu_plate=0.18, normal_force=1.0) as bench:
        before = bench["z_surface"]
        bench.run_to(0.05)
        assert (bench["z_surface"] == pytest.approx(before, abs=1e-9)) == stays
