"""The estimate of v_average's own error against its true one."""

from pathlib import Path

import pytest

from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.simulation.test_against_reference import CASES, scene_of

pytestmark = pytest.mark.physics

EXAMPLES = Path(__file__).parents[2] / "circuits" / "examples"


@pytest.mark.parametrize("name", ["bent-bl", "pressed", "asymmetric"])
def test_it_is_the_true_error_within_a_factor(name: str) -> None:
    """Against the monolithic reference; these sets feel the circuit's steps most."""
    found = simulate(load(scene_of(CASES[name]), {"circuit.reltol": 1e-4})).summary
    true = found["v_average"] - CASES[name]["result"]["v_average"]
    assert 0.5 < found["v_average_error"] / true < 2.0


def test_it_is_not_told_where_nothing_is_known() -> None:
    """Without a node that tells of the swing, or where the mechanics got another charge."""
    gauss_seidel = {"coupling.method": "gauss-seidel", "run.duration": 0.1, "run.settle": 0.0}
    assert simulate(load("reference", gauss_seidel)).summary["v_average_error"] is None
    limited = {"circuit.model": "limited", "run.duration": 0.1, "run.settle": 0.0}
    assert "v_average_error" not in simulate(load("reference", limited)).summary


def test_a_netlist_of_ones_own() -> None:
    """Whose sense resistor and output stage are its own: against a run with finer steps."""
    bridge = {
        "circuit.model": "file",
        "circuit.netlist": str(EXAMPLES / "h_bridge.cir"),
        "drive.amplitude": 9.0,
        "run.duration": 0.3,
    }
    found = simulate(load("reference", bridge)).summary
    fine = {"circuit.max_step": 8e-6, "circuit.reltol": 1e-6}
    true = found["v_average"] - simulate(load("reference", bridge | fine)).summary["v_average"]
    assert found["saturated_fraction"] > 0.05
    assert abs(found["v_average_error"]) < 10.0 * abs(true) + 1e-6
