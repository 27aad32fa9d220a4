"""The columns of the waveforms: the one place where each is named and described."""

from collections.abc import Iterable

from cosim.waveforms.quantities import Quantity

_FIRST = {
    "time": Quantity("s", "time"),
    "command": Quantity("V", "command voltage V1"),
    "current": Quantity("A", "current of one coil"),
    "coil_voltage": Quantity("V", "voltage of the coil"),
    "back_emf": Quantity("V", "back-EMF of the coil"),
    "z_surface": Quantity("m", "height of the surface"),
    "v_surface": Quantity("m/s", "velocity of the surface"),
    "a_surface": Quantity("m/s2", "acceleration of the surface"),
    "z_ram": Quantity("m", "height of the ram"),
    "v_ram": Quantity("m/s", "velocity of the ram"),
    "z_part": Quantity("m", "height of the part"),
    "v_part": Quantity("m/s", "velocity of the part"),
    "friction_force": Quantity("N", "friction force of the surface on the part"),
    "sticking": Quantity("1", "whether the part sticks to the surface"),
    "normal_force": Quantity("N", "normal force of the surface on the part"),
}

_SECOND = (
    "command", "current", "coil_voltage", "back_emf", "z_surface", "v_surface", "a_surface",
    "z_ram", "v_ram", "friction_force", "sticking",
)  # fmt: skip

COLUMNS: dict[str, Quantity] = _FIRST | {
    f"{name}_2": Quantity(_FIRST[name].unit, f"{_FIRST[name].text}, second surface")
    for name in _SECOND
}
"""Every column by its name, in the order of the files. Absent bodies and circuits have none.

A row at a jump (of the command, of a given surface, of the grip) holds the values just before it in
all columns; the first row is the machine at rest, without command, or a given surface's start.
"""

UNITS = {name: column.unit for name, column in COLUMNS.items()}


def about(name: str, unit: str) -> dict[str, str]:
    """A column's attributes in a dataset; signals of a scene's own FMUs have no ``long_name``."""
    return {"units": unit} | ({"long_name": COLUMNS[name].text} if name in COLUMNS else {})


def netcdf_name(name: str) -> str:
    """The nearest name for netCDF: no slash, no space at the end; first a letter, digit or _."""
    return ("" if name[:1].isalnum() else "_") + name.replace("/", "|").rstrip(" ")


def netcdf_names(names: Iterable[str]) -> dict[str, str]:
    """A different :func:`netcdf_name` for each name; valid names remain as they are."""
    taken: dict[str, str] = {}
    for name in sorted(names, key=lambda each: netcdf_name(each) != each):
        valid = netcdf_name(name)
        while valid in taken:
            valid += "_2"
        taken[valid] = name
    return {name: valid for valid, name in taken.items()}
