"""Reading tables of measurements: columns by their names and units, in SI.

Three forms are read, with commas, semicolons or tabs between the cells:

- words with units: ``time [s]``, ``velocity [mm/s]``, ``current (mA)`` and so on, see ``WORDS``;
- the columns ``t, xp, zp, vzp, azp, xo, zo, vzo, azo, zs, vzs, azs`` (p the platform, that is the
  surface; o the part; s the spring-loaded plate) among others, as the published trials have them;
- what Tracker (physlets.org/tracker) exports for several tracks: lines that begin with ``#``, a
  line with the tracks' names, and a line ``t x y v_{y} …`` with their columns; y is the height.

The last two are in s and mm where no unit is given. Any other table must name its quantities and
units, in its header or by ``MAP``: nothing is guessed. Empty cells, ``nan``, ``?`` and
U+FFFD (Tracker's mark for a missing value, in an encoding that was lost) stand for no value.
"""

import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files.cells import Cells, read_cells

Notes = tuple[str, ...]

MISSING = {"", "nan", "?"}  # cells without a value, after U+FFFD is stripped
SHORTEST, LONGEST = 1e-9, 1e3
"""Bounds of the mean time between rows, s."""

FEWEST_ROWS = 8

MOST = 1e9
"""Largest magnitude of a value, SI: sums of squares cannot overflow."""

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
    "voltage [V]; and the columns t, xp, zp, vzp, xo, zo, vzo … of tracked trials"
)
MAP = "surface=NAME[:unit],part=NAME[:unit],time=NAME[:unit]"
"""The form of the assignment of columns; a unit may stand in the header instead."""
HOW = (
    "write what each is and its unit, such as time [s] (of frames: time [1/960 s]), surface [mm], "
    "part [mm], or, to compare, name the columns, such as --columns "
    "time=t:s,surface=top:mm,part=cube:mm"
)
BODIES = {"p": "surface", "o": "part", "s": "plate"}
TRIALS = {"t": "time"} | {
    f"{quantity}{letter}": f"{name}_{body}"
    for letter, body in BODIES.items()
    for quantity, name in (("z", "z"), ("vz", "v"), ("az", "a"))
}
"""Columns of the published trials."""
PUBLISHED, BESIDE = {"t", "zp", "zo"}, {"xp", "xo", "zs"}
"""A table with all of the first and one of the second is a published trial, and needs no units."""
UNUSED = {f"{quantity}{letter}" for quantity in ("x", "vx", "ax") for letter in BODIES}
"""Columns of the published trials that have no part in the vertical motion."""

TRACKS = {
    "p": ("p", "platform", "surface"),
    "o": ("o", "part", "object"),
    "s": ("s", "spring", "spring-loaded plate", "spring plate"),
}
"""Names of Tracker's tracks for each body's letter."""
QUANTITIES = {"y": "z", "z": "z", "vy": "vz", "vz": "vz", "ay": "az", "az": "az"}

KINDS = {"time": "s", "z": "m", "v": "m/s", "a": "m/s2", "current": "A", "coil_voltage": "V"}
KINDS["command"] = "V"
PREFIXES = {"": 1.0, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "k": 1e3}
UNITS = {
    prefix + unit: (unit, factor) for unit in KINDS.values() for prefix, factor in PREFIXES.items()
}
IN_TRIALS = {"z": "mm", "v": "mm/s", "a": "mm/s2"}
"""Units of the published trials, besides the time's."""


@dataclass(frozen=True)
class Column:
    """A column: its index, its header, its unit and the factor from this to SI."""

    place: int
    header: str
    unit: str
    factor: float
    assumed: bool
    """Whether the unit is that of the published trials, as the table gives none."""


@dataclass(frozen=True)
class Table:
    """``columns`` by the names of waveforms and of ``TRIALS``, SI, NaN where unknown; ``known``:
    each one's column in the file; ``notes``: what was left out; ``lines``: numbers of the rows."""

    columns: dict[str, Array]
    known: dict[str, Column]
    notes: tuple[str, ...]
    lines: tuple[int, ...]

    @property
    def headers(self) -> dict[str, str]:
        """The headers in the file, by the names of the columns."""
        return {name: column.header for name, column in self.known.items()}


