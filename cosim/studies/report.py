"""The report of a study: rows, sentences, tables and figures, and how they are written."""

import csv
import os
import platform
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.files.atomic import whole, write_text
from cosim.toolchain.versions import versions
from cosim.typed import typed

if TYPE_CHECKING:
    from cosim.files.picture import Picture

Row = dict[str, Any]
"""The cells of a row by their columns; all rows of a table have the same columns."""

Progress = Callable[[int, int, str], object]
"""Called with the number of steps done, their total, and the name of the last one."""


def counted(progress: Progress, total: int) -> Callable[..., object]:
    """A function to be called, with a name or without, after each of ``total`` steps."""
    steps = count(1)
    return lambda what="": progress(next(steps), total, what)


def silent(done: int, total: int, what: str = "") -> None:
    """A Progress that does nothing."""


@dataclass(frozen=True, repr=False)
class Report:
    """The results of a study; its ``repr`` is a text for the terminal. What its ``rows`` hold is
    told by the function that gives it, such as :func:`cosim.ladder`."""

    name: str
    """Name of its files, without an ending."""
    title: str
    rows: Sequence[Row]
    """The rows of the CSV, with every digit; units stand in the names of the columns."""
    sentences: Sequence[str]
    """Paragraphs of the page that explain the results, the most important first."""
    tables: Mapping[str, Sequence[Row]]
    """The tables of the page, by heading."""
    figures: Mapping[str, Callable[[], "Picture"]] = field(default_factory=dict)
    """Functions that draw the figures; a key is what the file's name has after the report's."""
    printed: str = ""
    """The text for the terminal; by default the first sentence."""

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the rows as CSV, a page of Markdown and the figures. Raises BadInput where the
        folder cannot be written to."""
        out = Path(folder)
        write_csv(out / f"{self.name}.csv", self.rows)
        write_page(out / f"{self.name}.md", self.title, self.sentences, self.tables)
        for end, draw in self.figures.items():
            draw().write(out / f"{self.name}{end}.png")

    def written(self, folder: str | os.PathLike[str]) -> str:
        """The sentence that names what ``save`` writes."""
        ends = [".csv", ".md", *(f"{end}.png" for end in self.figures)]
        return f"Written to {folder}: {', '.join(self.name + end for end in ends)}"

    def __repr__(self) -> str:
        return self.printed or self.sentences[0]


def machine() -> dict[str, Any]:
    """The computer and the versions of the programs that ran on it."""
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
    write_text(path, "\n".join(lines) + "\n")


def markdown(rows: Sequence[Row]) -> list[str]:
    """The lines of a table, its columns aligned for a terminal."""
    head, *body = list(rows[0]), *([_short(cell) for cell in row.values()] for row in rows)
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    rule = ["-" * width for width in widths]
    return [f"| {' | '.join(map(str.ljust, row, widths))} |" for row in (head, rule, *body)]


def brief(number: float) -> str:
    """A number with two significant digits, as in a sentence; a dash if it is not finite."""
    if not isfinite(number):
        return "-"
    return f"{number:.0f}" if 10.0 <= abs(number) < 1e5 else f"{number:.2g}"


def span(numbers: Collection[float]) -> str:
    """Least and greatest number, in words; one number where both look the same."""
    return " to ".join(dict.fromkeys((brief(min(numbers)), brief(max(numbers)))))


def _short(cell: Any) -> str:
    """A cell's text: four significant digits of a float, a dash for NaN, infinity and None."""
    if isinstance(cell, float):
        return f"{cell:.4g}" if isfinite(cell) else "-"
    return "-" if cell is None else str(cell)
