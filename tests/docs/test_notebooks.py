"""The tutorials as the notebooks that the site offers."""

import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from docs.programs.pages import notebook

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["sweep", pytest.param("circuit", marks=pytest.mark.slow)])
def test_tutorial_as_notebook(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is valid, its cells run, and its plots show; ``circuit`` has files and a shell too."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    monkeypatch.setenv("PATH", path)
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    page = (REPOSITORY / "docs" / "tutorials" / f"{name}.md").read_text(encoding="utf-8")
    cells = nbformat.reads(notebook(page), as_version=4)
    nbformat.validate(cells)
    folder = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(cells, timeout=300, resources=folder).execute()
    shown = {
        kind
        for cell in cells.cells
        for out in cell.get("outputs", [])
        for kind in out.get("data", {})
    }
    assert "image/png" in shown