def read_table(path: Path, asked: str = "") -> Table:
    """The table in a file; its time, where it has one, increases from row to row. ``asked``, in the
    form of ``MAP``, assigns columns, and has precedence over the names in the header.

    Raises BadInput, with file, row and column, for errors and ambiguities.
    """
    cells = read_cells(path)
    tracker = any(line.startswith("#multi:") for line in cells.comments)
    known, heads, notes = _header(cells, tracker, asked)
    cells.even(heads)
    columns = {
        name: cells.numbers(heads, column.place, column.header, MISSING) * column.factor
        for name, column in known.items()
    }
    lines = tuple(line for line, _ in cells.rows[heads:])

    def refuse(name: str, wrong: npt.NDArray[np.bool_], words: str) -> None:
        """Raise BadInput for the first row in which a column is ``wrong``, if there is one."""
        if wrong.any():
            where = f"row {lines[wrong.argmax()]}, column {plain(known[name].header, 40)}"
            raise BadInput(f"{cells.name}: {where}: {words}.")

    for name, values in columns.items():
        refuse(name, np.abs(values) > MOST, f"the value must be within ±{MOST:g} in SI units")
    if len(lines) < FEWEST_ROWS:
        raise BadInput(f"{cells.name}: it has {len(lines)} of the {FEWEST_ROWS} rows needed.")
    if "time" in columns:
        time = columns["time"]
        refuse("time", np.isnan(time), "the value is missing")
        refuse("time", np.diff(time, prepend=-np.inf) <= 0, "the time does not increase")
        step = float(time[-1] - time[0]) / (len(time) - 1)
        if not SHORTEST <= step <= LONGEST:
            raise BadInput(
                f"{cells.name}: its rows are {step:.3g} s apart, and must be {SHORTEST:g} to "
                f"{LONGEST:g} s: is the time's unit right?"
            )
    return Table(columns, known, notes, lines)


def _header(cells: Cells, tracker: bool, asked: str) -> tuple[dict[str, Column], int, Notes]:
    """The known columns, the number of header rows, and notes on what was left out."""
    table, path = cells.rows, cells.name
    (line, head), heads = table[0], 1
    where = f"{path}: row {line}"
    if len(table) > 1 and table[1][1][0] == "t":
        head, heads = _tracker_names(path, line, head, table[1][1]), 2
    elif tracker:
        raise BadInput(f"{where}: a header t x y … of Tracker's is missing.")
    split = [_split(cell) for cell in head]
    words = {written for written, _ in split}
    published = heads == 2 or (words >= PUBLISHED and words & BESIDE)
    # Without the others, p may mean the part and s the surface; o alone is clear.
    bodies = {word[-1] for word in words & TRIALS.keys() if word != "t"}
    clear = published or bodies <= {"o"} or bodies >= {"p", "o"}
    chosen = _chosen(where, asked, head)
    known: dict[str, Column] = {}
    unknown: list[str] = []
    unclear: list[str] = []
    for place, (cell, (written, unit)) in enumerate(zip(head, split, strict=True)):
        letters = TRIALS.get(written)
        name, given = chosen.get(place, (letters or _WORDS.get(written.lower()), ""))
        if name is None or (place not in chosen and name in (word for word, _ in chosen.values())):
            unknown += [cell] if cell and written not in UNUSED else []
            continue
        unit, assumed = given or unit, False
        if not unit and published and letters:
            unit, assumed = IN_TRIALS.get(name[0], "s"), True
        if not unit or (letters and letters != "time" and not clear and place not in chosen):
            (unknown if asked and place not in chosen else unclear).append(cell)
            continue
        if name in known:
            raise BadInput(
                f"{where}: the column {cell} stands there twice."
                if known[name].header == cell
                else f"{where}: {known[name].header} and {cell} are the same column."
            )
        factor = _factor(f"{where}, column {plain(cell)}", unit, KINDS.get(name) or KINDS[name[0]])
        known[name] = Column(place, cell, unit, factor, assumed)
    left_out = ", ".join(plain(cell, 40) for cell in unknown[:12])
    if unclear:
        cells_said = ", ".join(plain(cell, 40) for cell in unclear[:12])
        raise BadInput(f"{where}: what {cells_said} is, or its unit, is not clear: {HOW}.")
    if not known:
        # A file that is no table may be private, so its words are not printed.
        numeric = [cell for _, row in table[heads : heads + 2] for cell in row if cell]
        table_like = numeric and all(re.match(r"[+-]?[.,]?\d", cell) for cell in numeric)
        found = left_out if table_like and left_out else "none"
        raise BadInput(
            f"{where}: no column is understood (found: {found}): {HOW}. "
            f"Understood are: {UNDERSTOOD}."
        )
    if unknown and "time" not in known:
        raise BadInput(f"{where}: which column is the time is not clear ({left_out}): {HOW}.")
    note = f"Left out{'' if asked else ', not understood'}: {left_out}."
    hint = f" Understood are: {UNDERSTOOD}. To compare, --columns surface=NAME names others."
    note += "" if asked else hint
    return known, heads, (note,) if unknown else ()


