"""The points of a sweep without processes: threads of compiled code lead the mechanics of many.

Nothing but this project's own code runs, so none can hang, crash or spoil the process for others.
"""

from collections.abc import Iterable, Iterator
from functools import partial

from cosim.scene import Scene
from cosim.simulation.many import led, summaries
from cosim.studies.sweep.point import Outcome, failed, outcome, point
from cosim.studies.sweep.pool import Point, Pool


class Batch:
    """Runs points of one scene in ``workers`` threads; to be used as :class:`Pool` is."""

    def __init__(self, base: Scene, workers: int, whole_periods: bool = False) -> None:
        # What all points have in common is changed once.
        self._base, self._whole_periods = point(base, {}, False), whole_periods
        self._count = workers

    def __enter__(self) -> "Batch":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left where :meth:`run` has ended."""

    def run(self, points: Iterable[Point]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point (number, settings), in the order in which they finish."""
        scenes = (
            (number, partial(point, self._base, values, self._whole_periods))
            for number, values in points
        )
        for number, found in summaries(scenes, self._count):
            yield number, failed(found) if isinstance(found, Exception) else outcome(found)


def runner(base: Scene, workers: int, whole_periods: bool = False) -> Batch | Pool:
    """What runs points of a scene that keep its ``circuit.model``, with ``workers`` at once."""
    kind = Batch if led(base) else Pool
    return kind(base, workers, whole_periods)
