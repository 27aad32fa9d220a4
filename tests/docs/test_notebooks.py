"""The tutorials as the notebooks that the site offers."""

import ast
import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from docs.programs.pages import blocks, notebook

REPOSITORY = Path(__file__).parents[2]


TUTORIALS = sorted((REPOSITORY / "docs" / "tutorials").glob("*.md"))


def read(page: Path) -> nbformat.NotebookNode:
    return nbformat.reads(notebook(page.read_text(encoding="utf-8")), as_version=4)


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_notebook_is_valid_and_has_what_the_page_runs(page: Path) -> None:
    """What runs as a page, see test_snippets.py, is in its cells, in this order; a file and a
    shell have their magic."""
    cells = read(page)
    nbformat.validate(cells)
    found = [cell["source"] for cell in cells.cells if cell["cell_type"] == "code"]
    runs = [
        block
        for block in blocks(page.read_text(encoding="utf-8"))
        if block.runs and not block.note.startswith("not run")
    ]
    assert len(found) == len(runs) > 0
    for source, block in zip(found, runs, strict=True):
        magic = f"%%writefile {block.title}" if block.title else "%%bash"
        if block.language == "python" and not block.title:
            assert source == block.text.strip("\n")
            ast.parse(source)
        else:
            assert source.splitlines()[0] == magic
            assert source.partition("\n")[2] == block.text.strip("\n")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sweep", "circuit"])
def test_tutorial_as_notebook(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells run, and its plots show; ``circuit`` has files and a shell too."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    monkeypatch.setenv("PATH", path)
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    cells = read(REPOSITORY / "docs" / "tutorials" / f"{name}.md")
    folder = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(cells, timeout=300, resources=folder).execute()
    shown = {
        kind
        for cell in cells.cells
        for out in cell.get("outputs", [])
        for kind in out.get("data", {})
    }
    assert "image/png" in shown
