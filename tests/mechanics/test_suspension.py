"""The laws of the suspension: where the ram rests, and the account of its energy."""

from contextlib import closing
from ctypes import c_double, c_int
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.optimize import root_scalar

import cosim
from cosim.errors import BadInput
from cosim.mechanics.fmi import Interface
from cosim.mechanics.stickslip import (
    SUSPENSIONS,
    numbers_of,
    parameters,
    rests_of,
    suspension_force,
)
from cosim.scene import load
from cosim.scene.tables import Mechanics
from tests.helpers.fmu_bench import Bench

pytestmark = [pytest.mark.physics, pytest.mark.filterwarnings("ignore::cosim.errors.BeyondModel")]

G, RAM = 9.81, 0.004
KNEE = {"suspension": "knee", "suspension_k1": 120.0, "suspension_hardening": 4e5}
MAGNETS = {"suspension": "repulsion", "suspension_distance": 2.4e-3}
RIGS: dict[str, tuple[dict[str, Any], int]] = {
    "shipped": ({"suspension_k1": 250.168, "suspension_k2": -399054.0, "suspension_k3": 71468100.0,
                 "travel": 3.0112e-3, "contact_stiffness": 5.99152e6}, 2),
    "a wall below": ({"suspension_k1": 400.0, "suspension_k2": 3e5, "suspension_k3": 1e7}, 2),
    "shallow": ({"suspension_k1": 80.0, "suspension_k2": 4e4, "suspension_k3": 0.0}, 2),
    "soft": ({"suspension_k1": 1.0, "suspension_k3": 0.0}, 1),
    "no gravity": ({"gravity": 0.0}, 1),
    "knee": (KNEE, 1),
    "knee above": (KNEE | {"suspension_knee": 4e-4, "suspension_hardening": 2e6}, 1),
    "knee pushes": (KNEE | {"suspension_k1": 0.0, "suspension_knee": 3e-3}, 1),
    "repulsion": (MAGNETS, 1),
    "repulsion pushes": (MAGNETS | {"suspension_repulsion": 0.5}, 1),
    "repulsion yields": (MAGNETS | {"suspension_repulsion": 1e-4}, 1),
}  # fmt: skip
"""Keys of mechanics, and how many rests there are."""


def force(p: Mechanics, q: float) -> float:
    """On the ram at rest, N: walls, weight and the law as its documentation has it."""
    law = {
        "cubic": lambda x: -(p.suspension_k1 * x + p.suspension_k2 * x**2 + p.suspension_k3 * x**3),
        "knee": lambda x: (
            p.suspension_hardening * max(p.suspension_knee - x, 0.0) ** 2 - p.suspension_k1 * x
        ),
        "repulsion": lambda x: p.suspension_repulsion / (1.0 + x / p.suspension_distance) ** 3,
    }[p.suspension]
    there = law(q)
    if p.suspension == "repulsion" and q < -p.travel:
        h = 1e-8  # the line through two points at the wall
        slope = (law(-p.travel + h) - law(-p.travel - h)) / (2.0 * h)
        there = law(-p.travel) + slope * (q + p.travel)
    wall = p.contact_stiffness * max(abs(q) - p.travel, 0.0) ** 1.5
    return there - np.sign(q) * wall - RAM * p.gravity


def root(p: Mechanics, low: float, high: float) -> float:
    return root_scalar(lambda q: force(p, q), bracket=(low, high), xtol=1e-15).root


