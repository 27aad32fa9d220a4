"""Normal forces that a user knows of trials: a file, or the published ones by name.

A CSV has the column ``trial``, which holds names of files without their ending, and any of

- ``force``: as measured, to be compared with;
- ``lower`` and ``upper``: bounds of the fit;
- ``mass``: of the part, kg. With it the three are in N, without it in weights of the part, m g.

A TOML file has a table for each trial with the same keys: ``["Trial 1"]``, ``force = 0.5``.
"""

import csv
import os
import tomllib
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.trials import published

KEYS = ("force", "lower", "upper", "mass")
LARGEST = 1e6  # N, kg or weights


@dataclass(frozen=True)
class Force:
    """What is known of a normal force, in weights of the part."""

    measured: float | None = None
    lower: float | None = None
    upper: float | None = None


PUBLISHED = {
    name: Force(measured, *bounds)
    for name, measured, bounds in zip(
        published.TRIALS, published.FORCES_MEASURED, published.FORCE_BOUNDS, strict=True
    )
}


def read_forces(source: str | os.PathLike[str], trials: Collection[str]) -> dict[str, Force]:
    """Forces by the names of trials, from a file or, if it is “published”, the published ones.

    Each must belong to one of ``trials``. Raises BadInput.
    """
    if source == "published":
        path, found = "The published forces", PUBLISHED
    else:
        path = plain(os.fspath(source))
        found = {name: _force(*row) for name, row in _rows(Path(source)).items()}
    unknown = next((name for name in found if name not in trials), None)
    if unknown is not None:
        known = plain(", ".join(sorted(trials)))
        raise BadInput(f"{path}: there is no trial “{plain(unknown)}” (there are: {known}).")
    return found


def _rows(path: Path) -> dict[str, tuple[str, dict[str, Any]]]:
    """What the file says of each trial, and where."""
    name = plain(str(path))
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BadInput(f"{name}: cannot be read ({error.strerror}).") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{name}: this is not UTF-8.") from error
    if path.suffix.lower() == ".toml":
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise BadInput(f"{name}: this is not TOML ({error}).") from error
        loose = next((key for key, value in data.items() if not isinstance(value, dict)), None)
        if loose is not None:
            raise BadInput(f"{name}: “{plain(loose)}” must be the table of a trial.")
        rows = [(trial, f"{name}, [{plain(trial)}]", row) for trial, row in data.items()]
    else:
        rows = list(_table(name, text))
    found: dict[str, tuple[str, dict[str, Any]]] = {}
    for trial, where, row in rows:
        if trial in found:
            raise BadInput(f"{where}: the trial “{plain(trial)}” stands there twice.")
        found[trial] = where, row
    if not found:
        raise BadInput(f"{name}: this file holds no forces.")
    return found


def _table(name: str, text: str) -> Iterable[tuple[str, str, dict[str, Any]]]:
    reader = csv.reader(StringIO(text))
    head = [cell.strip() for cell in next(reader, [])]
    if "trial" not in head:
        raise BadInput(f"{name}: row 1: the column “trial” is missing (found: {plain(str(head))}).")
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        where = f"{name}: row {reader.line_num}"
        if len(cells) != len(head):
            raise BadInput(f"{where}: it has {len(cells)} cells, the header {len(head)}.")
        row = {key: cell.strip() for key, cell in zip(head, cells, strict=True)}
        yield row.pop("trial"), where, {key: cell for key, cell in row.items() if cell}


def _force(where: str, row: dict[str, Any]) -> Force:
    numbers: dict[str, float] = {}
    for key, value in row.items():
        if key not in KEYS:
            raise BadInput(f"{where}: “{plain(key)}” is none of {', '.join(KEYS)}.")
        try:
            numbers[key] = float(value)
        except (TypeError, ValueError):
            numbers[key] = float("nan")
        if not 0 < numbers[key] <= LARGEST:
            said = plain(str(value))
            raise BadInput(f"{where}: {key} must be above 0 and at most {LARGEST:g}, not “{said}”.")
    if "mass" in numbers:
        weight = numbers.pop("mass") * published.GRAVITY
        numbers = {key: value / weight for key, value in numbers.items()}
    lower, upper = numbers.get("lower"), numbers.get("upper")
    if lower is not None and upper is not None and lower > upper:
        raise BadInput(f"{where}: lower must not be above upper, and is {row['lower']}.")
    return Force(numbers.get("force"), lower, upper)
