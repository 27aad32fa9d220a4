"""The monolithic reference solution against closed forms, balances and symmetries."""

from __future__ import annotations

import json
import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

pytest.importorskip("sksundae")

from tests.reference.monolithic import Params, simulate

GOLDEN = Path(__file__).parents[1] / "reference" / "golden.json"
G = Params.gravity
SILENT: dict[str, Any] = {"amplitude": 0.0, "offset": 0.0}
UNSPRUNG: dict[str, Any] = {"suspension_k1": 0.0, "suspension_k3": 0.0, "suspension_damping": 0.0}
ANVIL: dict[str, Any] = {"surface_mass": 1e6, "flexure_stiffness": 1e12, "flexure_damping": 0.0}
LOCKED: dict[str, Any] = {"ram_mass": 1e9, "surface_mass": 1e9, "gravity": 0.0, "amplitude": 0.0}


@pytest.mark.parametrize("restitution", [0.5, 0.75])
def test_bouncing_ram_comes_to_rest_at_the_zeno_time(restitution: float) -> None:
    height, travel = 3e-3, 2e-3
    first = math.sqrt(2.0 * height / G)
    apex = first * (1.0 + restitution)
    rest = first * (1.0 + restitution) / (1.0 - restitution)
    r = simulate(
        SILENT | UNSPRUNG | ANVIL | {"restitution": restitution, "travel": travel},
        1.2 * rest,
        0.0,
        contact="rigid",
        circuit="ideal",
        times=[0.5 * first, apex, 1.01 * rest, 1.1 * rest],
        energies=True,
        state={"q": height - travel},
    )
    q = r.samples["z_ram"] - r.samples["z_surface"]
    expected = [0.75 * height, restitution**2 * height, 0.0, 0.0]
    assert q + travel == pytest.approx(expected, abs=1e-9)
    assert r.samples["v_ram"][2:] == pytest.approx([0.0, 0.0], abs=1e-7)
    assert r.energies["impact"] == pytest.approx(Params.ram_mass * G * height, rel=1e-5)
    # Closings faster than 1 mm/s: the speeds fall geometrically.
    speed = math.sqrt(2.0 * G * height)
    assert r.impacts == 1 + math.floor(math.log(1e-3 / speed) / math.log(restitution))


@pytest.mark.parametrize("mu_plate", [0.0, 0.1])
@pytest.mark.parametrize("v_start", [0.3, -0.3])
def test_sliding_part_is_braked_and_sticks(v_start: float, mu_plate: float) -> None:
    p = Params(**SILENT, **ANVIL, mu_plate=mu_plate)
    brake = (p.mu_k + mu_plate) * p.normal_force / p.part_mass
    deceleration = brake + math.copysign(G, v_start)
    stop = abs(v_start) / deceleration
    r = simulate(
        p, 2.0 * stop, 0.0, circuit="ideal", times=[0.5 * stop, stop], state={"u": -v_start}
    )
    way = math.copysign(v_start**2 / (2.0 * deceleration), v_start)
    start = -(p.part_mass + p.ram_mass + p.surface_mass) * G / p.flexure_stiffness
    assert r.samples["v_part"] == pytest.approx([0.5 * v_start, 0.0], abs=1e-7)
    assert r.samples["z_part"] == pytest.approx([start + 0.75 * way, start + way], abs=1e-9)
    assert r.v_average == pytest.approx(way / (2.0 * stop), rel=1e-6)
    assert (r.sticks, r.slips) == (1, 0)
    assert r.stick_fraction == pytest.approx(0.5, abs=1e-6)


def test_part_falls_freely_without_friction() -> None:
    p = Params(**SILENT, **ANVIL, mu_s=0.0, mu_k=0.0)
    r = simulate(p, 0.1, 0.0, circuit="ideal")
    assert r.v_average == pytest.approx(-0.5 * G * 0.1, rel=1e-7)
    assert r.stick_fraction == 0.0


def test_held_part_never_creeps() -> None:
    r = simulate({"mu_plate": 5.0}, 0.2, 0.0, circuit="ideal", energies=True)
    assert abs(r.v_average) < 1e-12
    assert r.impacts > 0 and r.stick_fraction < 1.0


