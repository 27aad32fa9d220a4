"""The result of a sweep as a labelled dataset, and as netCDF."""

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import numpy as np
import xarray as xr

from cosim.files.atomic import whole
from cosim.scene import Scene, to_toml
from cosim.simulation.summary import UNITS
from cosim.studies.sweep.design import Design
from cosim.studies.sweep.point import Outcome

FAILURE = "failure"
"""The variable that says why a point failed; empty where it did not."""

POINT = "point"
"""The dimension of a sample."""


def dataset(
    scene: Scene, design: Design, outcomes: Iterable[tuple[int, Outcome]], versions: dict[str, str]
) -> xr.Dataset:
    """The numbers of each point's summary over the keys of the sweep, with their units.

    The dimensions of a grid are the keys, ``table.key``; a sample has the dimension ``point``,
    along which the keys vary. NaN stands for a point that failed, is still to be run, or has no
    such number. SI units.
    """
    names: dict[str, None] = {}
    found: list[tuple[int, Outcome]] = sorted(outcomes, key=lambda pair: pair[0])
    for _, outcome in found:
        names.update(dict.fromkeys(outcome.numbers))
    numbers = np.full((len(names), len(design)), np.nan)
    failures = np.full(len(design), "", dtype=object)
    places = {name: k for k, name in enumerate(names)}
    for index, outcome in found:
        failures[index] = outcome.failure
        for name, value in outcome.numbers.items():
            numbers[places[name], index] = value
    dims = (POINT,) if design.sample is not None else tuple(a.key.full for a in design.axes)
    coordinates = {}
    for k, axis in enumerate(design.axes):
        about = {"units": axis.key.unit, "long_name": axis.key.text}
        if design.sample is not None:
            coordinates[axis.key.full] = (POINT, [row[k] for row in design.sample], about)
        else:
            coordinates[axis.key.full] = (axis.key.full, list(axis.values), about)
    variables = {
        name: (dims, numbers[k].reshape(design.shape), {"units": UNITS.get(name, "1")})
        for name, k in places.items()
    }
    variables[FAILURE] = (
        dims,
        failures.astype(str).reshape(design.shape),
        {"long_name": "Why the point failed; empty where it did not"},
    )
    attributes = {
        "title": f"Sweep of {scene.name}",
        "scene": to_toml(scene),
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
    }
    return xr.Dataset(variables, coordinates, attributes)


def write(path: Path, data: xr.Dataset) -> None:
    """NetCDF (classic format): equal data give equal bytes."""
    content = data.to_netcdf(engine="scipy")
    with whole(path) as temporary:
        temporary.write_bytes(bytes(content))


def read(path: Path) -> xr.Dataset:
    """A dataset that :func:`write` wrote."""
    return xr.load_dataset(BytesIO(path.read_bytes()), engine="scipy")
