"""Steps of ngspice that a scene has unless it says otherwise."""

import pytest

from cosim.scene import load

NETLIST = "circuit.netlist=circuits/examples/h_bridge.cir"


@pytest.mark.parametrize(
    ("overrides", "step"),
    [
        ([], 1.4e-4),
        (["circuit.model=full"], 1.4e-4),
        (["mechanics.contact=rigid"], 1.4e-4),
        (["circuit.model=file", NETLIST], 2e-5),
        (["circuit.model=file", NETLIST, "circuit.max_step=1e-4"], 1e-4),
    ],
)
def test_largest_step(overrides: list[str], step: float) -> None:
    assert load("reference", overrides).circuit.max_step == step
