"""Reading tracked trials: heights and velocities of surface, part and springed plate from a video.

Two forms are read, with commas, semicolons or tabs between the cells:

- a table with the columns ``t, zp, vzp, azp, zo, vzo, azo, zs, vzs, azs`` (p the platform, that is
  the surface; o the part; s the springed plate) among others, as the published trials have them;
- what Tracker (physlets.org/tracker) exports for several tracks: lines that begin with ``#``, a
  line with the tracks' names, and a line ``t x y v_{y} …`` with their columns; y is the height.

Times are in s and lengths in mm. Empty cells, ``nan``, ``?`` and U+FFFD (Tracker's mark for a
missing value, in an encoding that was lost) stand for no value. A velocity that is missing, or its
whole column, is made by central differences, as Tracker does.
"""

import math
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput

MISSING = {"", "nan", "?"}  # once U+FFFD is gone
TRACKS = {
    "p": ("p", "platform", "surface"),
    "o": ("o", "part", "object"),
    "s": ("s", "spring", "springed plate", "spring plate"),
}
Rows = list[tuple[int, list[str]]]
"""Rows of cells with their line numbers in the file."""
QUANTITIES = {"y": "z", "z": "z", "vy": "vz", "vz": "vz", "ay": "az", "az": "az"}
FEWEST_ROWS = 8
MM = 1e-3  # m
LARGEST_FILE = 50_000_000  # bytes


@dataclass(frozen=True)
class Track:
    """Vertical motion of one body: m, m/s, m/s²; NaN where nothing is known."""

    z: Array
    v: Array
    a: Array
    v_across: Array
    """Horizontal velocity, m/s."""


@dataclass(frozen=True)
class Trial:
    """One tracked trial; ``number`` is the last whole number in its file's name."""

    name: str
    number: int | None
    time: Array  # s
    platform: Track
    part: Track
    plate: Track | None


def read_folder(folder: Path) -> list[Trial]:
    """All trials of a folder, in the order of their numbers.

    Where files have “trial” in their names only these are read, else all ``.csv`` and ``.txt``.
    """
    try:
        found = sorted(folder.iterdir())
    except OSError as error:
        raise BadInput(f"{folder}: cannot be read ({error.strerror}).") from error
    files = [path for path in found if path.suffix.lower() in (".csv", ".txt")]
    files = [path for path in files if path.is_file() and not path.name.startswith(".")]
    files = [path for path in files if "trial" in path.name.lower()] or files
    if not files:
        raise BadInput(f"{folder}: there are no trials (.csv or .txt) in this folder.")
    return sorted(map(read, files), key=lambda t: (t.number is None, t.number or 0, t.name))


def read(path: Path) -> Trial:
    """One trial. Raises BadInput, with file, row and column, for what is wrong with it."""
    lines = [(n, line) for n, line in enumerate(_text(path).splitlines(), 1) if line.strip()]
    tracker = any(line.startswith("#") for _, line in lines)
    lines = [(n, line) for n, line in lines if not line.startswith("#")]
    if not lines:
        raise BadInput(f"{path}: this file holds no table.")
    separator = next((sign for sign in "\t;" if any(sign in line for _, line in lines[:2])), ",")
    table = [
        (n, [cell.strip().strip('"').strip() for cell in line.split(separator)])
        for n, line in lines
    ]
    names, rows = _header(path, table, tracker)
    width = max(len(head) for _, head in table[: len(table) - len(rows)])
    for line, cells in rows:
        if any(cells[width:]):
            raise BadInput(f"{path}: row {line}: it has {len(cells)} cells, the header {width}.")
    columns = {name: _column(path, rows, name, i, separator) for name, i in names.items()}
    for name in ("t", "zp", "zo"):
        if name not in columns:
            found = ", ".join(names) or "none"
            raise BadInput(f"{path}: there is no column {name} (found: {found}).")
        missing = np.flatnonzero(np.isnan(columns[name]))
        if len(missing):
            row = rows[missing[0]][0]
            raise BadInput(f"{path}: row {row}, column {name}: the value is missing.")
    if len(rows) < FEWEST_ROWS:
        raise BadInput(f"{path}: there are {len(rows)} rows, and {FEWEST_ROWS} are needed.")
    time = columns["t"]
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        raise BadInput(f"{path}: row {rows[late[0] + 1][0]}, column t: the time does not increase.")
    numbers = re.findall(r"\d+", path.stem)
    platform, part = (_track(columns, body) for body in "po")
    plate = _track(columns, "s") if "zs" in columns else None
    return Trial(path.stem, int(numbers[-1]) if numbers else None, time, platform, part, plate)


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise BadInput(f"{path}: this file is too large for a trial.")
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}).") from error
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    return data.decode("utf-8-sig", errors="replace")  # what is no UTF-8 becomes U+FFFD: missing


