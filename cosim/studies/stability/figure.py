"""The figure of the stability study."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole
from cosim.studies.stability.machines import DIRECT, PAPER, STRONG

if TYPE_CHECKING:
    from cosim.studies.stability.stability import Map, Sweep

COLORS = ("#8fb8da", "#2f6fa7", "#f0b27a", "#c8641b", "#3a8f5c", "#7d3c98")


def draw(sweep: "Sweep", grid: "Map", path: Path) -> None:
    """Limits over the strength of the coupling, and the map over both time constants."""
    figure = Figure(figsize=(12.0, 5.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _limits(left, sweep)
    _map(figure, right, grid)
    with whole(path) as temporary:
        figure.savefig(temporary, format="png")


def _limits(axis: Axes, sweep: "Sweep") -> None:
    for color, (name, steps) in zip(COLORS, sweep.predicted.items(), strict=True):
        axis.loglog(sweep.strength, steps * 1e3, color=color, lw=1.6, label=name)
        axis.loglog(sweep.strength, sweep.observed[name] * 1e3, "o", color=color, ms=5)
    at = DIRECT.force_factor**2 / (DIRECT.mass(False) * DIRECT.loop)
    axis.axvline(at, color="0.5", lw=0.9, ls="--")
    axis.axhline(1.0, color="0.5", lw=0.9, ls=":")
    axis.annotate(
        "direct drive", (at, 0.13), xytext=(4, 0), textcoords="offset points", color="0.35"
    )
    axis.set(
        xlabel="strength of the coupling Bl²/(m R) [1/s]",
        ylabel="largest stable macro step [ms]",
        ylim=(0.1, 160.0),
    )
    axis.set_title("Lines: predicted; dots: observed with the FMU", fontsize=11, loc="left")
    axis.legend(fontsize=9, loc="lower left", framealpha=0.9)
    axis.grid(alpha=0.3)


def _map(figure: Figure, axis: Axes, grid: "Map") -> None:
    x, y = grid.mechanical * 1e3, grid.electrical * 1e3
    filled = axis.pcolormesh(
        x, y, np.log10(grid.step * 1e3), cmap="viridis", shading="gouraud", vmin=-1.0, vmax=2.0
    )
    levels = [-0.5, 0.0, 0.5, 1.0, 1.5]
    lines = axis.contour(
        x, y, np.log10(grid.step * 1e3), levels, colors="white", linewidths=0.9, linestyles="-"
    )
    axis.clabel(lines, fmt=lambda v: f"{10**v:.2g} ms", fontsize=9)
    for machine in (DIRECT, STRONG, PAPER):
        slow = machine.mass(False) * machine.loop / machine.force_factor**2
        place = (slow * 1e3, machine.inductance / machine.loop * 1e3)
        axis.plot(*place, "o", color="#d1495b", mec="white", ms=7)
        inward = -7 if machine is PAPER else 7
        axis.annotate(
            machine.name,
            place,
            xytext=(inward, 6),
            textcoords="offset points",
            color="0.15" if machine is PAPER else "white",
            ha="right" if machine is PAPER else "left",
        )
    axis.set(xscale="log", yscale="log", xlabel="m R/Bl² [ms]", ylabel="electrical L/R [ms]")
    axis.set_title("Gauss-Seidel k = 1: largest stable step", fontsize=11, loc="left")
    bar = figure.colorbar(filled, ax=axis, label="largest stable macro step [ms]")
    bar.set_ticks([-1, 0, 1, 2], labels=["0.1", "1", "10", "100"])
