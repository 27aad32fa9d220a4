"""Runs a sweep: takes up what its journal holds, runs the rest, keeps the dataset up to date."""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import xarray as xr

from cosim.mechanics import package as fmu
from cosim.scene import Scene
from cosim.studies.sweep import dataset
from cosim.studies.sweep.design import Design
from cosim.studies.sweep.journal import Journal
from cosim.studies.sweep.point import Outcome
from cosim.studies.sweep.pool import Point, Pool, workers_asked
from cosim.toolchain.versions import versions

JOURNAL = "sweep.journal"
RESULT = "sweep.nc"

_REFRESH = 10.0
"""s between two writings of the dataset, and at least _RARELY times as long as one takes."""
_RARELY = 20.0


def sweep(
    scene: Scene,
    design: Design,
    out: str | os.PathLike[str],
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[int, int, int], None] = lambda done, failed, total: None,
) -> xr.Dataset:
    """Run ``scene`` at every point of ``design``; the result is ``sweep.nc`` in the folder ``out``.

    Points that an interrupted sweep has left in the folder's journal are not run again. A point
    that fails is NaN, with the reason in ``failure``. Where the frequency is swept, each point's
    settling and averages last whole periods, at least as long as the scene's own. ``workers`` local
    processes (default: one for each processor), or the Dask cluster at the address ``dask``.
    ``progress`` is told the points done, how many of them failed, and their number.

    Call it under ``if __name__ == "__main__":`` in a script: the workers are processes of their
    own. Raises BadInput where the folder holds another sweep.
    """
    count = workers_asked(workers)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    made_by = {**versions(), "fmu": fmu.token()}
    with Journal(folder / JOURNAL, _identity(scene, design, made_by)) as journal:

        def refreshed() -> xr.Dataset:
            data = dataset.dataset(scene, design, journal.read(), made_by)
            dataset.write(folder / RESULT, data)
            return data

        total, done = len(design), len(journal.done)
        failed = sum(1 for _, outcome in journal.read() if outcome.failure)
        progress(done, failed, total)
        due = time.monotonic() + _REFRESH
        for number, outcome in _run(scene, design, journal, count, dask):
            journal.add(number, outcome)
            done, failed = done + 1, failed + bool(outcome.failure)
            progress(done, failed, total)
            if time.monotonic() >= due:
                began = time.monotonic()
                refreshed()
                ended = time.monotonic()
                due = ended + max(_REFRESH, _RARELY * (ended - began))
        return refreshed()


def _run(
    scene: Scene, design: Design, journal: Journal, workers: int, dask: str | None
) -> Iterator[tuple[int, Outcome]]:
    if len(journal.done) == len(design):
        return
    before = frozenset(journal.done)
    points: Iterator[Point] = (
        (number, design.point(number)) for number in range(len(design)) if number not in before
    )
    whole_periods = design.changes_frequency
    if dask is not None:
        from cosim.studies.sweep.cluster import run_on_cluster

        yield from run_on_cluster(scene, points, dask, whole_periods)
        return
    with Pool(scene, min(workers, len(design)), whole_periods) as pool:
        yield from pool.run(points)


def _identity(scene: Scene, design: Design, made_by: dict[str, str]) -> str:
    """A hash of all that the numbers follow from."""
    axes = [(axis.key.full, axis.values) for axis in design.axes]
    said = json.dumps([scene.as_dict(), axes, design.sample, made_by], sort_keys=True)
    return hashlib.sha256(said.encode()).hexdigest()
