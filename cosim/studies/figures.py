"""What the figures of all studies share."""

from pathlib import Path

from matplotlib.figure import Figure

from cosim.files.atomic import whole


def blank(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG."""
    with whole(path) as temporary:
        figure.savefig(temporary, format="png")
