"""Reading tables of what was measured: columns by their names and units, in SI.

Three forms are read, with commas, semicolons or tabs between the cells:

- words with units: ``time [s]``, ``velocity [mm/s]``, ``current (mA)`` and so on, see ``WORDS``;
  a word without a unit is in SI, and the table's notes say so;
- the columns ``t, zp, vzp, azp, zo, vzo, azo, zs, vzs, azs`` (p the platform, that is the
  surface; o the part; s the springed plate) among others, as the published trials have them;
- what Tracker (physlets.org/tracker) exports for several tracks: lines that begin with ``#``, a
  line with the tracks' names, and a line ``t x y v_{y} …`` with their columns; y is the height.

The last two are in s and mm where no unit is given. Empty cells, ``nan``, ``?`` and U+FFFD
(Tracker's mark for a missing value, in an encoding that was lost) stand for no value.
"""

import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files.cells import Cells, read_cells

MISSING = {"", "nan", "?"}  # once U+FFFD is gone
FEWEST_ROWS = 8

WORDS = {
    "time": ("time",),
    "z_surface": ("z_surface", "surface", "platform", "height", "position", "displacement"),
    "v_surface": ("v_surface", "velocity", "surface_velocity"),
    "z_part": ("z_part", "part", "object"),
    "v_part": ("v_part", "part_velocity"),
    "current": ("current", "coil_current"),
    "coil_voltage": ("coil_voltage", "voltage"),
    "command": ("command",),
}
"""Names that a column may have, besides those of the trials."""

UNDERSTOOD = "; ".join(" or ".join(words) for words in WORDS.values()) + (
    "; each with its unit, such as time [ms], velocity [mm/s], height [µm], current [mA], "
    "voltage [V]; and the columns t, zp, vzp, zo, vzo … of tracked trials"
)
BODIES = {"p": "surface", "o": "part", "s": "plate"}
TRIALS = {"t": "time"} | {
    f"{quantity}{letter}": f"{name}_{body}"
    for letter, body in BODIES.items()
    for quantity, name in (("z", "z"), ("vz", "v"), ("az", "a"), ("vx", "v_across"))
}
"""Columns of the published trials."""
UNUSED = {f"{quantity}{letter}" for quantity in ("x", "ax") for letter in BODIES}
"""Columns of the published trials that say nothing of the vertical motion."""

TRACKS = {
    "p": ("p", "platform", "surface"),
    "o": ("o", "part", "object"),
    "s": ("s", "spring", "springed plate", "spring plate"),
}
QUANTITIES = {"y": "z", "z": "z", "vy": "vz", "vz": "vz", "ay": "az", "az": "az"}

KINDS = {"time": "s", "z": "m", "v": "m/s", "a": "m/s2", "current": "A", "coil_voltage": "V"}
KINDS["command"] = "V"
PREFIXES = {"": 1.0, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "k": 1e3}
UNITS = {
    prefix + unit: (unit, factor) for unit in KINDS.values() for prefix, factor in PREFIXES.items()
}
MM = 1e-3  # m


@dataclass(frozen=True)
class Column:
    """Where a column stands, what its header says, and the factor that brings it to SI."""

    place: int
    header: str
    factor: float


@dataclass(frozen=True)
class Table:
    """``columns`` by the names of the waveforms, and of ``TRIALS``, SI, NaN where nothing is known;
    ``headers`` as they are written; ``notes``: what was taken for granted or left out.
    """

    path: Path
    columns: dict[str, Array]
    headers: dict[str, str]
    notes: tuple[str, ...]
    lines: tuple[int, ...]

    def complete(self, name: str) -> Array:
        """A column without gaps. Raises BadInput, with the place, where it has one."""
        missing = np.flatnonzero(np.isnan(self.columns[name]))
        if len(missing):
            where = f"row {self.lines[missing[0]]}, column {self.headers[name]}"
            raise BadInput(f"{plain(str(self.path))}: {where}: the value is missing.")
        return self.columns[name]


def read_table(path: Path) -> Table:
    """The table of a file; its time, where it has one, increases from row to row.

    Raises BadInput, with file, row and column, for what is wrong with it.
    """
    cells = read_cells(path)
    tracker = any(line.startswith("#multi:") for line in cells.comments)
    known, heads, notes = _header(cells, tracker)
    cells.even(heads)
    columns = {
        name: cells.numbers(heads, column.place, column.header, MISSING) * column.factor
        for name, column in known.items()
    }
    headers = {name: column.header for name, column in known.items()}
    lines = tuple(line for line, _ in cells.rows[heads:])
    table = Table(path, columns, headers, tuple(notes), lines)
    if len(lines) < FEWEST_ROWS:
        raise BadInput(f"{cells.name}: there are {len(lines)} rows, and {FEWEST_ROWS} are needed.")
    if "time" in columns:
        late = np.flatnonzero(np.diff(table.complete("time")) <= 0)
        if len(late):
            where = f"row {table.lines[late[0] + 1]}, column {headers['time']}"
            raise BadInput(f"{cells.name}: {where}: the time does not increase.")
    return table


