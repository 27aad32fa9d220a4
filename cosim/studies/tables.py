"""The tables of a study: raw rows as CSV, and a page of Markdown that says what they show."""

import csv
import os
import platform
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from pathlib import Path
from typing import Any

from cosim.files.atomic import whole
from cosim.toolchain.versions import versions

Row = dict[str, Any]
"""Cells by their column; all rows of a table have the same ones."""


def machine() -> dict[str, Any]:
    """The computer and the versions of what ran on it."""
    found: dict[str, Any] = {"processor": _processor(), "cores": os.cpu_count()}
    found |= {"system": f"{platform.system()} {platform.machine()}"} | versions()
    for package in ("scipy", "scikit-sundae"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows with every digit, whole or not at all."""
    with whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_page(
    path: Path, title: str, notes: Sequence[str], tables: Mapping[str, Sequence[Row]]
) -> None:
    """Write Markdown: ``notes``, a paragraph each, ``tables`` by heading, and the machine."""
    lines = [f"# {title}", ""]
    for note in notes:
        lines += [note, ""]
    for heading, rows in tables.items():
        lines += [f"## {heading}", "", *markdown(rows), ""]
    lines += [", ".join(f"{k} {v}" for k, v in machine().items()) + "."]
    with whole(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def markdown(rows: Sequence[Row]) -> list[str]:
    """The lines of a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_short(cell) for cell in row.values()) + " |" for row in rows]
    return lines


def brief(number: float) -> str:
    """Two digits, as in a sentence; a dash for what is not known."""
    if not isfinite(number):
        return "-"
    return f"{number:.0f}" if 10.0 <= abs(number) < 1e5 else f"{number:.2g}"


def span(numbers: Collection[float]) -> str:
    """Least and greatest, in words; one number where they are the same."""
    return " to ".join(dict.fromkeys((brief(min(numbers)), brief(max(numbers)))))


def _short(cell: Any) -> str:
    if isinstance(cell, float):
        return f"{cell:.4g}" if isfinite(cell) else "-"
    return str(cell)
