"""A sweep's parent does not grow with the number of points."""

import gc
from pathlib import Path

import psutil
import pytest

from cosim.evaluate.evaluator import Evaluator
from cosim.scene import load
from cosim.studies.sweep.design import grid

pytestmark = pytest.mark.reliability


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "optimal"])  # in processes, in threads
def test_parent_stays_flat(name: str, tmp_path: Path) -> None:
    scene = load(name, ["run.duration=0.002", "run.settle=0.001"])
    design = grid({"friction.mu_s": [0.7 + 1e-5 * k for k in range(6000)]})
    process = psutil.Process()
    sizes = []
    with Evaluator(scene, tmp_path / "store", workers=2) as bench:
        points = ((k, design.point(k)) for k in range(len(design)))
        for done, (_, outcome) in enumerate(bench.run(points), 1):
            assert not outcome.failure
            if done % 1000 == 0:
                gc.collect()
                sizes.append(process.memory_info().rss / 1e6)
    assert sizes[-1] - sizes[0] < 2.0, f"MB after each 1,000 points: {sizes}"
