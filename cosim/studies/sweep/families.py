"""Families of waveforms: those of every point of a sweep, kept beside its numbers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import periods_made_whole
from cosim.files.atomic import whole
from cosim.scene import Scene, changed
from cosim.studies.sweep.design import Design
from cosim.toolchain.processes import Progress
from cosim.waveforms.columns import netcdf_name

FILE = "families.nc"
MOST = 20_000_000
"""Numbers of a file, 160 MB."""


def parse(text: str | list[str]) -> list[str]:
    """The names of ``--keep``; none where it was not given."""
    return [name.strip() for name in text.split(",")] if isinstance(text, str) else []


def check(scene: Scene, design: Design, names: Sequence[str]) -> None:
    """Raise BadInput where there would be too much to keep."""
    rows = (scene.run.duration - scene.run.settle) / scene.run.output_step
    count = int(len(design) * rows * (1 + len(names)))
    if count > MOST:
        raise BadInput(
            f"--keep: this is about {count} numbers; it may be {MOST}: take fewer points, or a "
            "larger run.output_step."
        )


def keep(
    path: Path,
    scene: Scene,
    design: Design,
    names: Sequence[str],
    points: Sequence[int],
    bench: Evaluator,
) -> None:
    """Run ``points`` of a sweep once more, and keep the waveforms ``names`` from ``run.settle`` on:
    a netCDF with the dimensions ``point``, the point's number, and ``row``, with NaN at the end of
    shorter runs, and the frequency of each point's drive. Raises CosimError."""
    from cosim.simulation.simulate import simulate

    def kept_of(number: int, progress: Progress) -> tuple[float, list[Array], list[str]]:
        of = changed(scene, design.point(number), "--over")
        if design.changes_frequency:
            of = changed(of, periods_made_whole(of), "--over")
        result = simulate(of, progress)
        if unknown := [name for name in names if name not in result.columns]:
            known = ", ".join(result.columns)
            raise BadInput(f'--keep: the runs have no "{plain(unknown[0])}" (they have {known}).')
        later = result.columns["time"] >= of.run.settle
        columns = [result.columns[name][later] for name in ("time", *names)]
        return 1.0 / of.period, columns, [result.units[name] for name in ("time", *names)]

    found: dict[int, tuple[float, list[Array], list[str]]] = {}
    for number, one in bench.apply(kept_of, ((n, n) for n in points)):
        if isinstance(one, Exception):
            raise one
        found[number] = one
    longest = max(len(columns[0]) for _, columns, _ in found.values())
    kept = np.full((1 + len(names), len(points), longest), np.nan)
    for place, number in enumerate(points):
        for k, values in enumerate(found[number][1]):
            kept[k, place, : len(values)] = values
    units = found[points[0]][2]
    variables = {
        netcdf_name(name): (("point", "row"), values, {"units": unit})
        for name, values, unit in zip(("time", *names), kept, units, strict=True)
    }
    frequencies = [found[number][0] for number in points]
    data = xr.Dataset(variables, {"point": list(points)})
    data["frequency"] = ("point", frequencies, {"units": "Hz"})
    content = data.to_netcdf(engine="scipy")
    with whole(path) as temporary:
        temporary.write_bytes(bytes(content))
