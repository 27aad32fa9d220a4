"""The figures and pages of the studies, made anew from the rows in ``results``: all that was
measured is there, and every label can be read."""

import csv
from dataclasses import fields
from itertools import combinations
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from benchmarks import charts
from cosim.files.picture import Picture
from cosim.studies.accuracy import accuracy
from cosim.studies.accuracy import solvers as methods
from cosim.studies.accuracy.solvers import FALSE_CYCLE, Run
from cosim.studies.stability import stability
from cosim.studies.stability.stability import METHODS, Limit

SOLVERS = (*methods.SOLVERS, *charts.SOLVERS)
RESULTS = Path(__file__).parents[2] / "results"


def read(kind: type[Any], name: str) -> list[Any]:
    types = get_type_hints(kind)
    with (RESULTS / name).open(encoding="utf-8", newline="") as file:
        rows = [{k.partition(" [")[0]: x for k, x in row.items()} for row in csv.DictReader(file)]
    names = [field.name for field in fields(kind)]
    return [kind(**{name: types[name](row[name]) for name in names}) for row in rows]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Figures in the place of files."""
    found: list[Figure] = []
    monkeypatch.setattr(Picture, "write", lambda figure, path: found.append(figure))
    return found


def assert_legible(figure: Figure) -> None:
    """No text is cut off; no two labels of lines lie on each other."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()

    def box(text: Text) -> Bbox:  # without the line that an annotation draws
        return Text.get_window_extent(text, canvas.get_renderer())

    for text in figure.findobj(Text):
        words = text.get_text()  # pyright: ignore[reportAttributeAccessIssue]
        if words and not words.startswith("$"):  # ticks
            assert figure.bbox.padded(1.0).contains(*box(text).min), words  # pyright: ignore
            assert figure.bbox.padded(1.0).contains(*box(text).max), words  # pyright: ignore
    for axis in figure.axes:
        for one, other in combinations(axis.texts, 2):
            assert not box(one).overlaps(box(other)), (one, other)


def test_every_method_is_a_line_or_the_page_says_why(drawn: list[Figure], tmp_path: Path) -> None:
    runs = read(Run, "accuracy.csv")
    assert {run.method for run in runs} == {solver.name for solver in SOLVERS}
    accuracy.report(runs, SOLVERS).save(tmp_path)
    page = (tmp_path / "accuracy.md").read_text(encoding="utf-8").splitlines()
    assert len(page) <= 60
    assert_legible(drawn[0])
    for axis, scene in zip(drawn[0].axes, dict.fromkeys(run.scene for run in runs), strict=True):
        lines = sum(len(line.get_xdata()) > 1 for line in axis.lines)  # pyright: ignore
        absent = 0
        for solver in SOLVERS:
            row = next(line for line in reversed(page) if line.startswith(f"| {solver.name} "))
            absent += scene in row.split("|")[-2]
        assert lines + absent == len(SOLVERS)


def test_a_false_limit_cycle_is_marked_and_not_joined(drawn: list[Figure], tmp_path: Path) -> None:
    runs = [run for run in read(Run, "accuracy.csv") if run.scene == "reference"]
    accuracy.report(runs, SOLVERS).save(tmp_path)
    method = next(solver for solver in SOLVERS if "macro" in solver.setting)
    given = ("reference", method.name, method.setting, 1e-6)
    false = Run(*given, float("nan"), 0.123, 0, FALSE_CYCLE)
    accuracy.report([*runs, false], SOLVERS).save(tmp_path)
    before, after = (figure.axes[0].lines for figure in drawn)
    marks = [line for line in after if list(line.get_xdata()) == [0.123]]  # pyright: ignore
    assert len(after) == len(before) + 1 and [line.get_marker() for line in marks] == ["x"]
    assert "1 false limit cycle" in (tmp_path / "accuracy.md").read_text(encoding="utf-8")


def test_every_limit_is_drawn_and_in_the_page(drawn: list[Figure], tmp_path: Path) -> None:
    stability.report(read(Limit, "stability.csv")).save(tmp_path)
    table = (tmp_path / "stability.csv").read_text(encoding="utf-8")
    assert table == (RESULTS / "stability.csv").read_text(encoding="utf-8")
    page = (tmp_path / "stability.md").read_text(encoding="utf-8")
    assert page.count("\n") <= 60 and all(f"| {name} " in page for name in METHODS)
    legend = drawn[0].axes[0].get_legend()
    assert legend is not None
    said = " ".join(text.get_text() for text in legend.get_texts())
    assert all(name in said for name in METHODS)
    assert_legible(drawn[0])