def _header(cells: Cells, tracker: bool) -> tuple[dict[str, Column], int, tuple[str, ...]]:
    """The known columns, how many rows the header has, and notes on what was made of it."""
    table, path = cells.rows, cells.name
    (line, head), heads = table[0], 1
    if len(table) > 1 and table[1][1][0] == "t":
        head, heads = _tracker_names(path, line, head, table[1][1]), 2
    elif tracker:
        raise BadInput(f"{path}: row {line}: a header t x y … of Tracker's is missing.")
    known: dict[str, Column] = {}
    unknown, without = [], []
    for place, cell in enumerate(head):
        written, unit = _split(cell)
        name = TRIALS.get(written) or _WORDS.get(written.lower())
        if name is None:
            unknown += [cell] if cell and written not in UNUSED else []
            continue
        if name in known:
            raise BadInput(
                f"{path}: row {line}: the column {cell} stands there twice."
                if known[name].header == cell
                else f"{path}: row {line}: {known[name].header} and {cell} are the same column."
            )
        kind = KINDS.get(name) or KINDS[name[0]]
        if unit:
            factor = _factor(f"{path}: row {line}, column {plain(cell)}", unit, kind)
        elif written in TRIALS:
            factor = 1.0 if name == "time" else MM
        else:
            factor = 1.0
            without.append(f"{cell} in {kind}")
        known[name] = Column(place, cell, factor)
    left_out = ", ".join(plain(cell, 40) for cell in unknown[:12])
    if not known:
        # What is no table may be any file, of which nothing is to be told.
        numeric = [cell for _, row in table[heads : heads + 2] for cell in row if cell]
        table_like = numeric and all(re.match(r"[+-]?[.,]?\d", cell) for cell in numeric)
        found = left_out if table_like and left_out else "none"
        raise BadInput(
            f"{path}: row {line}: no column is understood (found: {found}). "
            f"Understood are: {UNDERSTOOD}."
        )
    notes = []
    if without:
        notes.append(f"No unit in the header, so it is taken for SI: {', '.join(without)}.")
    if unknown:
        notes.append(f"Left out, not understood: {left_out}. Understood are: {UNDERSTOOD}.")
    return known, heads, tuple(notes)


def _bare(name: str) -> str:
    """Tracker's v_{y} as vy, coil_voltage as coilvoltage."""
    return re.sub(r"[_{}\s-]", "", name)


_WORDS = {_bare(word): name for name, words in WORDS.items() for word in words}


def _split(cell: str) -> tuple[str, str]:
    """A bare name, and the unit behind it in brackets."""
    name, _, unit = re.sub(r"[\])]\s*$", "", cell).partition("[")
    if not unit:
        name, _, unit = name.partition("(")
    return _bare(name), unit.strip()


def _factor(where: str, unit: str, kind: str) -> float:
    """What brings a unit to SI."""
    spelt = unit.translate(str.maketrans({"µ": "u", "μ": "u", "²": "2", "^": "", " ": ""}))
    found, factor = UNITS.get(spelt, ("", 0.0))
    if found != kind:
        told = f"the unit {plain(unit, 40)} is not {kind}, m{kind}, µ{kind} or the like"
        raise BadInput(f"{where}: {told}.")
    return factor


def _tracker_names(path: str, line: int, tracks: list[str], head: list[str]) -> list[str]:
    """Names as in the trials, from the line with the tracks and the line with t x y t x y."""
    track, found = "", []
    for cell, quantity in zip_longest(tracks[: len(head)], map(_bare, head), fillvalue=""):
        track = cell or track
        if quantity == "t":
            found.append("t" if "t" not in found else "")
            continue
        body = next((b for b, words in TRACKS.items() if track.lower() in words), None)
        known = body and QUANTITIES.get(quantity)
        found.append(f"{known}{body}" if known else "")
    if not {"zp", "zo"} & set(found):
        named = ", ".join(filter(None, tracks)) or "none"
        raise BadInput(
            f"{path}: row {line}: the tracks platform or part are needed with their heights y "
            f"(found: {named})."
        )
    return found
