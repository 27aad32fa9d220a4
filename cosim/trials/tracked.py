"""Tracked trials: heights and velocities of surface, part and spring-loaded plate from a video.

A velocity that is missing, or its whole column, is made by central differences, as Tracker does.
"""

import os
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, Note, plain
from cosim.trials.camera import velocities
from cosim.trials.flaws import flaws
from cosim.trials.table import FEWEST_ROWS, read_table

LONGEST_NAME = 100
"""Most bytes of a trial's file name, which names of other files and scenes contain."""


@dataclass(frozen=True)
class Track:
    """Vertical motion of one body: height, m, and velocity, m/s; NaN where unknown."""

    z: Array
    v: Array


@dataclass(frozen=True)
class Trial:
    """One tracked trial."""

    name: str
    time: Array  # s
    platform: Track
    part: Track
    plate: Track | None


def read_folder(folder: Path, apart: Path | None = None) -> list[Trial]:
    """All trials of a folder but the file ``apart``, in the order of their numbers."""
    return [read(path) for path in trial_files(folder, apart)]


def number_of(path: Path) -> int | None:
    """The last whole number in a file's name."""
    numbers = re.findall(r"\d+", path.stem)
    return int(numbers[-1]) if numbers else None


def trial_files(folder: Path, apart: Path | None = None) -> list[Path]:
    """The trials' files in the order of their numbers; BadInput where there are none.

    Where files have “trial” in their names only these count, else all ``.csv`` and ``.txt`` but
    the file ``apart``. Broken links and folders stay in the list, so that reading them fails: no
    trial may be left out in silence.
    """
    name = plain(folder)
    try:
        found = sorted(folder.iterdir())
    except OSError as error:
        raise BadInput(f"{name}: cannot be read ({error.strerror}).") from error
    except ValueError:  # a NUL in the path
        raise BadInput(f"{name}: it is no possible file name.") from None
    files = [path for path in found if path.suffix.lower() in (".csv", ".txt")]
    files = [path for path in files if not path.name.startswith(".")]
    files = [path for path in files if apart is None or path.resolve() != apart.resolve()]
    files = [path for path in files if "trial" in path.name.lower()] or files
    if not files:
        raise BadInput(f"{name}: there are no trials (.csv or .txt) in this folder.")
    stems: set[str] = set()
    for path in files:  # their names occur in tables, figures and names of other files
        if not path.name.isprintable() or len(os.fsencode(path.name)) > LONGEST_NAME:
            words = f"must be printable and have at most {LONGEST_NAME} bytes; rename it"
            raise BadInput(f"{plain(path)}: the name of a trial {words}.")
        if path.stem in stems:
            raise BadInput(f"{name}: two trials are called {path.stem}; rename one of them.")
        stems.add(path.stem)
    return sorted(files, key=lambda p: (number_of(p) is None, number_of(p) or 0, p.stem))


def read(path: Path) -> Trial:
    """One trial, with the rows in which surface and part are known; times need not be even. Raises
    BadInput, with file, row and column, for errors, and warns by a ``Note`` of probable flaws."""
    table = read_table(path)
    for name, letters in (("time", "t"), ("z_surface", "zp"), ("z_part", "zo")):
        if name not in table.columns:
            found = ", ".join(table.headers.values())
            raise BadInput(f"{plain(path)}: there is no column {letters} (found: {found}).")
    known = np.isfinite(table.columns["z_surface"] + table.columns["z_part"])
    if known.sum() < FEWEST_ROWS:
        raise BadInput(
            f"{plain(path)}: {known.sum()} rows have both zp and zo, and {FEWEST_ROWS} are needed."
        )
    columns = {name: values[known] for name, values in table.columns.items()}
    for sentence in (*table.notes, *flaws(columns["time"], columns, table.headers)):
        warnings.warn(f"{plain(path)}: {sentence}", Note, stacklevel=2)
    platform, part = track(columns, "surface"), track(columns, "part")
    plate = track(columns, "plate") if "z_plate" in columns else None
    return Trial(path.stem, columns["time"], platform, part, plate)


def read_platform(path: Path) -> tuple[Array, Track]:
    """Times (s) and motion of the surface, of a file that needs no part. Raises BadInput."""
    table, name = read_table(path), plain(path)
    found = ", ".join(table.headers.values())
    if "time" not in table.columns:
        raise BadInput(f"{name}: there is no column with the time (found: {found}).")
    if not {"z_surface", "v_surface"} & set(table.columns):
        raise BadInput(f"{name}: there is no column with the surface's motion (found: {found}).")
    platform = track(table.columns, "surface")
    if np.isfinite(platform.v).sum() < 2:
        raise BadInput(f"{name}: fewer than two velocities of the surface are known.")
    return table.columns["time"], platform


def track(columns: dict[str, Array], body: str) -> Track:
    """The motion of a body (a value of ``BODIES``) from columns that include ``time``; velocities
    that are missing are differences of the heights."""
    time = columns["time"]
    nothing = np.full(len(time), np.nan)
    z, v = (columns.get(f"{quantity}_{body}", nothing) for quantity in ("z", "v"))
    return Track(z, np.where(np.isnan(v), velocities(time, z), v))
