"""The reader of all tables (cells between commas, semicolons or tabs, strict numbers), and of a
quantity over time from two columns of a table.

It is strict so that no number is read as another one: a comma is decimal only where commas do not
separate cells, and a file has no decimal points beside it; a row has as many cells as its header;
quotation marks enclose a whole cell, within one line.
"""

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files import reader

LARGEST = 50_000_000
"""Bytes of a table."""
MOST_ROWS = 2_000_000
MOST_CELLS = 10_000
"""Cells in a row."""

_MANY = 10_000  # rows of a table whose reading may take more than a second

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029]")
# Possessive (++, *+), or a long cell that is no number would be tried in all its parts.
_DIGITS = r"[+-]?(?:[0-9]++{0}?[0-9]*+|{0}[0-9]++)(?:[eE][+-]?[0-9]++)?"  # {0}: decimal sign
_NUMBER = {sign: re.compile(_DIGITS.format(re.escape(sign))) for sign in ".,"}
_ASIDE = ("#", "sep=")
_QUOTED = re.compile(r' *"((?:[^"]|"")*+)" *')


@dataclass
class Cells:
    """The rows of a table, each with the number of its line."""

    path: Path
    separator: str
    rows: list[tuple[int, list[str]]]
    comments: list[str]
    """Lines that begin with #, or with the sep= of Excel."""
    _signs: dict[str, tuple[int, str]] = field(default_factory=dict)
    """Where each decimal sign was met first: row and column."""

    @property
    def name(self) -> str:
        """The file, as messages name it."""
        return plain(self.path)

    def even(self, heads: int) -> None:
        """Check that the rows are as wide as the widest of the first ``heads`` ones, which are the
        header. Empty cells at the end do not count. Raises BadInput."""
        width = max(_width(head) for _, head in self.rows[:heads])
        for line, row in self.rows[heads:]:
            if len(row) < width or (len(row) > width and any(row[width:])):
                hint = ""
                if self.separator == "," and len(row) > width:
                    hint = "; numbers here have a decimal point, not a comma"
                raise BadInput(
                    f"{self.name}: row {line}: it has {len(row)} cells, the header {width}{hint}."
                )

    def numbers(self, heads: int, place: int, column: str, missing: Collection[str] = ()) -> Array:
        """The numbers of a column, below ``heads`` rows of header; NaN for a word of ``missing``.

        Raises BadInput, with row and ``column``, for what is no finite number.
        """
        texts = [row[place] for _, row in self.rows[heads:]]
        values = np.full(len(texts), np.nan)
        for k, text in enumerate(texts):
            if text.strip("\ufffd").lower() not in missing:
                values[k] = self._number(text, self.rows[heads + k][0], column)
        if np.isinf(values).any():
            k = int(np.isinf(values).argmax())
            self._refuse(self.rows[heads + k][0], column, texts[k], "is not finite")
        return values

    def _number(self, text: str, line: int, column: str) -> float:
        sign = "," if "," in text and self.separator != "," else "."
        if _NUMBER[sign].fullmatch(text):
            if sign in text and self.separator != ",":
                self._signed(sign, line, column)
            return float(text.replace(",", "."))
        words = "is not a number"
        if text.lstrip("+-").lower() in ("inf", "infinity", "nan"):
            words = "is not finite"
        self._refuse(line, column, text, words)

    def _signed(self, sign: str, line: int, column: str) -> None:
        """Note a decimal sign: a file has only one."""
        self._signs.setdefault(sign, (line, column))
        if len(self._signs) == 2:
            (row, first), (comma_row, second) = (self._signs[sign] for sign in ".,")
            raise BadInput(
                f"{self.name}: row {row}, column {plain(first, 40)} has a decimal point, and row "
                f"{comma_row}, column {plain(second, 40)} a decimal comma."
            )

    def _refuse(self, line: int, column: str, text: str, words: str) -> NoReturn:
        shown = plain(text, 40)
        raise BadInput(f"{self.name}: row {line}, column {plain(column, 40)}: “{shown}” {words}.")


