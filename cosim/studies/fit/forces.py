"""Normal forces that a user knows of trials: a file, or the published ones by name.

The file is a CSV. Its column ``trial`` holds names of files without their ending; there may be

- ``force``: as measured, to be compared with;
- ``lower`` and ``upper``: bounds of the fit;
- ``mass``: of the part, kg. With it the three are in N, without it in weights of the part, m g.
"""

import os
from collections.abc import Collection
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from cosim.errors import BadInput, plain
from cosim.files.cells import read_cells
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
        path, found = plain(os.fspath(source)), _read(Path(source))
    unknown = next((name for name in found if name not in trials), None)
    if unknown is not None:
        known = plain(", ".join(sorted(trials)))
        raise BadInput(f"{path}: there is no trial “{plain(unknown)}” (there are: {known}).")
    return found


def _read(path: Path) -> dict[str, Force]:
    cells, name = read_cells(path), plain(path)
    (line, head), *rows = cells.rows
    where = f"{name}: row {line}"
    if "trial" not in head:
        raise BadInput(f"{where}: the column “trial” is missing (found: {plain(head)}).")
    cells.even(1)
    while not head[-1]:  # a separator too many
        head.pop()
    for key in head:
        if head.count(key) > 1:
            raise BadInput(f"{where}: the column “{plain(key)}” stands there twice.")
        if key not in ("trial", *KEYS):
            raise BadInput(f"{where}: “{plain(key)}” is none of {', '.join(KEYS)}.")
    columns = {key: cells.numbers(1, head.index(key), key, ("",)) for key in KEYS if key in head}
    found: dict[str, Force] = {}
    for k, (line, row) in enumerate(rows):
        trial, where = row[head.index("trial")], f"{name}: row {line}"
        if trial in found:
            raise BadInput(f"{where}: the trial “{plain(trial)}” stands there twice.")
        known = {key: float(values[k]) for key, values in columns.items()}
        found[trial] = _force(where, {key: x for key, x in known.items() if isfinite(x)})
    if not found:
        raise BadInput(f"{name}: this file holds no forces.")
    return found


def _force(where: str, numbers: dict[str, float]) -> Force:
    for key, value in numbers.items():
        if not 0 < value <= LARGEST:
            words = f"must be above 0 and at most {LARGEST:g}, not “{value:g}”"
            raise BadInput(f"{where}: {key} {words}.")
    if "mass" in numbers:
        weight = numbers.pop("mass") * published.GRAVITY
        numbers = {key: value / weight for key, value in numbers.items()}
        if numbers and max(numbers.values()) > LARGEST:
            raise BadInput(f"{where}: mass makes more than {LARGEST:g} weights of the part.")
    measured, lower, upper = map(numbers.get, KEYS[:3])
    if lower is not None and upper is not None and lower > upper:
        raise BadInput(f"{where}: lower must not be above upper.")
    return Force(measured, lower, upper)
