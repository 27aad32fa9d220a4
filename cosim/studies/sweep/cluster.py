"""The points of a sweep on a Dask cluster (the extra ``dask``)."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from itertools import islice
from typing import Any

from cosim.errors import BadInput
from cosim.scene import Scene
from cosim.studies.sweep.point import Outcome, evaluate
from cosim.studies.sweep.pool import Point

PATIENCE = 15.0
"""s in which the cluster must answer."""

_IN_FLIGHT = 4
"""Points at the cluster for each of its threads: enough to keep it busy, whatever the number."""


def run_on_cluster(
    base: Scene, points: Iterable[Point], address: str, whole_periods: bool
) -> Iterator[tuple[int, Outcome]]:
    """The outcome of each point, in the order in which the cluster at ``address`` finishes them.

    Its workers must have this version of cosim. Raises BadInput where there is no such cluster.
    """
    waiting = iter(points)
    numbers: dict[str, int] = {}
    with closing(_client(address)) as client:
        from distributed import as_completed

        threads = sum(client.nthreads().values())
        if not threads:
            raise BadInput(f"--dask {address}: this cluster has no workers.")
        shared = client.scatter(base, broadcast=True)

        def submit(point: Point) -> Any:
            number, values = point
            future = client.submit(evaluate, shared, dict(values), whole_periods, pure=False)
            numbers[future.key] = number
            return future

        running = as_completed([submit(point) for point in islice(waiting, _IN_FLIGHT * threads)])
        for future in running:
            number, failure = numbers.pop(future.key), future.exception()
            if failure is None:
                outcome = future.result()
            else:
                # Its worker died with it, again and again, or something that no scene explains.
                words = " ".join(str(failure).split())
                words = f"The cluster gave it up: {type(failure).__name__}: {words}"
                outcome = Outcome({}, words, machine=True)
            following = next(waiting, None)
            if following is not None:
                running.add(submit(following))
            yield number, outcome


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