def _chosen(where: str, asked: str, head: list[str]) -> dict[int, tuple[str, str]]:
    """The assignment ``asked``: for indices of columns the waveform's name, and the unit or ""."""
    found: dict[int, tuple[str, str]] = {}
    for item in filter(None, re.split(r",(?=[\w ]+=)", asked)):
        word, _, column = item.partition("=")
        name, column = _WORDS.get(_bare(word).lower()), column.strip()
        if name is None or not column or name in (taken for taken, _ in found.values()):
            raise BadInput(
                f"--columns {plain(item, 60)}: write {MAP}, each once; besides these three "
                "v_surface, v_part, current, voltage, command."
            )
        unit, places = "", [place for place, cell in enumerate(head) if cell == column]
        if not places:
            column, _, unit = column.rpartition(":") if ":" in column else (column, "", "")
            alike = (column, _bare(column))
            places = [p for p, cell in enumerate(head) if cell in alike or _split(cell)[0] in alike]
        if len(places) != 1 or places[0] in found:
            headers = ", ".join(plain(cell, 40) for cell in head[:20])
            few = "there is no column" if not places else "not one column of its own is"
            raise BadInput(f"{where}: --columns: {few} {plain(column, 40)} (found: {headers}).")
        found[places[0]] = name, unit.strip()
    return found


def _bare(name: str) -> str:
    """A name without _, {}, - and spaces: Tracker's v_{y} as vy, coil_voltage as coilvoltage."""
    return re.sub(r"[_{}\s-]", "", name)


_WORDS = {_bare(word): name for name, words in WORDS.items() for word in words}


def _split(cell: str) -> tuple[str, str]:
    """A header cell's bare name, and the unit behind it in brackets or ""."""
    name, _, unit = re.sub(r"[\])]\s*$", "", cell).partition("[")
    if not unit:
        name, _, unit = name.partition("(")
    return _bare(name), unit.strip()


def _factor(where: str, unit: str, kind: str) -> float:
    """The factor from a unit to SI; ``-mm`` is mm in a column that is positive downwards, and
    ``1/960 s`` the unit of a column that counts a camera's frames."""
    spelt = unit.translate(str.maketrans({"µ": "u", "μ": "u", "²": "2", "^": "", " ": ""}))
    found, factor = UNITS.get(spelt.removeprefix("-"), ("", 0.0))
    if frames := re.fullmatch(r"1/([1-9]\d{0,8}(\.\d{1,9})?)s", spelt, re.ASCII):
        found, factor = "s", 1.0 / float(frames[1])
    if found != kind:
        words = f"the unit {plain(unit, 40)} is not {kind}, m{kind}, µ{kind} or the like"
        words += ", nor 1/960 s or the like for frames" * (kind == "s")
        raise BadInput(f"{where}: {words}.")
    return -factor if spelt.startswith("-") else factor


def _tracker_names(path: str, line: int, tracks: list[str], head: list[str]) -> list[str]:
    """Names as in the trials, from the lines of tracks and of t x y t x …; "" for one not used."""
    track, found = "", []
    for cell, quantity in zip_longest(tracks[: len(head)], map(_bare, head), fillvalue=""):
        track = cell or track  # a track's name stands above its first column only
        if quantity == "t":
            found.append("t" if "t" not in found else "")
            continue
        body = next((b for b, words in TRACKS.items() if track.lower() in words), None)
        known = body and QUANTITIES.get(quantity)
        found.append(f"{known}{body}" if known else "")
    if not {"zp", "zo"} & set(found):
        named = ", ".join(filter(None, tracks)) or "none"
        raise BadInput(
            f"{path}: row {line}: no track is called platform or part and has heights y "
            f"(found: {named}): write these names over the tracks' first columns, or in Tracker."
        )
    return found
