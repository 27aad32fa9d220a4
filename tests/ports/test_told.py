"""What runs with ports tell of the errors of their means, against the means of finer steps."""

import pytest

from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.simulation.test_checks import within_twice_the_told

pytestmark = [pytest.mark.physics, pytest.mark.checked]

PWM = {
    "fmu.gear.friction": 2.0,
    "circuit.param.inductance": 4e-3,
    "circuit.max_step": 1e-5,
    "run.duration": 0.06,
    "run.settle": 0.02,
}
"""Edges of 1 µs rule the steps; the bridge's switches store nothing that could tell their error."""

FINE = {"circuit.max_step": 2e-6, "circuit.reltol": 1e-7}


def test_edges_that_two_runs_meet_alike_do_not_hide_the_error() -> None:
    """Of a run with longer steps alone 0.3 to 1 % of the error was told."""
    found = simulate(load("dc-motor", PWM), checks="usual").summary
    true = simulate(load("dc-motor", PWM | FINE)).summary
    for name in ("gear.speed.mean", "gear.angle.mean", "Vemf.mean"):
        assert abs(found[name] - true[name]) > 1e-4 * abs(true[name])
        assert within_twice_the_told(found[name], found[f"{name}_error"], true[name])
        assert found[f"{name}_error"] < 20.0 * abs(found[name] - true[name])
