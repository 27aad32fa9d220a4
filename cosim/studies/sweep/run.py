"""Runs a sweep: takes known outcomes from its store, runs the rest, keeps the dataset current."""

import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from cosim.errors import BadInput, CosimError, Note, plain
from cosim.evaluate.evaluator import Evaluator, workers_asked
from cosim.evaluate.keys import refuse_unknown
from cosim.evaluate.point import Number, Settings, moved
from cosim.files.atomic import whole
from cosim.mechanics import package as fmu
from cosim.scene import Overrides, Scene, load
from cosim.scene.messages import suggestion
from cosim.simulation.checks import motion
from cosim.studies.sweep import dataset
from cosim.studies.sweep.design import Design, grid, sample
from cosim.studies.sweep.report import MOTION, MOTIONS, fastest
from cosim.toolchain.threads import threads
from cosim.toolchain.versions import versions
from cosim.typed import typed
from cosim.waveforms.report import motion_in_words, of_the_start
from cosim.waveforms.storage import netcdf

STORE = "sweep.sqlite"
RESULT = "sweep.nc"
FIGURE = "figure.png"

JUDGED = 50
"""Random points of a sweep with the fast solver that the FMU runs again."""

LOOKED_AT = {"fmu": 20, "fast": 5}
"""By the scene's solver: at most how many random points, and no more than a quarter of all, have
their kind of motion determined; each costs as much as a hundred points of the fast solver."""

_REFRESH = 10.0
"""Least time between two writings of the dataset, s; it is also at least _RARELY times the duration
of one writing."""
_RARELY = 20.0


@typed
def sweep(
    scene: Scene | str | os.PathLike[str],
    over: Mapping[str, Sequence[Number]],
    overrides: Overrides | None = None,
    *,
    samples: int | None = None,
    seed: int = 0,
    keep: str | Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[int, int, int], None] = lambda done, failed, total: None,
) -> xr.Dataset:
    """Run a scene at many settings of its keys; the numbers of all summaries as one dataset.

    ``over`` gives the values of each ``table.key``, SI; every combination is run. With ``samples``
    that many settings are spread over the ranges that the values span instead: a Latin hypercube,
    the same for the same ``seed``.

    The dataset has a dimension for each key, named without its table (``ds.sel(amplitude=8)``), or
    the dimension ``point`` for samples. Its variables are the numbers of a run's ``summary`` under
    their names, SI, each with ``units`` and ``long_name``; of a sweep by the fast solver also
    ``v_average_fmu``, where the FMU ran a point again. Attributes tell the scene, and the kind of
    motion at the fastest points. A point that fails is NaN, with the reason in ``failure``.
    Where the frequency is swept, each point's settling and averages last whole periods, at least as
    long as the scene's own.

    In the folder ``out`` it leaves ``sweep.nc`` and ``figure.png``, and takes up what an
    interrupted sweep has left there; with ``keep``, names of waveforms, also those of every point,
    as ``points/NUMBER.nc``. ``workers`` local processes (default: one for each processor), or the
    Dask cluster at the address ``dask``. ``progress`` is told the points done, failed, and in all.

    Raises BadInput for keys and values that cannot be, or where ``out`` holds another sweep.

    >>> data = sweep("held", {"friction.mu_s": [0.7, 0.8]}, {"run.duration": 0.01})
    >>> data.v_average.dims, data.mu_s.key
    (('mu_s',), 'friction.mu_s')
    """
    scene = load(scene, overrides)
    design = grid(over) if samples is None else sample(over, samples, seed)
    refuse_unknown(scene, over)
    if keep and out is None:
        raise BadInput("keep: waveforms are kept in a folder; name one as out.")
    kept = [keep] if isinstance(keep, str) else keep
    if kept and (columns := _columns(scene, design)):  # before the first of many runs
        _refuse_missing(kept, columns)
    with TemporaryDirectory() if out is None else nullcontext(out) as folder:
        data = _sweep(scene, design, Path(folder), kept, workers, dask, progress)
        if out is not None:
            from cosim.studies.sweep import figure

            figure.draw(data, scene.name).write(Path(out) / FIGURE)
    return data


