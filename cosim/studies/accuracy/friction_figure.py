"""The diagrams of the friction laws: error in the machine, creep of a held part."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole
from cosim.studies.study import Row

_COLORS = {
    "Coulomb with events": "0.15",
    "tanh": "#d1495b",
    "Karnopp": "#1f4e79",
    "LuGre": "#3a8f5c",
}


def draw(held: Sequence[Row], moved: Sequence[Row], folder: Path) -> None:
    """Write ``friction.png`` into ``folder``."""
    figure = Figure(figsize=(11.0, 4.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for rows, axis, x, y in (
        (moved, left, "CPU time [s]", "error"),
        (held, right, "evaluations", "creep [um/s]"),
    ):
        for law, color in _COLORS.items():
            own = [row for row in rows if row["law"] == law]
            if not own:
                continue
            xs, ys = [row[x] for row in own], [row[y] for row in own]
            axis.loglog(xs, ys, color=color, marker="o", ms=4, label=law)
            for row, at in zip(own, zip(xs, ys, strict=True), strict=True):
                name = row["width"] if row["width"] != "-" else ""
                axis.annotate(name, at, (5, 4), textcoords="offset points", fontsize=8, color=color)
        axis.grid(alpha=0.3)
        axis.margins(x=0.25, y=0.1)
        axis.legend(fontsize=9)
    left.set_xscale("linear")
    left.set(xlabel="CPU time [s]", ylabel="error / range")
    left.set_title("scene stick-slip, solved by LSODA", loc="left", fontsize=11)
    right.set(xlabel="evaluations of the right-hand side", ylabel="creep [µm/s]")
    right.set_title("a held part; Coulomb with events: none", loc="left", fontsize=11)
    with whole(folder / "friction.png") as temporary:
        figure.savefig(temporary, format="png")
