"""Normal forces that a user knows of trials: a file, or the published ones by name.

A CSV has the column ``trial``, which holds names of files without their ending, and any of

- ``force``: as measured, to be compared with;
- ``lower`` and ``upper``: bounds of the fit;
- ``mass``: of the part, kg. With it the three are in N, without it in weights of the part, m g.

A TOML file has a table for each trial with the same keys: ``["Trial 1"]``, ``force = 0.5``.
"""

import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.files.cells import read_cells
from cosim.scene import toml
from cosim.scene.messages import shown
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
        path, found = plain(os.fspath(source)), {}
        for trial, where, row in _rows(Path(source)):
            if trial in found:
                raise BadInput(f"{where}: the trial “{plain(trial)}” stands there twice.")
            found[trial] = _force(where, row)
        if not found:
            raise BadInput(f"{path}: this file holds no forces.")
    unknown = next((name for name in found if name not in trials), None)
    if unknown is not None:
        known = plain(", ".join(sorted(trials)))
        raise BadInput(f"{path}: there is no trial “{plain(unknown)}” (there are: {known}).")
    return found


def _rows(path: Path) -> list[tuple[str, str, dict[str, Any]]]:
    """The trials of a file, where each stands, and what the file says of it."""
    name, found = plain(path), []
    if path.suffix.lower() == ".toml":
        for trial, row in toml.read(path).items():
            if not isinstance(row, dict):
                raise BadInput(f"{name}: “{plain(trial)}” must be the table of a trial.")
            found.append((trial, f"{name}, [{plain(trial)}]", row))
        return found
    cells = read_cells(path)
    (line, head), *rows = cells.rows
    if "trial" not in head:
        said = plain(head)
        raise BadInput(f"{name}: row {line}: the column “trial” is missing (found: {said}).")
    cells.even(1)
    if twice := next((key for key in head if key and head.count(key) > 1), ""):
        raise BadInput(f"{name}: row {line}: the column “{plain(twice)}” stands there twice.")
    places = ((key, head.index(key)) for key in KEYS if key in head)
    columns = {key: cells.numbers(1, place, key, ("",)).tolist() for key, place in places}
    for k, (line, row) in enumerate(rows):
        known: dict[str, Any] = {key: cell for key, cell in zip(head, row, strict=False) if cell}
        known |= {key: values[k] for key, values in columns.items() if key in known}
        found.append((known.pop("trial", ""), f"{name}: row {line}", known))
    return found


def _force(where: str, row: dict[str, Any]) -> Force:
    numbers: dict[str, float] = {}
    for key, value in row.items():
        if key not in KEYS:
            raise BadInput(f"{where}: “{plain(key)}” is none of {', '.join(KEYS)}.")
        if type(value) not in (int, float) or not 0 < value <= LARGEST:
            said = shown(value)
            raise BadInput(f"{where}: {key} must be above 0 and at most {LARGEST:g}, not “{said}”.")
        numbers[key] = float(value)
    if "mass" in numbers:
        weight = numbers.pop("mass") * published.GRAVITY
        numbers = {key: value / weight for key, value in numbers.items()}
        if numbers and max(numbers.values()) > LARGEST:
            raise BadInput(f"{where}: mass makes more than {LARGEST:g} weights of the part.")
    lower, upper = numbers.get("lower"), numbers.get("upper")
    if lower is not None and upper is not None and lower > upper:
        raise BadInput(f"{where}: lower must not be above upper, and is {row['lower']}.")
    return Force(numbers.get("force"), lower, upper)
