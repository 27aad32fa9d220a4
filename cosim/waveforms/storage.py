"""Waveforms as files: CSV and netCDF, each written whole or not at all."""

from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from struct import pack
from typing import IO, TYPE_CHECKING

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files import reader
from cosim.files.atomic import whole
from cosim.files.reader import opened
from cosim.files.spill import blocks
from cosim.waveforms.columns import about, netcdf_names

if TYPE_CHECKING:
    import xarray as xr

_CSV_ROWS = 1024  # that are formatted together

LARGEST = 1 << 33
"""Bytes of the largest waveforms.nc that is read: an hour of rows, more than is ever compared."""


def write_csv(path: Path, waveforms: dict[str, Array], units: Mapping[str, str]) -> None:
    """Comma-separated values: a header row ``name [unit]``, then a row for each time."""
    with whole(path) as temporary, open(temporary, "wb") as file:
        csv(file, waveforms, units)


def csv(file: IO[bytes], waveforms: dict[str, Array], units: Mapping[str, str]) -> None:
    """What :func:`write_csv` writes, into an open file."""
    header = ",".join(_cell(f"{name} [{units[name]}]") for name in waveforms)
    file.write(f"{header}\n".encode())
    columns = list(waveforms.values())
    row = ",".join(["%.10g"] * len(columns)) + "\n"
    for part in blocks(len(columns[0])):
        for start in range(part.start, part.stop, _CSV_ROWS):
            rows = slice(start, min(start + _CSV_ROWS, part.stop))
            table = np.column_stack([values[rows] for values in columns])
            # Many rows in one go: several times as fast as numpy's savetxt.
            file.write((row * len(table) % tuple(table.ravel().tolist())).encode())


def _cell(text: str) -> str:
    """A cell, between quotation marks if it has a comma or a quotation mark."""
    return '"' + text.replace('"', '""') + '"' if set(text) & {",", '"'} else text


# Tags and types of the netCDF format.
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_CHARACTERS, _DOUBLES = 2, 6


def netcdf(
    file: IO[bytes],
    waveforms: dict[str, Array],
    units: Mapping[str, str],
    attributes: dict[str, str],
) -> None:
    """NetCDF (classic format) with the dimension ``time``; each variable has its ``units``, and a
    column of a run its ``long_name``. It is written in blocks of rows, of all columns each.

    After NetCDF Classic Format Specification, Unidata, with 64-bit offsets; scipy's writer has the
    same bytes, but needs all columns in memory.
    """
    count = len(waveforms["time"])
    head = b"CDF\x02" + pack(">i", 0)
    head += pack(">ii", _DIMENSIONS, 1) + _name("time") + pack(">i", count)
    head += _attributes(attributes) + pack(">ii", _VARIABLES, len(waveforms))
    names = netcdf_names(waveforms)
    heads = [
        # One dimension, with index 0; attributes; type; bytes. The offset follows below.
        _name(names[name]) + pack(">ii", 1, 0) + _attributes(about(name, units[name]))
        + pack(">ii", _DOUBLES, 8 * count)
        for name in waveforms
    ]  # fmt: skip
    start = len(head) + sum(len(text) + 8 for text in heads)
    starts = [start + 8 * count * k for k in range(len(waveforms))]
    for text, offset in zip(heads, starts, strict=True):
        head += text + pack(">q", offset)
    file.write(head)
    for part in blocks(count):
        for values, offset in zip(waveforms.values(), starts, strict=True):
            file.seek(offset + 8 * part.start)
            file.write(values[part].astype(">f8").tobytes())


def _name(text: str) -> bytes:
    """The length of a text, then its bytes, padded with zeros to a multiple of four."""
    content = text.encode()
    return pack(">i", len(content)) + content + b"\0" * (-len(content) % 4)


def _attributes(texts: dict[str, str]) -> bytes:
    if not texts:
        return bytes(8)
    found = pack(">ii", _ATTRIBUTES, len(texts))
    return found + b"".join(
        _name(name) + pack(">i", _CHARACTERS) + _name(text) for name, text in texts.items()
    )


