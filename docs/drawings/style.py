"""What the drawings share: colours, fonts, arrows, and how a picture is written."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK = "#1f2933"
GREY = "#7b8794"
PALE = "#e4e7eb"
ELECTRIC = "#b4540a"
MECHANIC = "#1f5fa8"
FORCE = "#a61b1b"

IMAGES = Path(__file__).parents[1] / "img"

plt.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "font.size": 11,
        "mathtext.fontset": "dejavusans",
        "svg.fonttype": "path",  # the same picture where the font is missing
        "svg.hashsalt": "cosim",  # the same file from the same program
        "text.color": INK,
        "axes.edgecolor": INK,
        "lines.solid_capstyle": "round",
    }
)


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """A sheet of ``width`` by ``height`` cm; its coordinates are cm from the lower left."""
    figure = plt.figure(figsize=(width / 2.54, height / 2.54))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.axis("off")
    return figure, axes


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str, **more: Any
) -> None:
    """A straight arrow from ``start`` to ``end``."""
    look = {"arrowstyle": "-|>,head_width=0.2,head_length=0.4", "lw": 1.8} | more
    axes.annotate("", end, start, arrowprops={"color": color, "shrinkA": 0, "shrinkB": 0} | look)


def write(figure: Figure, name: str) -> None:
    """``docs/img/NAME.svg``, without the date."""
    IMAGES.mkdir(exist_ok=True)
    figure.savefig(IMAGES / f"{name}.svg", facecolor="white", metadata={"Date": None})
    plt.close(figure)
