"""Every built-in scene runs on its own rung, and the devices go where their descriptions say."""

import math

import pytest

from cosim.evaluate.point import evaluate
from cosim.scene import list_scenes, load
from cosim.simulation.simulate import simulate

NEEDS_A_FILE = {"trial"}
DIRECTIONS = {
    "gripper-17g": 1, "gripper-169g": 1, "square": -1, "down-grip": -1, "down-waveform": -1,
    "direct-drive": -1, "direct-drive-stops": 1, "two-surfaces": 1, "paper": 1,
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(set(dict(list_scenes())) - NEEDS_A_FILE))
def test_a_scene_runs(name: str):
    result = simulate(load(name, ["run.duration=0.04", "run.settle=0.02", "run.output_step=1e-3"]))
    if not result.scene.has_ports:
        assert result.summary["energy_residual"] < 1e-3  # pyright: ignore[reportOperatorIssue]
    assert all(math.isfinite(values.sum()) for values in result.columns.values())


@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_part_goes_where_its_scene_says(name: str):
    numbers = evaluate(load(name, ["circuit.model=ideal"]), {}, whole_periods=False).numbers
    assert math.copysign(1, numbers["v_average"]) == DIRECTIONS[name]
    assert abs(numbers["v_average"]) > 5e-4


def test_a_heavy_part_goes_slowly():
    light, heavy = (
        evaluate(load(name, ["circuit.model=ideal"]), {}, whole_periods=False).numbers["v_average"]
        for name in ("gripper-17g", "gripper-169g")
    )
    assert 0.0 < heavy < 0.8 * light  # as its description says