def read_netcdf(path: Path) -> tuple[dict[str, Array], dict[str, str], dict[str, str]]:
    """Waveforms, their units, and the attributes of a file that :func:`netcdf` wrote."""
    from scipy.io import netcdf_file

    try:
        with opened(path, LARGEST) as content, netcdf_file(content, mmap=False) as file:
            # scipy takes a name's bytes for Latin-1.
            found = {_text(name.encode("latin-1")): each for name, each in file.variables.items()}
            columns = {name: variable[:] for name, variable in found.items()}
            units = {name: _text(variable.units) for name, variable in found.items()}
            attributes = {name: _text(value) for name, value in file._attributes.items()}
        for name, values in columns.items():
            if not (name + units[name]).isprintable():
                raise _Damaged(f"{name!r} in {units[name]!r} is not a name and a unit")
            if values.dtype != ">f8" or values.ndim != 1:
                raise _Damaged(f"{name!r} is not a column")
            if len(values) != len(columns["time"]) or not np.isfinite(values).all():
                raise _Damaged(f"{name!r} is not complete")
        if len(columns["time"]) < 2 or np.any(np.diff(columns["time"]) <= 0):
            raise _Damaged("the time does not increase")
    except (BadInput, MemoryError):
        raise
    except Exception as error:  # there is little that scipy does not raise on a damaged file
        raise BadInput(
            f"{plain(path)}: this is not a whole waveforms.nc ({_why(error)})."
        ) from None
    return {name: np.array(v, dtype=np.float64) for name, v in columns.items()}, units, attributes


class _Damaged(Exception):
    """An error in a file that scipy can read."""


def _why(error: Exception) -> str:
    return plain(error) if isinstance(error, _Damaged) else "it is damaged, or cut off"


def _text(value: object) -> str:
    if not isinstance(value, bytes):
        raise _Damaged(f"{value!r} is not text")
    text = value.decode()
    if not all(char.isprintable() or char in "\n\t" for char in text):
        raise _Damaged("a text has control characters")
    return text


def last_written(folder: Path, *names: str) -> str:
    """Which of the files ``names`` in a folder was written last; empty where there is none."""
    found = [name for name in names if (folder / name).exists()]
    return max(found, key=lambda name: (folder / name).stat().st_mtime_ns, default="")


def renamed(data: "xr.Dataset", change: Callable[[str], str]) -> "xr.Dataset":
    """A dataset with changed names: scipy reads and writes netCDF's UTF-8 names as Latin-1."""
    return data.rename({name: change(str(name)) for name in {*data.variables, *data.dims}})


def read_sweep(folder: Path) -> "xr.Dataset":
    """The dataset in a folder that ``cosim sweep`` wrote. Raises BadInput."""
    import xarray as xr

    path = folder / "sweep.nc"
    content = BytesIO(reader.read(path, LARGEST))
    try:
        data = xr.load_dataset(content, engine="scipy")
        data = renamed(data, lambda name: name.encode("latin-1").decode())
        grid, texts = {*data["failure"].dims}, [data.attrs["title"]]
        for name, each in data.variables.items():
            texts += [each.attrs.get(key, "") for key in ("units", "long_name")]
            if not grid.issuperset(each.dims):
                raise _Damaged(f"{name} has other points")
            number = each.dtype.kind in "iuf" and name != "failure"
            if not (number or all(isinstance(value, str) for value in each.values.flat)):
                raise _Damaged(f"{name} has other values")
        if not swept(data):
            raise _Damaged("it goes over no key")
        if not grid or not all(isinstance(text, str) for text in texts):
            raise _Damaged("there are no points, or no words for their numbers")
    except Exception as error:  # there is little that scipy does not raise on a damaged file
        raise BadInput(f"{plain(path)}: not a whole sweep ({_why(error)}).") from None
    return data


def swept(data: "xr.Dataset") -> list[str]:
    """Names of the coordinates that a sweep went over, in order."""
    return [str(name) for name in data.coords if "key" in data[name].attrs]
