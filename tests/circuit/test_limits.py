"""When within a step of the circuit a limit begins and ends."""

import numpy as np
import pytest

from cosim.arrays import Array
from cosim.circuit.limits import shares_of_steps


def log(time: Array, begin: float, end: float) -> dict[str, Array]:
    """An output that rises to its limit at ``begin`` and leaves it at ``end`` (s); there the node
    has fallen from 20 V to zero."""
    out = 14.0 - 2e5 * np.maximum(begin - time, 0.0) - 3e5 * np.maximum(time - end, 0.0) ** 2
    node = np.where(time < begin, 0.0, np.clip((end - time) * 1e5, 0.0, 20.0))
    return {"time": time, "v(swing)": node, "v(out)": out}


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("begin", [0.00051, 0.00058, 0.000599])
@pytest.mark.parametrize("end", [0.00202, 0.00205, 0.00213])
def test_straight_lines_tell_when(begin: float, end: float, sign: int) -> None:
    looks = [0, 300, 420, 500, 600, 900, 1500, 1800, 1950, 2000, 2150, 2300, 3000]  # us
    time = np.array(looks, np.float64) * 1e-6
    found = log(time, begin, end)
    shares = shares_of_steps({k: v if k == "time" else sign * v for k, v in found.items()}, 1e-9)
    ours = shares["swing_high" if sign > 0 else "swing_low"]
    assert np.dot(ours, np.diff(time)) == pytest.approx(end - begin, rel=1e-9)
    np.testing.assert_array_equal(shares["output"], ours)
    assert not shares["swing_low" if sign > 0 else "swing_high"].any()


def test_a_node_that_says_yes_or_no_leaves_the_step_in_two_halves() -> None:
    time = 1e-4 * np.arange(8, dtype=np.float64)
    yes = np.array([0.0, 0, 0, 1, 1, 1, 0, 0])
    wander = np.array([0.0, 1, 0, 0, 0, 0, 1, 0])
    shares = shares_of_steps({"time": time, "v(swing)": yes, "v(out)": wander}, 0.5)
    assert shares["swing_high"].tolist() == [0, 0, 0.5, 1, 1, 0.5, 0]


def test_what_is_not_known_is_not_told() -> None:
    time = 1e-4 * np.arange(3, dtype=np.float64)
    assert shares_of_steps({"time": time, "v(out)": time}, 0.5) == {}
    slewing = shares_of_steps({"time": time, "v(out)": time, "v(slewing)": time}, 0.5)
    assert list(slewing) == ["slew"]
