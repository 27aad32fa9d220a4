"""What the processes of a sweep cost: its points against the same points in a bare loop."""

from collections.abc import Sequence
from statistics import median
from time import perf_counter

from cosim.scene import Scene
from cosim.studies.sweep.point import evaluate
from cosim.studies.sweep.pool import Pool


def throughput(scene: Scene, offsets: Sequence[float], rounds: int = 7) -> dict[str, float]:
    """Points a second of one worker over those of a bare loop: median, ``low`` and ``high``.

    The points are ``scene`` with each of the ``offsets`` (V). Both ways take turns, both warm.
    """
    points = [(k, {"drive.offset": offset}) for k, offset in enumerate(offsets)]
    ratios = []
    with Pool(scene, 1) as pool:
        for turn in range(rounds + 1):
            began = perf_counter()
            for _ in pool.run(points):
                pass
            between = perf_counter()
            for _, values in points:
                evaluate(scene, values, False)
            ended = perf_counter()
            if turn:  # the first one warms up
                ratios.append((ended - between) / (between - began))
    return {"median": median(ratios), "low": min(ratios), "high": max(ratios)}
