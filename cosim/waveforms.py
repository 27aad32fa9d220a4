"""Waveforms as files: CSV and netCDF, each written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import BadInput

Array = npt.NDArray[np.float64]


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends well."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
        os.close(handle)
        os.chmod(name, 0o666 & ~_umask())
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}).") from error
    temporary = Path(name)
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}).") from error
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_csv(path: Path, waveforms: dict[str, Array], units: dict[str, str]) -> None:
    """Comma-separated values: a header row ``name [unit]``, then a row for each time."""
    content = csv_content(waveforms, units)
    with whole(path) as temporary:
        temporary.write_bytes(content)


def csv_content(waveforms: dict[str, Array], units: dict[str, str]) -> bytes:
    """What :func:`write_csv` writes."""
    header = ",".join(f"{name} [{units[name]}]" for name in waveforms)
    table = np.column_stack(list(waveforms.values()))
    content = BytesIO()
    np.savetxt(
        content, table, fmt="%.10g", delimiter=",", header=header, comments="", encoding="utf-8"
    )
    return content.getvalue()


def read_csv(path: Path) -> dict[str, Array]:
    """The columns of a file that :func:`write_csv` wrote, by name, without their units."""
    try:
        with open(path, encoding="utf-8") as file:
            names = [cell.partition(" [")[0] for cell in file.readline().strip().split(",")]
            table = np.loadtxt(file, delimiter=",", ndmin=2)
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}).") from None
    except ValueError as error:
        raise BadInput(f"{path}: this is not a waveforms.csv ({error}).") from None
    if table.shape[1] != len(names):
        raise BadInput(f"{path}: the header has {len(names)} names for {table.shape[1]} columns.")
    return dict(zip(names, table.T, strict=True))


def write_netcdf(
    path: Path, waveforms: dict[str, Array], units: dict[str, str], attributes: dict[str, str]
) -> None:
    """NetCDF (classic format) with the dimension ``time``; each variable has its ``units``."""
    # By way of memory: scipy's file tries again, and complains, when a full disk has failed it.
    content = netcdf_content(waveforms, units, attributes)
    with whole(path) as temporary:
        temporary.write_bytes(content)


def netcdf_content(
    waveforms: dict[str, Array], units: dict[str, str], attributes: dict[str, str]
) -> bytes:
    """What :func:`write_netcdf` writes."""
    from scipy.io import netcdf_file

    content = BytesIO()
    with netcdf_file(content, "w", version=2) as file:
        for name, text in attributes.items():
            setattr(file, name, text.encode())  # as text, scipy takes ASCII only
        file.createDimension("time", len(waveforms["time"]))
        for name, values in waveforms.items():
            variable = file.createVariable(name, "f8", ("time",))
            variable[:] = values
            variable.units = units[name]
        file.flush()
        return content.getvalue()


def read_netcdf(path: Path) -> tuple[dict[str, Array], dict[str, str], dict[str, str]]:
    """Waveforms, their units, and the attributes of a file that :func:`write_netcdf` wrote."""
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, mmap=False) as file:
            columns = {name: variable[:] for name, variable in file.variables.items()}
            units = {name: _text(variable.units) for name, variable in file.variables.items()}
            attributes = {name: _text(value) for name, value in file._attributes.items()}
        for name, values in columns.items():
            if not name.isidentifier() or values.dtype != ">f8" or values.ndim != 1:
                raise ValueError(f"{name!r} is not a column")
            if len(values) != len(columns["time"]) or not np.isfinite(values).all():
                raise ValueError(f"{name!r} is not complete")
        if len(columns["time"]) < 2 or np.any(np.diff(columns["time"]) <= 0):
            raise ValueError("the time does not increase")
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}).") from None
    except Exception as error:  # there is little that scipy does not raise on a damaged file
        raise BadInput(f"{path}: this is not a whole waveforms.nc ({error}).") from None
    return {name: np.array(v, dtype=np.float64) for name, v in columns.items()}, units, attributes


def _text(value: object) -> str:
    if not isinstance(value, bytes):
        raise ValueError(f"{value!r} is not text")
    return value.decode()
