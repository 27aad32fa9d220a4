"""Figures that need neither pyplot nor a screen."""

import math
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole


class Picture(Figure):
    """A matplotlib figure of ``width`` × ``height`` inches, which a notebook shows by itself."""

    def __init__(
        self, width: float, height: float, layout: Literal["constrained"] | None = None
    ) -> None:
        super().__init__(figsize=(width, height), dpi=110, layout=layout)
        self._agg = FigureCanvasAgg(self)  # savefig would draw twice

    def write(self, path: Path, texts: dict[str, str] | None = None) -> None:
        """Write the figure as a PNG with ``texts``, whole or not at all. Raises BadInput."""
        with whole(path) as temporary:
            self._agg.print_png(temporary, metadata=texts)

    def png(self) -> bytes:
        """The figure as a PNG."""
        content = BytesIO()
        self._agg.print_png(content)
        return content.getvalue()

    _repr_png_ = png


def legend_above(axis: Axes, **style: Any) -> None:
    """The legend on the right above the axes, where it covers no curve."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), frameon=False, **style)


def grid(
    count: int, columns: int, width: float, height: float, beside: float, **options: Any
) -> tuple[Picture, list[Axes]]:
    """A figure of ``count`` panels row by row, and their axes: ``width`` inches wide, each row
    ``height`` inches high, and ``beside`` inches for what stands above and below them."""
    rows = math.ceil(count / columns)
    figure = Picture(width, beside + height * rows, "constrained")
    axes = [*figure.subplots(rows, columns, squeeze=False, **options).flat]
    for axis in axes[:count]:
        axis.grid(alpha=0.25)
    for axis in axes[count:]:
        axis.set_visible(False)
    return figure, axes[:count]
