"""The result of a sweep as a labelled dataset, and as netCDF."""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from fmpy import read_model_description

from cosim.arrays import Array
from cosim.circuit.joined import unit
from cosim.evaluate.point import Outcome
from cosim.files.atomic import together
from cosim.mechanics import fmi
from cosim.mechanics.package import unpacked
from cosim.scene import KEYS, Scene, firmware, to_toml
from cosim.scene.tables import MACHINE
from cosim.studies.sweep.design import Design
from cosim.waveforms.columns import netcdf_name, netcdf_names
from cosim.waveforms.quantities import meaning
from cosim.waveforms.report import asked_for
from cosim.waveforms.storage import renamed, swept

FAILURE = "failure"
"""The variable that says why a point failed; empty where it did not."""

JUDGED = "v_average_fmu"
"""The variable with the FMU's v_average, at those points of a fast sweep that it ran again."""
_JUDGED = {"units": "m/s", "long_name": "v_average by the FMU, where it judged the fast solver"}

POINT = "point"
"""The dataset's dimension where the points are a sample, not a grid."""


class Numbers:
    """The summaries of ``count`` points, an array for each number's name, and why some failed."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._values: dict[str, Array] = {}
        self._first: dict[tuple[str, ...], int] = {}  # least index of a point with these names
        self.failures = np.full(count, "", dtype=object)
        self.failed = 0

    def add(self, index: int, outcome: Outcome) -> None:
        """Enter the outcome of a point that has been run, or run again."""
        self.failed += bool(outcome.failure) - bool(self.failures[index])
        self.failures[index] = outcome.failure
        values, names = self._values, tuple(outcome.numbers)
        if index <= self._first.get(names, index):
            self._first[names] = index
        for name, value in outcome.numbers.items():
            if name not in values:
                values[name] = np.full(self._count, np.nan)
            values[name][index] = value

    def judge(self, index: int, outcome: Outcome) -> None:
        """Enter the FMU's v_average of a point that the fast solver has run."""
        values = self._values.setdefault(JUDGED, np.full(self._count, np.nan))
        values[index] = outcome.numbers.get("v_average", np.nan)

    def by_name(self) -> dict[str, Array]:
        """For each name an array over the points, NaN where a point lacks the number. The order of
        names follows the points' indices, whatever the order in which they ran."""
        order = sorted(self._first, key=lambda names: self._first[names])
        found = {name: self._values[name] for names in order for name in names}
        return found | {name: self._values[name] for name in (JUDGED,) if name in self._values}


def dataset(
    scene: Scene, design: Design, found: Numbers, versions: dict[str, str], units: Mapping[str, str]
) -> xr.Dataset:
    """The numbers of each point's summary over the keys of the sweep, with their units.

    A key's coordinate (:func:`_names`) has its unit, its meaning and, as ``key``, its
    ``table.key``; a swept knob has a second one, of the amplitude, frequency or offset that it
    sets. NaN stands for a point that failed, is still to be run, or has no such number. SI units;
    ``units`` are :func:`units_of` the scene.
    """
    numbers = found.by_name()
    if scene.has_ports:  # what ports join and save keeps is shown first
        asked = asked_for(scene)
        first = sorted(numbers, key=lambda name: name.rpartition(".")[0] not in asked)
        numbers = {name: numbers[name] for name in first}
    axes = _names(design, {*numbers, FAILURE, POINT})
    dims = tuple(axes) if design.sample is None else (POINT,)
    columns = [list(axis.values) for axis in design.axes]
    if design.sample is not None:
        columns = [list(column) for column in zip(*design.sample, strict=True)]
    coordinates, variables = {}, {}
    for name, column, axis in zip(axes, columns, design.axes, strict=True):
        about = {"units": axis.key.unit, "long_name": axis.key.title, "key": axis.key.full}
        coordinates[name] = (name if design.sample is None else POINT, column, about)
    names = netcdf_names(numbers)
    for name, values in numbers.items():
        about = _JUDGED if name == JUDGED else meaning(name, units)
        variables[names[name]] = (dims, values.reshape(design.shape), about)
    about = {"long_name": "Why the point failed; empty where it did not"}
    variables[FAILURE] = (dims, found.failures.astype(str).reshape(design.shape), about)
    attributes = {
        "title": f"Sweep of {scene.name}",
        "scene": to_toml(scene),
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
    }
    data = xr.Dataset(variables, coordinates, attributes)
    return data.assign_coords(_meant(scene, data))


def units_of(scene: Scene) -> dict[str, str]:
    """The units of the signals of a scene with ports, by the signals' names; signals of an FMU
    whose description cannot be read are left out."""
    files = {each.name: each.file for each in scene.fmu}
    ends = [str(end) for port in scene.port for end in (port.origin, port.to)]
    if any(end.startswith(f"{MACHINE}.") for end in ends):
        files[MACHINE] = str(unpacked(2))
    sources = [port.source for port in scene.port if port.source is not None]
    found = {name: {"v": "V", "i": "A"}.get(name[:1].lower(), "?") for name in sources}
    for name, file in files.items():
        with suppress(Exception):  # a broken FMU is reported by its runs
            for each in read_model_description(file, validate=False).modelVariables:
                found[f"{name}.{each.name}"] = fmi.unit(each)
    words = [port.probe for port in scene.port if port.probe is not None]
    found |= {each: unit(each) for each in (*words, *(scene.circuit.save or ()))}
    return found


def _names(design: Design, taken: set[str]) -> list[str]:
    """A name for each axis: ``key``, or ``table_key`` where that is taken, as by an attribute."""
    keys = [axis.key for axis in design.axes]
    bare = Counter(key.name for key in keys)
    return [
        netcdf_name(
            f"{key.table}_{key.name}"
            if bare[key.name] > 1 or key.name in taken or hasattr(xr.Dataset, key.name)
            else key.name
        )
        for key in keys
    ]


def _meant(scene: Scene, data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Coordinates ``amplitude``, ``frequency``, ``offset``: what the swept knobs set."""
    axes = {data[name].attrs["key"].removeprefix("drive."): data[name] for name in swept(data)}
    found: dict[str, xr.DataArray] = {}

    def add(name: str, meaning: Callable[..., float], knob: str, *others: Any) -> None:
        if knob in axes:
            found[name] = xr.apply_ufunc(meaning, axes[knob], *others, vectorize=True)

    add("amplitude", firmware.knob_amplitude, "pot_max")
    add("frequency", firmware.knob_frequency, "pot_frequency")
    amplitude = found.get("amplitude", axes.get("amplitude", scene.drive.amplitude))
    add("offset", firmware.knob_offset, "pot_offset", amplitude)
    for name, values in found.items():
        key = KEYS[f"drive.{name}"]
        values.attrs = {"units": key.unit, "long_name": key.title}
    return {name: values for name, values in found.items() if name not in axes}


def write(path: Path, data: xr.Dataset, figure: Path) -> None:
    """NetCDF (classic format): equal data give equal bytes. Removes the outdated ``figure``."""
    # The writer encodes names as Latin-1; names decoded so from UTF-8 arrive as UTF-8 in the file.
    written = renamed(data, lambda name: name.encode().decode("latin-1"))
    content = written.to_netcdf(engine="scipy")
    with together([path], outdated=[figure]) as (temporary,):
        temporary.write_bytes(bytes(content))