def test_saturated_coil_follows_the_rl_step_response() -> None:
    p = Params(**LOCKED, offset=6.0)
    resistance = p.resistance + p.sense_resistance
    tau, limit = p.inductance / resistance, p.supply - p.swing_loss_high
    slewed = limit / p.slew_rate
    times = np.array([1e-6, 5e-6, 1e-4, 3e-4, 1e-3])
    ramp = np.minimum(times, slewed)
    current = p.slew_rate / resistance * (ramp - tau * (1.0 - np.exp(-ramp / tau)))
    final = limit / resistance
    current = final + (current - final) * np.exp(-(times - ramp) / tau)
    current[0] = p.slew_rate / resistance * (1e-6 - tau * (1.0 - math.exp(-1e-6 / tau)))
    r = simulate(p, 2e-3, 0.0, times=times.tolist(), tol=1e-10)
    assert r.samples["current"] == pytest.approx(current, rel=1e-7, abs=1e-10)
    assert r.saturated_fraction == pytest.approx(1.0 - slewed / 2e-3, rel=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_regulating_amplifier_rings_as_its_two_poles_tell(count: int) -> None:
    p = Params(**LOCKED, offset=0.1, count=count)
    pole, sense = 2.0 * math.pi * p.gain_bandwidth, p.sense_resistance * count
    gain = 10.0 ** (p.open_loop_gain / 20.0)
    # States: pole, current, and the constant command.
    a = np.array(
        [
            [-pole / gain, -pole * sense, pole * p.offset],
            [1.0 / p.inductance, -(p.resistance + sense) / p.inductance, 0.0],
            [0.0, 0.0, 0.0],
        ]
    )
    times = np.array([1e-5, 4e-5, 1e-4, 4e-4, 2e-3])
    expected = [(expm(a * t) @ [0.0, 0.0, 1.0])[1] for t in times]
    r = simulate(p, 3e-3, 0.0, times=times.tolist(), tol=1e-11)
    assert r.samples["current"] == pytest.approx(expected, abs=1e-8)


def test_linear_mechanics_follow_the_matrix_exponential() -> None:
    p = Params(**SILENT, suspension_k3=0.0, travel=1.0, mu_s=1e3)
    carried = p.surface_mass + p.part_mass
    m = np.diag([p.ram_mass, carried])
    k1, kf, c1, cf = p.suspension_k1, p.flexure_stiffness, p.suspension_damping, p.flexure_damping
    k = np.array([[k1, -k1], [-k1, k1 + kf]])
    c = np.array([[c1, -c1], [-c1, c1 + cf]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    rest = -np.linalg.solve(k, np.diag(m) * G)
    start = np.array([2e-3, -1e-3, 0.05, -0.1])  # ram, surface, and their rates
    times = np.array([1e-3, 1e-2, 5e-2, 0.2])
    state = {"q": start[0] - start[1], "dq": start[2] - start[3], "zs": start[1], "vs": start[3]}
    r = simulate(p, 0.21, 0.0, circuit="ideal", times=times.tolist(), state=state)
    for n, t in enumerate(times):
        ram, surface, *_ = expm(a * t) @ (start - [*rest, 0.0, 0.0])
        assert r.samples["z_ram"][n] == pytest.approx(ram + rest[0], abs=1e-10)
        assert r.samples["z_surface"][n] == pytest.approx(surface + rest[1], abs=1e-10)
    assert r.stick_fraction == 1.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("contact", ["rigid", "compliant"])
def test_impact_keeps_momentum_and_its_law(contact: str, side: int) -> None:
    v = 0.2
    p = Params(
        **SILENT,
        **UNSPRUNG,
        gravity=0.0,
        flexure_stiffness=1e-9,
        flexure_damping=0.0,
        normal_force=0.0,
        contact_damping=0.0,
    )
    r = simulate(
        p,
        0.012,
        0.0,
        contact=contact,
        circuit="ideal",
        times=[0.011],
        state={"q": 0.0, "dq": side * v},
    )
    restitution = p.restitution if contact == "rigid" else 1.0
    share = p.ram_mass / (p.ram_mass + p.surface_mass)
    v_surface, v_ram = r.samples["v_surface"][0], r.samples["v_ram"][0]
    assert v_surface == pytest.approx(side * v * (1.0 + restitution) * share, rel=1e-6)
    assert v_surface - v_ram == pytest.approx(side * restitution * v, rel=1e-6)
    assert r.samples["v_part"][0] == pytest.approx(0.0, abs=1e-9)
    assert r.impacts == 1


@pytest.mark.parametrize(
    ("contact", "circuit", "mu_plate", "law"),
    [
        *product(("rigid", "compliant"), ("amplifier", "limited", "ideal"), (0.0, 0.1), ["cubic"]),
        *product(("rigid", "compliant"), ["limited"], [0.0], ("knee", "repulsion")),
    ],
)
def test_energy_is_accounted_for(contact: str, circuit: str, mu_plate: float, law: str) -> None:
    p = Params(mu_plate=mu_plate, suspension=law, suspension_k2=1e4, b1=50.0)
    r = simulate(p, 0.11, 0.0, contact=contact, circuit=circuit, energies=True)
    losses = sum(r.energies[k] for k in ("friction", "damping", "impact"))
    assert min(r.energies[k] for k in ("copper", "friction", "damping", "impact")) > 0.0
    assert abs(r.energies["residual"]) < 1e-5 * losses


@pytest.mark.parametrize("contact", ["rigid", "compliant"])
def test_without_gravity_up_and_down_are_alike(contact: str) -> None:
    up = simulate({"gravity": 0.0}, 0.2, 0.1, contact=contact, circuit="ideal")
    mirrored = {"gravity": 0.0, "amplitude": -Params.amplitude, "offset": -Params.offset}
    down = simulate(mirrored, 0.2, 0.1, contact=contact, circuit="ideal")
    assert up.v_average > 1e-3
    assert down.v_average == pytest.approx(-up.v_average, rel=1e-5)


def test_current_limit_is_refused() -> None:
    with pytest.raises(RuntimeError, match="current limit"):
        simulate({"offset": 15.0}, 0.01, 0.0, circuit="ideal")


def test_reference_scene_as_an_independent_model_has_it() -> None:
    known = {"reference": 13.043e-3, "reference-ideal": 12.042e-3}
    found = {c["name"]: c["result"]["v_average"] for c in _golden()}
    assert {k: found[k] for k in known} == pytest.approx(known, rel=1e-3)


@pytest.mark.parametrize("name", ["reference-rigid-ideal", "plate-rigid", "loose"])
def test_golden_results_are_those_of_this_model(name: str) -> None:
    (case,) = (c for c in _golden() if c["name"] == name)
    r = simulate(
        case["params"],
        case["duration"],
        case["settle"],
        contact=case["contact"],
        circuit=case["circuit"],
    )
    assert r.v_average == pytest.approx(case["result"]["v_average"], rel=1e-4)
    assert r.impacts == case["result"]["impacts"]


def _golden() -> list[dict[str, Any]]:
    return json.loads(GOLDEN.read_text(encoding="utf-8"))["cases"]
