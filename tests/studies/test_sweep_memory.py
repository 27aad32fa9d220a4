"""A sweep's parent does not grow with the number of points."""

import gc
from pathlib import Path

import psutil
import pytest

from cosim.scene import load
from cosim.studies.sweep.design import grid
from cosim.studies.sweep.journal import journal
from cosim.studies.sweep.pool import Pool

pytestmark = pytest.mark.reliability


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "optimal"])  # in processes, in threads
def test_parent_stays_flat(name: str, tmp_path: Path) -> None:
    scene = load(name, ["run.duration=0.002", "run.settle=0.001"])
    design = grid({"friction.mu_s": [0.6 + 1e-5 * k for k in range(6000)]})
    process = psutil.Process()
    sizes = []
    with journal(tmp_path / "journal", "test", len(design)) as kept:
        points = ((k, design.point(k)) for k in range(len(design)))
        for number, outcome in Pool(scene, 2).run(points):
            assert not outcome.failure
            kept.add(number, outcome)
            if len(kept.done) % 1000 == 0:
                gc.collect()
                sizes.append(process.memory_info().rss / 1e6)
    # The numbers of the points that are done are remembered: 60 bytes each.
    assert sizes[-1] - sizes[0] < 2.0, f"MB after each 1,000 points: {sizes}"