def read_cells(path: Path) -> Cells:
    """The cells of a text file. Raises BadInput, with the row, for what is no table."""
    text = _decoded(reader.read(path, LARGEST))
    name = plain(path)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if odd := _CONTROL.search(text):
        row = len(re.split("\r\n|\r|\n", text[: odd.start()]))
        raise BadInput(
            f"{name}: row {row}: the control character U+{ord(odd[0]):04X} cannot stand in a table."
        )
    numbered = [(n, line) for n, line in enumerate(lines, 1) if line and not line.isspace()]
    comments = [line for _, line in numbered if line.startswith(_ASIDE)]
    kept = [(n, line) for n, line in numbered if not line.startswith(_ASIDE)]
    if not kept:
        raise BadInput(f"{name}: this file holds no table.")
    separator = next((sign for sign in "\t;" if any(sign in line for _, line in kept[:2])), ",")
    if len(kept) > MOST_ROWS:
        raise BadInput(f"{name}: it has more than {MOST_ROWS} rows.")
    rows = []
    for n, line in kept if len(kept) < _MANY else _shown(kept, path):
        if line.count(separator) >= MOST_CELLS:
            raise BadInput(f"{name}: row {n}: it has more than {MOST_CELLS} cells.")
        rows.append((n, [*_cells(line, separator, name, n)]))
    return Cells(path, separator, rows, comments)


def _shown(lines: list[tuple[int, str]], path: Path) -> Iterable[tuple[int, str]]:
    """The lines, with a progress bar from a second on, where stderr is a terminal."""
    from tqdm import tqdm

    name = f"reading {plain(path.name, 40)}"
    return tqdm(lines, name, unit="row", leave=False, delay=1.0, disable=None)


def _decoded(data: bytes) -> str:
    """The text, of UTF-8, UTF-16 with its mark, or else code page 1252, as Excel's CSV has it."""
    try:
        return data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _cells(line: str, separator: str, name: str, row: int) -> Iterator[str]:
    if '"' not in line:
        yield from (cell.strip() for cell in line.split(separator))
        return
    place, last = 0, line.rfind('"')
    while place <= len(line):
        quoted = _QUOTED.match(line, place) if place <= last else None
        if quoted and line[quoted.end() : quoted.end() + 1] in ("", separator):
            yield quoted[1].replace('""', '"').strip()
            place = quoted.end() + 1
            continue
        end = line.find(separator, place)
        cell = line[place:] if end < 0 else line[place:end]
        if '"' in cell:
            raise BadInput(f"{name}: row {row}: a quotation mark does not enclose a whole cell.")
        yield cell.strip()
        place = len(line) + 1 if end < 0 else end + 1


def _width(row: list[str]) -> int:
    """The number of cells, without empty ones at the end."""
    return max((place for place, cell in enumerate(row, 1) if cell), default=0)


def read_timetable(path: Path, time: tuple[str, ...], value: tuple[str, ...]) -> Array | None:
    """The two columns as rows of (time, value); None where the header does not have them.

    ``time`` and ``value`` are the names that the columns may have; other columns are ignored. There
    are two rows or more of finite numbers; the time does not fall, and the value jumps where a time
    is given twice. Raises BadInput.
    """
    cells = read_cells(path)
    columns = [k for names in (time, value) if (k := _place(cells, names)) is not None]
    if len(columns) < 2:
        return None
    cells.even(1)
    if len(cells.rows) < 3:
        raise BadInput(f"{cells.name}: at least two rows of {time[-1]} and {value[-1]} are needed.")
    header = cells.rows[0][1]
    result = np.column_stack([cells.numbers(1, k, header[k]) for k in columns])
    late = np.flatnonzero(np.diff(result[:, 0]) < 0)
    if len(late):
        row = cells.rows[late[0] + 2][0]
        raise BadInput(f"{cells.name}: row {row}: the time must not fall.")
    return result


def _place(cells: Cells, names: tuple[str, ...]) -> int | None:
    """The index of the column that has one of these names; None without one."""
    line, header = cells.rows[0]
    found = [place for place, cell in enumerate(header) if cell in names]
    if len(found) > 1:
        same = " and ".join(header[place] for place in found)
        raise BadInput(f"{cells.name}: row {line}: {same} are the same column.")
    return found[0] if found else None
