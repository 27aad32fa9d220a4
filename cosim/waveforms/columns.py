"""The columns of the waveforms: the one place where each is named and described."""

from collections.abc import Iterable
from typing import NamedTuple


class Column(NamedTuple):
    """What a column holds: its SI unit, and its name in words."""

    unit: str
    long_name: str


_FIRST = {
    "time": Column("s", "time"),
    "command": Column("V", "command voltage V1"),
    "current": Column("A", "current of one coil"),
    "coil_voltage": Column("V", "voltage of the coil"),
    "back_emf": Column("V", "back-EMF of the coil"),
    "z_surface": Column("m", "height of the surface"),
    "v_surface": Column("m/s", "velocity of the surface"),
    "a_surface": Column("m/s2", "acceleration of the surface"),
    "z_ram": Column("m", "height of the ram"),
    "v_ram": Column("m/s", "velocity of the ram"),
    "z_part": Column("m", "height of the part"),
    "v_part": Column("m/s", "velocity of the part"),
    "friction_force": Column("N", "friction force of the surface on the part"),
    "sticking": Column("1", "whether the part sticks to the surface"),
    "normal_force": Column("N", "normal force of the surface on the part"),
}

_SECOND = (
    "command", "current", "coil_voltage", "back_emf", "z_surface", "v_surface", "a_surface",
    "z_ram", "v_ram", "friction_force", "sticking",
)  # fmt: skip

COLUMNS: dict[str, Column] = _FIRST | {
    f"{name}_2": Column(_FIRST[name].unit, f"{_FIRST[name].long_name}, second surface")
    for name in _SECOND
}
"""Every column by its name, in the order of the files. Absent participants have none.

A row at a jump (of the command, of a given surface, of the grip) holds in all columns what is just
before it; the first row is the machine at rest, without command, or a given surface's start.
"""

UNITS = {name: column.unit for name, column in COLUMNS.items()}


def about(name: str, unit: str) -> dict[str, str]:
    """A column's attributes in a dataset; one of a scene's own FMUs has no words but its name."""
    return {"units": unit} | ({"long_name": COLUMNS[name].long_name} if name in COLUMNS else {})


def netcdf_name(name: str) -> str:
    """A name as netCDF can have it: without a slash, without a space at its end, and with a letter,
    digit or _ first."""
    return ("" if name[:1].isalnum() else "_") + name.replace("/", "|").rstrip(" ")


def netcdf_names(names: Iterable[str]) -> dict[str, str]:
    """For each name one of :func:`netcdf_name`, none of them twice; whose own it is keeps it."""
    taken: dict[str, str] = {}
    for name in sorted(names, key=lambda each: netcdf_name(each) != each):
        one = netcdf_name(name)
        while one in taken:
            one += "_2"
        taken[one] = name
    return {name: one for one, name in taken.items()}