@pytest.mark.parametrize("name", RIGS)
def test_all_rests_are_found_and_a_run_starts_at_the_one_nearest_the_centre(name: str) -> None:
    """Against a fine search for where the force falls through 0; and a ram let go there stays."""
    given, count = RIGS[name]
    scene = load("reference", {f"mechanics.{k}": v for k, v in given.items()})
    p = scene.mechanics
    places = np.linspace(-1.3, 1.3, 26_000) * p.travel
    balance = np.array([force(p, q) for q in places])
    falls = np.flatnonzero((balance[:-1] > 0.0) & (balance[1:] <= 0.0))
    true = [root(p, *places[k : k + 2]) for k in falls]
    known = numbers_of(scene)
    assert len(true) == count
    assert rests_of(known) == pytest.approx(true, rel=1e-6, abs=1e-12)
    start = min(true, key=lambda q: abs(q))
    changed = given | {"suspension": SUSPENSIONS[p.suspension]}
    with Bench(**changed) as bench:
        assert bench["q"] == pytest.approx(start, rel=1e-6, abs=1e-12)
        bench.run_to(0.2, h=1e-3)
        assert bench["q"] == pytest.approx(start, rel=1e-6, abs=1e-10)
    inside = [q for q in true if abs(q) < p.travel]
    with Bench(**changed, contact=2) as bench:
        where = min(inside, key=lambda q: abs(q), default=float(np.sign(start)) * p.travel)
        assert bench["q"] == pytest.approx(where, rel=1e-6, abs=1e-12)
        bench.run_to(0.05, h=1e-3)
        assert bench["q"] == pytest.approx(where, rel=1e-6, abs=1e-10)
    within = places[np.abs(places) < 1.05 * p.travel][::200]
    walls = p.contact_stiffness * np.maximum(np.abs(within) - p.travel, 0.0) ** 1.5
    own = suspension_force(known, within) - np.sign(within) * walls - RAM * p.gravity
    assert own == pytest.approx([force(p, q) for q in within], rel=1e-6, abs=1e-9)


def test_a_pulse_leaves_the_ram_of_the_shipped_rig_at_its_upper_wall() -> None:
    """And a run tells so beforehand."""
    result = cosim.run("paper-limited", {"run.duration": 0.05, "run.settle": 0.0})
    (note,) = (one for one in result.summary["notes"] if "rests" in one)
    low, high = result.summary["rests"]
    assert f"q = {low * 1e3:.3g} mm, where the run starts" in note and "at the upper wall" in note
    waves = result.waveforms
    assert float((waves.z_ram - waves.z_surface)[0]) == pytest.approx(low, abs=1e-9)
    reals, integers = parameters(load("paper-limited"))
    rig = {k: v for k, v in (reals | integers).items() if k not in ("source", "coil_count")}
    with Bench(**rig) as bench:
        bench.run_to(0.02, h=1e-3, current=1.0)
        bench.run_to(2.0, h=1e-3, current=0.0)
        assert bench["q"] == pytest.approx(high, rel=1e-6) and high > reals["travel"]


@pytest.mark.parametrize("contact", ["compliant", "rigid"])
@pytest.mark.parametrize(
    "law",
    [
        {"suspension": "cubic", "suspension_k2": -1e5, "suspension_k3": 7e7},
        {"suspension": "knee", "suspension_hardening": 8e5, "suspension_knee": -2e-4},
        {
            "suspension": "repulsion",
            "suspension_distance": 3.4e-3,
            "contact_stiffness": 4e4,
            "contact_damping": 0.2,
        },
    ],
)
def test_the_energy_of_each_law_is_accounted_for(law: dict[str, Any], contact: str) -> None:
    """The last with a wall so soft that the ram goes far into it."""
    keys = {f"mechanics.{k}": v for k, v in law.items()} | {"mechanics.contact": contact}
    result = cosim.run("paper-limited", keys | {"run.duration": 0.3, "run.settle": 0.1})
    assert result.summary["energy_residual"] < 1e-8
    assert result.summary["impacts"] > 3
    if "contact_stiffness" in law and contact == "compliant":
        deep = (result.waveforms.z_ram - result.waveforms.z_surface).min().item()
        assert -deep > 1.03 * result.scene.mechanics.travel


def test_a_magnet_too_near_is_refused_in_a_sentence() -> None:
    """By the scene and by the FMU, for its own users."""
    with pytest.raises(BadInput) as error:
        load("reference", {"mechanics.suspension": "repulsion", "mechanics.travel": 2.6e-3})
    told = "mechanics.suspension_distance = 0.0028 m must be at least 1.1 times mechanics.travel"
    assert told in str(error.value)
    load("reference", {"mechanics.travel": 2.6e-3})
    with closing(Interface(3)) as fmu:
        fmu.set_integers(fmu.places(("suspension",)), (c_int * 1)(3))
        fmu.set_reals(fmu.places(("travel",)), (c_double * 1)(2.6e-3))
        with pytest.raises(FMICallException):
            fmu.initialise()
        assert "must be at least 1.1 times travel = 0.0026 m" in fmu.messages[-1]
