"""What the figures of the studies share: size, colours, titles and notes."""

import re
from collections.abc import Sequence
from math import ceil
from textwrap import fill
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from cosim.files.picture import Picture, grid

VERMILION, BLUE, GREEN = "#d55e00", "#0072b2", "#009e73"
ORANGE, SKY, PURPLE = "#e69f00", "#56b4e9", "#aa4499"
"""Okabe and Ito's colours, which the colour-blind can distinguish, but a darker purple."""
FAINT: dict[str, Any] = {"color": "0.74", "marker": ".", "ms": 4, "lw": 0.0, "zorder": 1}
"""Style of background points: many, whose single values do not matter."""
TIE = "\N{NO-BREAK SPACE}"
"""Joins a number and its unit while lines are filled."""


def headline(figure: Picture, message: str) -> None:
    """Write the message of a figure above it, in lines as wide as the figure."""
    width = round(10.0 * figure.get_figwidth())
    tied = re.sub(r"(?<=\d) (?=[^\W\d]|%)", TIE, message)  # between a number and its unit
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
    count: int = 1,
    columns: int = 0,
    **options: Any,
) -> tuple[Picture, list[Axes]]:
    """A figure of ``size`` (inches) and the axes of its ``count`` panels row by row, in one row
    without ``columns``. ``title`` is its message; ``note``, below, tells how to read it."""
    width, height = size
    columns = columns or count
    figure, axes = grid(count, columns, width, height / ceil(count / columns), 0.0, **options)
    headline(figure, title)
    footnote(figure, note)
    for axis in axes:
        axis.set_axisbelow(True)
    return figure, axes


def legend(on: Picture | Axes, axes: Sequence[Axes], **style: Any) -> None:
    """Add one legend without a frame, with each label of these axes once."""
    named: dict[str, Artist] = {}
    for axis in axes:
        named |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    on.legend(named.values(), named, frameon=False, **style)


def keep_ticks_inside(*axes: Axis) -> None:
    """Drop the ticks beyond the ends of these x or y axes."""
    for axis in axes:
        low, high = axis.get_view_interval()
        axis.set_ticks([tick for tick in axis.get_ticklocs() if low <= tick <= high])