def _header(path: Path, table: Rows, tracker: bool) -> tuple[dict[str, int], Rows]:
    """The place of each known column, and the rows below the header."""
    head = table[0][1]
    if "t" in head:
        names = [_plain(cell) for cell in head]
        below = table[1:]
    elif len(table) > 1 and table[1][1][0] == "t":
        names = _tracker_names(path, *table[0], table[1][1])
        below = table[2:]
    else:
        what = "a header with the column t" if not tracker else "a header t x y … of Tracker's"
        raise BadInput(f"{path}: row {table[0][0]}: {what} is missing.")
    known = {"t", *(f"{quantity}{body}" for quantity in ("z", "vz", "az", "vx") for body in "pos")}
    places: dict[str, int] = {}
    for i, name in enumerate(names):
        if name in places:
            raise BadInput(f"{path}: row {table[0][0]}: the column {name} stands there twice.")
        if name in known:
            places[name] = i
    return places, below


def _plain(name: str) -> str:
    """Tracker's v_{y} as vy; a unit in brackets is dropped."""
    return re.sub(r"\[.*\]|[_{}\s]", "", name)


def _tracker_names(path: Path, line: int, tracks: list[str], head: list[str]) -> list[str]:
    """Names as in the first form, from the line with the tracks and the line with t x y t x y."""
    track, found = "", []
    for cell, quantity in zip_longest(tracks[: len(head)], map(_plain, head), fillvalue=""):
        track = cell or track
        if quantity == "t":
            found.append("t" if "t" not in found else "")
            continue
        body = next((b for b, words in TRACKS.items() if track.lower() in words), None)
        known = body and QUANTITIES.get(quantity)
        found.append(f"{known}{body}" if known else "")
    if not {"zp", "zo"} <= set(found):
        named = ", ".join(filter(None, tracks)) or "none"
        raise BadInput(
            f"{path}: row {line}: the tracks platform and part are needed with their heights y "
            f"(found: {named})."
        )
    # The others are skipped, but must differ from each other.
    return [name or f"({i})" for i, name in enumerate(found)]


def _column(path: Path, rows: Rows, name: str, place: int, separator: str) -> Array:
    values = np.full(len(rows), np.nan)
    for i, (line, cells) in enumerate(rows):
        where = f"{path}: row {line}, column {name}"
        if place >= len(cells):
            raise BadInput(f"{where}: the row ends before it, after {len(cells)} cells.")
        text = cells[place]
        if text.strip("\ufffd").lower() in MISSING:
            continue
        try:
            if "_" in text:  # which Python would take
                raise ValueError
            values[i] = float(text if separator == "," else text.replace(",", "."))
        except ValueError:
            raise BadInput(f"{where}: “{text[:40]}” is not a number.") from None
        if not math.isfinite(values[i]):
            raise BadInput(f"{where}: “{text[:40]}” is not finite.")
    return values


def _track(columns: dict[str, Array], body: str) -> Track:
    time = columns["t"]
    nothing = np.full(len(time), np.nan)
    z, v, a, v_across = (
        columns.get(f"{quantity}{body}", nothing) * MM for quantity in ("z", "vz", "az", "vx")
    )
    central = nothing.copy()
    central[1:-1] = (z[2:] - z[:-2]) / (time[2:] - time[:-2])
    return Track(z, np.where(np.isnan(v), central, v), a, v_across)
