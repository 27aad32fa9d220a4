"""The tables of a study: the same rows as CSV, Markdown and JSON, with what made them."""

import csv
import json
import os
import platform
from collections.abc import Mapping, Sequence
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
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def write(
    folder: Path, name: str, title: str, tables: Mapping[str, Sequence[Row]], notes: Sequence[str]
) -> None:
    """Write ``name``.csv (the first table), ``name``.md and ``name``.json into ``folder``.

    ``tables`` are rows by heading; ``notes`` go into the Markdown, a paragraph each.
    """
    host = machine()
    rows = next(iter(tables.values()))
    with whole(folder / f"{name}.csv") as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([_exact(cell) for cell in row.values()] for row in rows)
    content = {"title": title, "machine": host, "notes": list(notes)}
    content["tables"] = {
        heading: [{k: _plain(v) for k, v in row.items()} for row in found]
        for heading, found in tables.items()
    }
    with whole(folder / f"{name}.json") as temporary:
        text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with whole(folder / f"{name}.md") as temporary:
        lines = [f"# {title}", ""]
        for note in notes:
            lines += [note, ""]
        for heading, found in tables.items():
            lines += [f"## {heading}", "", *markdown(found), ""]
        lines += [", ".join(f"{k} {v}" for k, v in host.items()) + "."]
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def markdown(rows: Sequence[Row]) -> list[str]:
    """The lines of a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_short(cell) for cell in row.values()) + " |" for row in rows]
    return lines


def _short(cell: Any) -> str:
    if isinstance(cell, float):
        return f"{cell:.4g}" if isfinite(cell) else "-"
    return str(cell)


def _exact(cell: Any) -> Any:
    return repr(cell) if isinstance(cell, float) else cell


def _plain(cell: Any) -> Any:
    return None if isinstance(cell, float) and not isfinite(cell) else cell
