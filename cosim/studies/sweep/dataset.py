"""The result of a sweep as a labelled dataset, and as netCDF."""

from collections import Counter
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import numpy as np
import xarray as xr

from cosim.files.atomic import whole
from cosim.scene import Scene, firmware, keys, to_toml
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

    The dimensions of a grid are the keys; a sample has the dimension ``point``, along which the
    keys vary. A key is named without its table (:func:`_names`), and its coordinate has its unit,
    its meaning and, as ``key``, its ``table.key``. Beside a knob stands what it stands for. NaN
    stands for a point that failed, is still to be run, or has no such number. SI units.
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
    axes = _names(design, {*names, FAILURE, POINT})
    dims = tuple(axes) if design.sample is None else (POINT,)
    coordinates = {}
    for k, (name, axis) in enumerate(zip(axes, design.axes, strict=True)):
        key = axis.key
        about = {"units": key.unit, "long_name": key.text, "key": key.full}
        if design.sample is not None:
            coordinates[name] = (POINT, [row[k] for row in design.sample], about)
        else:
            coordinates[name] = (name, list(axis.values), about)
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
    data = xr.Dataset(variables, coordinates, attributes)
    return data.assign_coords(_meant(scene, data))


def _names(design: Design, taken: set[str]) -> list[str]:
    """A name for each axis that can be typed: ``key``, or ``table_key`` where that is taken."""
    keys = [axis.key for axis in design.axes]
    bare = Counter(key.name for key in keys)
    return [
        f"{key.table}_{key.name}"
        if bare[key.name] > 1 or key.name in taken or hasattr(xr.Dataset, key.name)
        else key.name
        for key in keys
    ]


def swept(data: xr.Dataset) -> list[str]:
    """Names of the coordinates that a sweep went over, in order."""
    return [str(name) for name in data.coords if "key" in data[name].attrs]


def _meant(scene: Scene, data: xr.Dataset) -> dict[str, xr.DataArray]:
    """What the knobs that are swept stand for: ``amplitude``, ``frequency``, ``offset``."""
    axes = {data[name].attrs["key"].removeprefix("drive."): data[name] for name in swept(data)}
    found: dict[str, xr.DataArray] = {}
    if "pot_max" in axes:
        found["amplitude"] = xr.apply_ufunc(
            firmware.knob_amplitude, axes["pot_max"], vectorize=True
        )
    if "pot_frequency" in axes:
        found["frequency"] = xr.apply_ufunc(
            firmware.knob_frequency, axes["pot_frequency"], vectorize=True
        )
    if "pot_offset" in axes:
        amplitude = found.get("amplitude", axes.get("amplitude", scene.drive.amplitude))
        found["offset"] = xr.apply_ufunc(
            firmware.knob_offset, axes["pot_offset"], amplitude, vectorize=True
        )
    about = {key.name: {"units": key.unit, "long_name": key.text} for key in keys()}
    for name, values in found.items():
        values.attrs = about[name]
    return {name: values for name, values in found.items() if name not in axes}


def write(path: Path, data: xr.Dataset) -> None:
    """NetCDF (classic format): equal data give equal bytes."""
    content = data.to_netcdf(engine="scipy")
    with whole(path) as temporary:
        temporary.write_bytes(bytes(content))


def read(path: Path) -> xr.Dataset:
    """A dataset that :func:`write` wrote."""
    return xr.load_dataset(BytesIO(path.read_bytes()), engine="scipy")
