"""The points of a sweep, many at once: one that crashes or hangs costs only itself."""

from collections.abc import Iterable, Iterator, Mapping

from cosim.errors import BadInput
from cosim.scene import Scene
from cosim.simulation.many import Progress, each
from cosim.studies.sweep.point import Number, Outcome, evaluate, failed, point
from cosim.toolchain.processes import processors

Point = tuple[int, Mapping[str, Number | str]]


class Pool:
    """Runs points of one scene, ``workers`` at once; no more circuits than there are processors."""

    def __init__(self, base: Scene, workers: int, whole_periods: bool = False) -> None:
        # What all points have in common is changed once.
        self._base, self._whole_periods = point(base, {}, False), whole_periods
        self._count = workers

    def run(self, points: Iterable[Point]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point (number, settings), in the order in which they finish."""
        for number, found in each(self._evaluate, points, self._count):
            yield number, failed(found) if isinstance(found, Exception) else found

    def _evaluate(self, values: Mapping[str, Number | str], progress: Progress) -> Outcome:
        return evaluate(self._base, values, self._whole_periods, progress)


def workers_asked(workers: int | None) -> int:
    """The number of workers: those asked for, or one for each processor. Raises BadInput."""
    if workers is None:
        return processors()
    if not 1 <= workers <= 1024:
        raise BadInput(f"--workers {workers}: must be a whole number from 1 to 1024.")
    return workers