def _sweep(
    scene: Scene,
    design: Design,
    folder: Path,
    keep: Sequence[str],
    workers: int | None,
    dask: str | None,
    progress: Callable[[int, int, int], None],
) -> xr.Dataset:
    family = folder / "points"
    if family.is_symlink() or (family.exists() and not family.is_dir()):
        raise BadInput(f"{plain(family)}: this is no directory of the sweep's own; remove it.")
    made_by, units = {**versions(), "fmu": fmu.token()}, dataset.units_of(scene)
    total, numbers = len(design), dataset.Numbers(len(design))
    asked = [(axis.key.full, axis.values) for axis in design.axes], design.sample
    whole_periods = design.changes_frequency

    def refreshed(last: bool = False) -> xr.Dataset:
        data = dataset.dataset(scene, design, numbers, made_by, units)
        data.attrs |= _motions(scene, design, data) if last else {}
        dataset.write(folder / RESULT, data, folder / FIGURE)
        return data

    with Evaluator(
        scene, folder / STORE, *asked, whole_periods=whole_periods, workers=workers, dask=dask
    ) as bench:
        if not bench.resumed:  # the waveforms there are those of another sweep
            for old in family.glob("*.nc"):
                if old.stem.isdecimal():
                    old.unlink()
        progress(0, 0, total)
        due = time.monotonic() + _REFRESH
        points = ((n, design.point(n)) for n in design.alike(range(total)))
        try:
            for done, (number, outcome) in enumerate(bench.run(points), 1):
                numbers.add(number, outcome)
                progress(done, numbers.failed, total)
                if time.monotonic() >= due:
                    began = time.monotonic()
                    try:
                        refreshed()
                    except BadInput as error:  # the disk may have room again at the end
                        warnings.warn(f"{error} The sweep goes on.", Note, stacklevel=2)
                    ended = time.monotonic()
                    due = ended + max(_REFRESH, _RARELY * (ended - began))
            if scene.run.solver == "fast":
                for number, outcome in bench.run(_judged(design, numbers)):
                    numbers.judge(number, outcome)
            data = refreshed(last=True)
        except KeyboardInterrupt:
            with suppress(BadInput):  # what is done stands in the store, too
                refreshed()
            raise
        if keep:
            points = [n for n in range(total) if not numbers.failures[n]]
            _keep(family, scene, design, keep, points, workers)
        return data


def _refuse_missing(names: Sequence[str], columns: Collection[str]) -> None:
    if unknown := [name for name in names if name not in columns]:
        hint = f"{suggestion(unknown[0], columns)} (they have {', '.join(columns)})"
        raise BadInput(f'--keep: the runs have no "{plain(unknown[0])}"{hint}.')


def _columns(scene: Scene, design: Design) -> Collection[str] | None:
    """The waveforms of the first point's run, cut short; None where it fails."""
    from cosim.simulation.simulate import simulate

    with suppress(CosimError):
        first = moved(scene, design.point(0), design.changes_frequency)
        short = min(first.run.duration, 2.0 * first.run.output_step)
        times = {"settle": 0.0, "duration": short, "average": "ends"}
        return simulate(first.having(run=times)).columns
    return None


def _keep(
    folder: Path,
    scene: Scene,
    design: Design,
    names: Sequence[str],
    points: Sequence[int],
    workers: int | None,
) -> None:
    """Run ``points`` again in threads of this process, and write the waveforms ``names`` of each,
    from ``run.settle`` on, as ``NUMBER.nc``. Raises CosimError."""
    from cosim.simulation.simulate import simulate

    def kept(number: int) -> None:
        point = moved(scene, design.point(number), design.changes_frequency)
        result = simulate(point, progress)
        _refuse_missing(names, result.columns)
        later = result.columns["time"] >= point.run.settle
        columns = {name: result.columns[name][later] for name in ("time", *names)}
        with whole(folder / f"{number}.nc") as temporary, temporary.open("wb") as file:
            netcdf(file, columns, result.units, {"frequency": repr(1.0 / point.period)})

    with threads(workers_asked(workers)) as (pool, progress):
        for _ in pool.map(kept, points):  # which raises what a call raises
            pass


def _motions(scene: Scene, design: Design, data: xr.Dataset) -> dict[str, str]:
    """Attributes of the dataset, in words: the kind of motion at the fastest points, and how often
    each kind occurs at random points; left out where no kind could be determined."""

    def at(number: int) -> tuple[str, str, str]:
        """The kind of motion at a point; its description; a warning if the mean holds the start."""
        values = {**design.point(number), "run.solver": "fmu"}
        point = moved(scene, values, design.changes_frequency)
        summary = motion(point, lambda _: None)
        summary["v_average"] = float(v[number])
        return summary.get("motion", ""), motion_in_words(summary), of_the_start(point, summary)

    found, v = {}, data["v_average"].values.ravel() if "v_average" in data else np.empty(0)
    for way, place in fastest(data):
        words = "; ".join(filter(None, at(int(place))[1:]))
        found |= {MOTION.format(way): words} if words else {}
    known = np.random.default_rng(1).permutation(np.flatnonzero(np.isfinite(v)))
    drawn = known[: min(LOOKED_AT[scene.run.solver], len(v) // 4)].tolist()
    if found and drawn:
        kinds, _, early = zip(*map(at, drawn), strict=True)
        met = ", ".join(f"{kind or 'not known'} {count}" for kind, count in Counter(kinds).items())
        late = sum(map(bool, early))
        found[MOTIONS] = f"{met}; the mean reads the start at {late} of them"
    return found


def _judged(design: Design, numbers: dataset.Numbers) -> Iterator[tuple[int, Settings]]:
    """The points of a fast sweep that the FMU runs again: the fastest upwards and downwards, and
    JUDGED random ones, which estimate the fast solver's error."""
    v = numbers.by_name().get("v_average", np.full(len(design), np.nan))
    known = np.flatnonzero(np.isfinite(v))
    few = np.random.default_rng(0).permutation(known)[:JUDGED].tolist()
    ends = [int(known[end(v[known])]) for end in (np.argmax, np.argmin)] if len(known) else []
    for number in sorted({*few, *ends}):
        yield number, {**design.point(number), "run.solver": "fmu"}
