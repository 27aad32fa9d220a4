"""A quantity over time, read from two columns of a CSV file."""

import csv
import math
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain


def read_timetable(path: Path, time: tuple[str, ...], value: tuple[str, ...]) -> Array | None:
    """The two columns as rows of (time, value); None where the header does not have them.

    ``time`` and ``value`` are the names that each column may have; other columns do not matter. Two
    rows or more, finite, and the time does not fall: at a time given twice the value jumps. Raises
    BadInput.
    """
    name = plain(str(path))
    try:
        with open(path, newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = csv.reader(file)
            header = [cell.strip() for cell in next(rows, [])]
            columns = [
                next((header.index(known) for known in names if known in header), None)
                for names in (time, value)
            ]
            if None in columns:
                return None
            table = [[_number(row, k, name, rows.line_num) for k in columns] for row in rows if row]
    except OSError as error:
        raise BadInput(f"{name}: cannot be read ({error.strerror}).") from None
    except csv.Error as error:
        raise BadInput(f"{name}: this is not CSV ({error}).") from None
    if len(table) < 2:
        raise BadInput(f"{name}: at least two rows of {time[-1]} and {value[-1]} are needed.")
    result = np.array(table)
    if np.any(np.diff(result[:, 0]) < 0):
        row = int(np.argmax(np.diff(result[:, 0]) < 0)) + 3
        raise BadInput(f"{name}, row {row}: the time must not fall.")
    return result


def _number(row: list[str], column: int | None, name: str, line: int) -> float:
    try:
        value = float(row[column or 0])
    except (ValueError, IndexError):
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{name}, row {line}, column {(column or 0) + 1}: a number is needed.")
    return value
