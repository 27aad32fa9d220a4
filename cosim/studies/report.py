"""What a study tells: rows, sentences, tables and figures, and how they are written."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from cosim.studies.tables import Row, write_csv, write_page

if TYPE_CHECKING:
    from cosim.files.picture import Picture

Progress = Callable[[int, int, str], object]
"""Is told how many steps of a study are done, of how many, and which one was the last."""


def counted(progress: Progress, total: int) -> Callable[..., object]:
    """What is to be called, with a name or without, as each of ``total`` steps is done."""
    steps = count(1)
    return lambda what="": progress(next(steps), total, what)


def silent(done: int, total: int, what: str = "") -> None:
    """A progress that nobody looks at."""


@dataclass(frozen=True, repr=False)
class Report:
    """What a study has found; printed it says that in words."""

    name: str
    """Of its files, without an ending."""
    title: str
    rows: Sequence[Row]
    """All that was found, with every digit: a table's rows, units in the names of the columns."""
    sentences: Sequence[str]
    """Paragraphs that say what it means, the most important first."""
    tables: Mapping[str, Sequence[Row]]
    """What a page shows of it, by heading."""
    figures: Mapping[str, Callable[[], "Picture"]] = field(default_factory=dict)
    """What draws each figure, by what its file's name has after the report's."""
    printed: str = ""
    """What is printed; the first sentence unless told otherwise."""

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
