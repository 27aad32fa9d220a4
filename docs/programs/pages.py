"""What a page holds for a machine: its blocks of code, and the page as a notebook.

A block is a fence of three backticks with a language. Those that run:

- ``python``: all blocks of a page share one namespace;
- ``sh``: a shell that stops at the first failure;
- any other with ``title="NAME"``: the contents of the file NAME.

They run in order, in one folder. A block ``text`` right after one holds lines that it prints, in
their order; one that ends with “…” is cut. A comment on the line before a block changes that:
``<!-- slow -->`` for long ones, ``<!-- needs PROGRAM -->``, ``<!-- not run: REASON -->``.
"""

import json
import re
from dataclasses import dataclass
from typing import Any

_FENCE = re.compile(
    r"^(?:<!-- *(?P<note>[^\n]*?) *-->\n)?(?P<indent> *)```(?P<language>\w+)(?P<more>[^\n]*)\n"
    r"(?P<text>.*?)^ *```$",
    re.MULTILINE | re.DOTALL,
)
_TITLE = re.compile(r'title="([^"]+)"')


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and the line on which it starts."""

    language: str
    text: str
    line: int
    note: str
    """The comment before it; empty without one."""
    title: str
    """The file that it is; empty where it is none."""
    start: int
    end: int
    """Where its fence is in the page."""

    @property
    def runs(self) -> bool:
        return self.language in ("python", "sh") or bool(self.title)


def blocks(page: str) -> list[Block]:
    """The blocks of a page of Markdown, in order."""
    found = []
    for match in _FENCE.finditer(page):
        title = _TITLE.search(match["more"])
        indent = len(match["indent"])
        text = "".join(line[indent:] or "\n" for line in match["text"].splitlines(keepends=True))
        line = page.count("\n", 0, match.start("language")) + 1
        found.append(
            Block(
                match["language"],
                text,
                line,
                match["note"] or "",
                title[1] if title else "",
                match.start(),
                match.end(),
            )
        )
    return found


_MAGIC = {"python": "", "sh": "%%bash\n"}


def notebook(page: str) -> str:
    """The page as a Jupyter notebook: its words, and each block that runs as a cell."""
    cells: list[dict[str, Any]] = []

    def cell(kind: str, text: str) -> None:
        if text.strip():
            lines = text.strip("\n").splitlines(keepends=True)
            more: dict[str, Any] = {"execution_count": None, "outputs": []}
            own = {"cell_type": kind, "id": f"cell-{len(cells)}", "metadata": {}, "source": lines}
            cells.append(own | (more if kind == "code" else {}))

    place = 0
    for block in blocks(page):
        if block.runs and not block.note.startswith("not run"):
            cell("markdown", page[place : block.start])
            magic = f"%%writefile {block.title}\n" if block.title else _MAGIC[block.language]
            cell("code", magic + block.text)
            place = block.end
    cell("markdown", page[place:])
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, ensure_ascii=False, indent=1) + "\n"
