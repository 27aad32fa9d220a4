"""A quantity over time, read from two columns of a table."""

from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.files.cells import Cells, read_cells


def read_timetable(path: Path, time: tuple[str, ...], value: tuple[str, ...]) -> Array | None:
    """The two columns as rows of (time, value); None where the header does not have them.

    ``time`` and ``value`` are the names that each column may have; other columns do not matter. Two
    rows or more, finite, and the time does not fall: at a time given twice the value jumps. Raises
    BadInput.
    """
    cells = read_cells(path)
    columns = [_place(cells, names) for names in (time, value)]
    if None in columns:
        return None
    cells.even(1)
    if len(cells.rows) < 3:
        raise BadInput(f"{cells.name}: at least two rows of {time[-1]} and {value[-1]} are needed.")
    header = cells.rows[0][1]
    result = np.column_stack(
        [cells.numbers(1, place, header[place]) for place in columns if place is not None]
    )
    late = np.flatnonzero(np.diff(result[:, 0]) < 0)
    if len(late):
        row = cells.rows[late[0] + 2][0]
        raise BadInput(f"{cells.name}: row {row}: the time must not fall.")
    return result


def _place(cells: Cells, names: tuple[str, ...]) -> int | None:
    """Where the one column with one of these names stands."""
    line, header = cells.rows[0]
    found = [place for place, cell in enumerate(header) if cell in names]
    if len(found) > 1:
        same = " and ".join(header[place] for place in found)
        raise BadInput(f"{cells.name}: row {line}: {same} are the same column.")
    return found[0] if found else None
