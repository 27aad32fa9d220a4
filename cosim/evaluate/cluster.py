"""Points of a scene on a Dask cluster (the extra ``dask``)."""

from collections.abc import Iterator
from itertools import islice
from typing import Any

from cosim.errors import BadInput
from cosim.evaluate.point import Outcome, evaluate
from cosim.scene import Scene

PATIENCE = 15.0
"""s in which the cluster must answer."""

_IN_FLIGHT = 4
"""Points at the cluster for each of its threads: enough to keep it busy, whatever the number."""


class Cluster:
    """The cluster at ``address``, for points of ``base``; to be used in a ``with`` block.

    Its workers must have this version of cosim. Raises BadInput where there is no such cluster.
    """

    def __init__(self, address: str, base: Scene, whole_periods: bool) -> None:
        self._client, self._whole_periods = _client(address), whole_periods
        self._threads = sum(self._client.nthreads().values())
        if not self._threads:
            self._client.close()
            raise BadInput(f"--dask {address}: this cluster has no workers.")
        # What a task gave is made again where the workers that had it die, scattered data is not.
        self._base = self._client.submit(_same, base, pure=False)

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def run(self, points: Iterator[tuple[int, Any]]) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point, in the order in which the cluster finishes them."""
        from distributed import as_completed

        numbers: dict[str, int] = {}

        def submit(point: tuple[int, Any]) -> Any:
            number, values = point
            future = self._client.submit(
                evaluate, self._base, dict(values), self._whole_periods, pure=False
            )
            numbers[future.key] = number
            return future

        first = islice(points, _IN_FLIGHT * self._threads)
        running = as_completed([submit(point) for point in first])
        for future in running:
            number = numbers.pop(future.key)
            try:
                outcome = future.result()
            except Exception as failure:
                # Its worker died with it, again and again, or something that no scene explains.
                words = " ".join(str(failure).split())
                words = f"The cluster gave it up: {type(failure).__name__}: {words}"
                outcome = Outcome({}, words, machine=True)
            following = next(points, None)
            if following is not None:
                running.add(submit(following))
            yield number, outcome


def _same(base: Scene) -> Scene:
    return base


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise BadInput(
            "--dask needs the package distributed: install cosim with its extra dask."
        ) from error
    try:
        return Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"--dask {address}: no cluster answers there ({reason}).") from error
