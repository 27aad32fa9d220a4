"""The bench against an independent monolithic model of the whole chain.

``tests/reference/golden.json`` holds runs of ``tests/reference/monolithic.py`` (SUNDIALS restarted
at each event; it shares no code with the FMU, the netlists or the coupling) over many parameter
sets, each with its own sensitivity. A chaotic set, whose averages hang on the tenth digit of a
parameter, is compared in its early trajectory only; a delicate one asks for less.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.scene import KEYS, Scene, load
from cosim.simulation.simulate import simulate
from cosim.waveforms.result import Result

pytestmark = pytest.mark.physics

GOLDEN = json.loads((Path(__file__).parents[1] / "reference" / "golden.json").read_text())
CASES = {case["name"]: case for case in GOLDEN["cases"]}
FULL_NAME = {key.name: key.full for key in KEYS.values()}

# Allowed differences of a trajectory's samples in the first 60 ms, SI: about five times what the
# coupling's error makes; without ngspice only the two integrators differ, and by 2e-7 of half its
# height the sine, which the FMU is given in straights.
EARLY = {
    "amplifier": {"z_surface": 1e-6, "z_ram": 5e-6, "z_part": 1e-6, "v_part": 5e-4},
    "limited": {"current": 3e-7, "z_surface": 2e-9, "z_ram": 5e-9, "z_part": 2e-9, "v_part": 5e-7},
    "ideal": {"z_surface": 2e-9, "z_ram": 5e-9, "z_part": 2e-9, "v_part": 5e-7},
}
# Of v_average: relative, or absolute, m/s
AVERAGE = {"amplifier": (5e-4, 1e-6), "limited": (1e-6, 1e-9), "ideal": (1e-6, 1e-9)}


def scene_of(case: dict) -> Scene:
    overrides = [f"{FULL_NAME[name]}={value!r}" for name, value in case["params"].items()]
    overrides += [
        f"mechanics.contact={case['contact']}",
        f"circuit.model={case['circuit']}",
        f"run.duration={case['duration']}",
        f"run.settle={case['settle']}",
    ]
    return load("reference", overrides)


def check_early(case: dict, result: Result) -> None:
    times = np.array(GOLDEN["sample_times"])
    rows = np.round(times / result.scene.run.output_step).astype(int)
    np.testing.assert_allclose(result.columns["time"][rows], times, rtol=0, atol=1e-12)
    judged = EARLY[case["circuit"]]
    for name, allowed in ((n, a) for n, a in judged.items() if n in result.columns):
        found, expected = result.columns[name][rows], case["trajectory"][name]
        np.testing.assert_allclose(found, expected, rtol=0, atol=allowed, err_msg=name)


def check_statistics(case: dict, result: Result) -> None:
    expected, found = case["result"], result.summary
    relative, absolute = AVERAGE[case["circuit"]]
    relative *= 2.5 if case["delicate"] else 1.0
    assert found["v_average"] == pytest.approx(expected["v_average"], rel=relative, abs=absolute)
    for name, spread in (
        ("stick_fraction", 2e-3),
        ("saturated_fraction", 2e-3 * expected["saturated_fraction"] + 1e-6),
        ("z_surface_pp", 4e-3 * expected["z_surface_pp"]),
        ("v_surface_max", 2e-3 * abs(expected["v_surface_max"])),
        ("v_surface_min", 2e-3 * abs(expected["v_surface_min"])),
    ):
        assert found[name] == pytest.approx(expected[name], abs=spread), name
    if case["contact"] == "compliant":  # rigid: how many of a fading bouncing are counted differs
        assert found["impacts"] == expected["impacts_all"]
        assert found["stick_slip_events"] == expected["stick_slip_events"]


@pytest.mark.parametrize("name", CASES)
def test_run_agrees(name: str) -> None:
    case = CASES[name]
    result = simulate(scene_of(case))
    check_early(case, result)
    if not case["chaotic"]:
        check_statistics(case, result)


def test_most_sets_have_a_number_to_meet() -> None:
    assert sum(not case["chaotic"] for case in CASES.values()) >= 24
