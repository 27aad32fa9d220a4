"""The estimate of the winding's temperature: against the two equations, solved by SciPy."""

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.circuit.heat import (
    COPPER,
    DRIVE_RANGE_HEAT,
    SPREAD,
    heat_limit,
    modes,
    rise,
    warmed,
)
from cosim.errors import BadInput
from cosim.scene import load
from cosim.scene.tables import Coil
from cosim.simulation.simulate import summary

COIL = Coil()


def integrated(coil: Coil, heat: float, times: list[float], warmer: float = 0.0) -> np.ndarray:
    """Rises of the winding (K) at the end of stretches with and without the heat, by turns, which
    is ``warmer`` times as much more with each K: the equations are linear, and an exponential of
    their matrix solves them."""
    across, away = 1.0 / coil.winding_to_body, 1.0 / coil.body_to_air
    winding, body = coil.winding_capacity, coil.body_capacity
    rates = np.array(
        [
            [(warmer * heat - across) / winding, across / winding, 1.0 / winding],
            [across / body, -(across + away) / body, 0.0],
            [0.0, 0.0, 0.0],
        ]
    )
    ways = {length: expm(rates * length) for length in set(times)}
    state, ends = np.zeros(3), []
    for number, length in enumerate(times):
        state[2] = heat if number % 2 == 0 else 0.0
        state = ways[length] @ state
        ends.append(state[0])
    return np.array(ends)


@pytest.mark.parametrize("lasts", [0.5, 10.0, 300.0, 5000.0])
def test_rise_is_that_of_the_equations(lasts: float) -> None:
    (exact,) = integrated(COIL, 3.5, [lasts])
    assert 3.5 * rise(COIL, lasts, 0.0) == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize(("on", "duty"), [(10.0, 0.3), (60.0, 0.5), (2.0, 0.05)])
def test_cycles_are_those_of_the_equations(on: float, duty: float) -> None:
    cycles = int(3000.0 / (on / duty))
    exact = integrated(COIL, 2.0, [on, on / duty - on] * cycles)
    assert 2.0 * rise(COIL, on, duty) == pytest.approx(exact[:-1:2].max(), rel=1e-3)


def test_ends_of_what_is_known() -> None:
    """For ever only the resistances count; in an instant only the winding's capacity; always on is
    no cycle; many short cycles are as their mean."""
    both = COIL.winding_to_body + COIL.body_to_air
    assert rise(COIL) == pytest.approx(both, rel=1e-12)
    assert rise(COIL, 1e-4, 0.0) == pytest.approx(1e-4 / COIL.winding_capacity, rel=1e-3)
    assert rise(COIL, 10.0, 1.0) == pytest.approx(both, rel=1e-12)
    assert rise(COIL, 1e-3, 0.2) == pytest.approx(0.2 * both, rel=1e-3)
    times = [tau for _, tau in modes(**{name: getattr(COIL, name) for name in SPREAD})]
    assert times[0] > times[1] > 0.0
    # 33 to 49 K/W of the body, 6 to 10 J/K, 5 to 20 K/W of the winding, 0.4 to 1.4 J/K
    assert rise(COIL, side=-1) == pytest.approx(33 + 5, rel=0.02)
    assert rise(COIL, side=1) == pytest.approx(49 + 20, rel=0.02)


def test_copper_that_warms_makes_more_heat() -> None:
    """Under a current, for ever as the equations have it, in 10 s at most a tenth more; and beyond
    what the coil can lose without end."""
    (ever,) = integrated(COIL, 2.0, [20000.0], COPPER)
    assert warmed(2.0, rise(COIL)) == pytest.approx(ever, rel=1e-6)
    (lift,) = integrated(COIL, 3.5, [10.0], COPPER)
    assert lift <= warmed(3.5, rise(COIL, 10.0, 0.0)) <= 1.1 * lift
    most = 1.0 / (COPPER * rise(COIL))
    assert warmed(0.9 * most, rise(COIL)) == np.inf
    assert integrated(COIL, 1.1 * most, [20000.0], COPPER)[0] > 1e4


def test_limit_of_heat() -> None:
    assert warmed(heat_limit(COIL, 60.0), rise(COIL)) == pytest.approx(60.0)
    there = heat_limit(COIL, 60.0, 0.3, 10.0)
    assert warmed(there, rise(COIL, 10.0, 0.3)) == pytest.approx(60.0)
    assert heat_limit(COIL, 60.0, 0.0, 10.0) > there > heat_limit(COIL, 60.0)
    assert pytest.approx(3.521, abs=1e-3) == DRIVE_RANGE_HEAT
    for wrong in ((0.0, 1.0, 1.0), (60.0, 1.1, 1.0), (60.0, 0.5, 0.0)):
        with pytest.raises(BadInput, match="a duty from 0 to 1"):
            heat_limit(COIL, *wrong)


@pytest.mark.parametrize("model", ["ideal", "limited", "amplifier"])
def test_a_run_tells_its_heat(model: str) -> None:
    """A square wave too slow to matter, of 2 V on 4 Ohm, and the ram held still by a stiff spring:
    i² R is 0.25 A² times 7.1 Ohm."""
    still = {"mechanics.suspension_k1": 1e5, "run.duration": 0.2, "run.settle": 0.1}
    drive = {"drive.waveform": "square", "drive.amplitude": 4.0, "drive.offset": 0.0}
    told = summary(load("reference", {"circuit.model": model, **still, **drive}))
    assert told["coil_heat"] == pytest.approx(0.25 * 7.1, rel=0.02)
    low, high = told["coil_rise_continuous"]
    assert low == pytest.approx(warmed(told["coil_heat"], 38.0), rel=0.03)
    assert high == pytest.approx(warmed(told["coil_heat"], 69.0), rel=0.06)
