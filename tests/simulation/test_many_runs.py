"""Many runs in one process: equal to the bit, and without a leak."""

import gc
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from cosim.mechanics import stickslip
from cosim.scene import load
from cosim.simulation.simulate import simulate

pytestmark = pytest.mark.reliability

MIXED = [
    load("reference", ["circuit.model=ideal", "run.duration=0.02"]),
    load("reference", ["run.duration=0.004", "run.output_step=1e-4"]),
    load("reference", ["circuit.model=full", "run.duration=0.001", "run.output_step=1e-4"]),
    load("gripper", ["run.duration=0.004", "mechanics.contact=rigid"]),
]


def resident() -> float:
    """Memory of this process, MB."""
    with open("/proc/self/status", encoding="ascii") as status:
        line = next(line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def run_all() -> list[np.ndarray]:
    return [np.column_stack(list(simulate(scene).columns.values())) for scene in MIXED]


@pytest.mark.parametrize("rounds", [10, pytest.param(125, marks=pytest.mark.slow)])
def test_mixed_runs(rounds: int) -> None:
    first = run_all()
    for _ in range(3):  # libraries loaded, caches and the allocator's arenas filled
        run_all()
    gc.collect()
    try:
        before = resident()
    except FileNotFoundError:
        before = None
    for _ in range(rounds):
        for again, known in zip(run_all(), first, strict=True):
            assert again.tobytes() == known.tobytes()
    gc.collect()
    if before is not None:
        assert resident() - before < 20.0


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("model", "runs"), [("limited", 10_000), ("ideal", 10_000), ("amplifier", 2_000)]
)
def test_a_run_leaks_less_than_1_kB(model: str, runs: int) -> None:
    scene = load("reference", [f"circuit.model={model}", "run.duration=0.002", "run.settle=0"])
    for _ in range(2000):  # caches and the allocator's arenas filled
        simulate(scene)
    gc.collect()
    before = resident()
    for _ in range(runs):
        simulate(scene)
    gc.collect()
    assert (resident() - before) * 1024 / runs < 1.0, "kB a run"


def test_threads_that_alternate_scenes_disturb_no_other() -> None:
    """Each finds the parameters of its own scene, however often it is interrupted."""
    scenes = [load("held", {"mechanics.part_mass": mass}) for mass in (0.01, 0.02, 0.03, 0.04)]
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as threads:
            asked = [scenes[k % 4] for k in range(2000)]
            found = [*threads.map(stickslip.parameters, asked)]
    finally:
        sys.setswitchinterval(usual)
    for scene, (reals, _) in zip(asked, found, strict=True):
        assert reals["part_mass"] == scene.mechanics.part_mass
