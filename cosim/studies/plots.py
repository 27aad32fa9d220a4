"""What the figures of the studies share: size, colours, labels at the ends of lines, saving."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis

from cosim.files.picture import Picture, grid

VERMILION, BLUE, GREEN = "#d55e00", "#0072b2", "#009e73"
ORANGE, SKY, PURPLE = "#e69f00", "#56b4e9", "#aa4499"
"""Okabe and Ito's colours, which the colour-blind tell apart; a darker purple."""
FAINT: dict[str, Any] = {"color": "0.74", "marker": ".", "ms": 4, "lw": 0.0, "zorder": 1}
"""Style of points that are there to be counted, not to be read."""
TIE = "\N{NO-BREAK SPACE}"


def headline(figure: Picture, message: str) -> None:
    """Write the message of a figure above it."""
    width = round(10.0 * figure.get_figwidth())
    tied = re.sub(r"(?<=\d) (?=[^\W\d]|%)", TIE, message)  # a number and its unit
    lines = "\n".join(fill(line, width) for line in tied.splitlines())
    figure.suptitle(lines.replace(TIE, " "), x=0.01, ha="left", fontsize=12, fontweight="bold")


def footnote(figure: Picture, note: str) -> None:
    """Write below a figure how to read it."""
    width = int(14.0 * figure.get_figwidth())
    lines = "\n".join(fill(line, width) for line in note.splitlines())
    figure.supxlabel(lines, x=0.01, ha="left", fontsize=9, color="0.35")


def panels(
    title: str,
    note: str,
    size: tuple[float, float],
    rows: int = 1,
    columns: int = 1,
    **options: Any,
) -> tuple[Picture, list[Axes]]:
    """A figure of ``size`` (inches) and its axes row by row.

    ``title`` is its message; ``note``, below, tells how to read it.
    """
    width, height = size
    figure, axes = grid(rows * columns, columns, width, height / rows, 0.0, **options)
    headline(figure, title)
    footnote(figure, note)
    for axis in axes:
        axis.set_axisbelow(True)
    return figure, axes


def keep_ticks_inside(*axes: Axis) -> None:
    """Drop the ticks beyond the ends of these x or y axes."""
    for one in axes:
        low, high = one.get_view_interval()
        one.set_ticks([tick for tick in one.get_ticklocs() if low <= tick <= high])


@dataclass(frozen=True)
class End:
    """A label for the line that ends at ``x``, ``y``."""

    x: float
    y: float
    text: str
    color: str


def label_ends(axis: Axes, ends: Sequence[End], gap: float = 0.07) -> None:
    """Name lines, all drawn by now, right of the axes; ``gap``, a share of these, keeps apart."""
    axis.autoscale_view()
    to_share = axis.transData + axis.transAxes.inverted()
    upward = sorted(ends, key=lambda end: end.y)
    placed: list[float] = []
    for end in upward:
        height = float(to_share.transform((end.x, end.y))[1])
        placed.append(max(height, placed[-1] + gap if placed else 0.0))
    for k in range(len(placed)):
        placed[k] = min(placed[k], 1.0 - gap * (len(placed) - 1 - k))
    for end, height in zip(upward, placed, strict=True):
        axis.annotate(
            end.text,
            (end.x, end.y),
            (1.02, height),
            textcoords="axes fraction",
            color=end.color,
            fontsize=9,
            va="center",
            arrowprops={"arrowstyle": "-", "color": end.color, "lw": 0.6, "relpos": (0.0, 0.5)},
            annotation_clip=False,
        )
