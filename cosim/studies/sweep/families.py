"""Families of waveforms: those of every point of a sweep, a file each beside its numbers."""

from collections.abc import Sequence
from pathlib import Path

from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import in_whole_periods
from cosim.files.atomic import whole
from cosim.scene import Scene, changed
from cosim.studies.sweep.design import Design
from cosim.toolchain.processes import Progress
from cosim.waveforms.storage import netcdf


def keep(
    folder: Path,
    scene: Scene,
    design: Design,
    names: Sequence[str],
    points: Sequence[int],
    bench: Evaluator,
) -> None:
    """Run ``points`` once more, here, and write their waveforms ``names`` from ``run.settle`` on,
    each point's as ``NUMBER.nc``. Raises CosimError."""
    from cosim.simulation.simulate import simulate

    def kept(_: Scene, number: int, progress: Progress) -> None:
        of = changed(scene, design.point(number), "--over")  # the bench's own has no rows
        if design.changes_frequency:
            of = in_whole_periods(of)
        result = simulate(of, progress)
        if unknown := [name for name in names if name not in result.columns]:
            known = ", ".join(result.columns)
            raise BadInput(f'--keep: the runs have no "{plain(unknown[0])}" (they have {known}).')
        later = result.columns["time"] >= of.run.settle
        columns = {name: result.columns[name][later] for name in ("time", *names)}
        with whole(folder / f"{number}.nc") as temporary, temporary.open("wb") as file:
            netcdf(file, columns, result.units, {"frequency": repr(1.0 / of.period)})

    for _, failed in bench.apply(kept, points):
        if isinstance(failed, Exception):
            raise failed
