"""``coupling.method = "auto"`` against the monolithic reference solution."""

import warnings

import numpy as np
import pytest

from cosim.errors import NoEffect, SimulationFailed
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.cases import CASES, reference

pytestmark = pytest.mark.physics


def scene(name: str, tolerance: float, *more: str) -> Scene:
    case = CASES[name]
    return load(
        "reference",
        [
            *case.overrides,
            f"run.duration={case.duration!r}",
            f"run.output_step={case.times()[0]!r}",
            "coupling.method=auto",
            f"coupling.tolerance={tolerance!r}",
            *more,
        ],
    )


@pytest.mark.parametrize(("name", "tolerance"), [("reference", 1e-3), ("stick-slip", 1e-3)])
def test_the_tolerance_is_met_and_the_error_told(name: str, tolerance: float) -> None:
    result = simulate(scene(name, tolerance))
    true = reference(name).error(result.columns["z_part"][np.newaxis, 1:])
    told = result.summary["error_estimate"]
    assert isinstance(told, float)
    assert true <= tolerance
    # A fiftieth of the tolerance is less than the finer runs, by which it is told, err themselves.
    assert true / 3.0 < told < max(3.0 * true, tolerance / 50.0)
    again = simulate(result.scene)
    assert np.array_equal(again.columns["z_part"], result.columns["z_part"])


def test_a_smaller_tolerance_takes_more_steps() -> None:
    coarse, fine = (simulate(scene("reference", tolerance)).summary for tolerance in (1e-3, 5e-6))
    assert isinstance(coarse["circuit_steps"], int) and isinstance(fine["circuit_steps"], int)
    assert coarse["circuit_steps"] < fine["circuit_steps"]


def test_what_cannot_be_met_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "cosim.simulation.choose_steps.LEVELS", ((1e-3, 1e-4), (1e-4, 1e-4), (1e-5, 1e-4))
    )
    with pytest.raises(SimulationFailed, match=r"coupling.tolerance = 1e-06 is not met.*differ by"):
        simulate(scene("reference", 1e-6))


def test_steps_that_it_chooses_itself_have_no_effect() -> None:
    with pytest.warns(NoEffect, match="circuit.max_step has no effect.*auto.*chooses it"):
        scene("reference", 1e-3, "circuit.max_step=2e-6")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load("reference", ["circuit.max_step=2e-6", "coupling.method=companion"])
