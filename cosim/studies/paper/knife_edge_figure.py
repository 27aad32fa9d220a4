"""The figure of the knife edge: v_ave over the timing error and over the normal force."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.files.picture import Picture

COLORS = ("#1f6fb2", "#2a9d8f", "#e9a03b", "#d1495b")
STYLES = ("-", "--", "-", "-")


def draw(
    path: Path,
    errors: npt.NDArray[np.float64],
    over_error: Mapping[str, Sequence[float]],
    best: float,
    ratios: npt.NDArray[np.float64],
    over_force: Mapping[str, Sequence[float]],
    theory: Sequence[float],
) -> None:
    """v_ave, m/s, over the timing error (periods) and over f_n, one line a method, into a PNG."""
    figure = Picture(13.0, 4.8, "constrained")
    left, right = figure.subplots(1, 2)
    left.axhline(best * 1e3, color="0.2", lw=3.0, alpha=0.3, label="closed form")
    right.plot(ratios, np.array(theory) * 1e3, color="0.2", lw=4.0, alpha=0.3, label="closed form")
    for (name, curve), color, style in zip(over_error.items(), COLORS, STYLES, strict=True):
        left.plot(errors, np.array(curve) * 1e3, color=color, ls=style, lw=1.4, label=name)
        speeds = np.array(over_force[name]) * 1e3
        right.plot(ratios, speeds, color=color, ls=style, lw=1.4, label=name)
    left.set_xscale("symlog", linthresh=1e-9, linscale=0.4)
    left.set_xticks([-1e-2, -1e-4, -1e-6, -1e-8, 0, 1e-8, 1e-6, 1e-4, 1e-2])
    left.set(
        xlabel="first phase ends later than the optimum by [periods]",
        title="A part that meets the surface early loses most of the transport",
    )
    right.set(
        xlabel="normal force over the part's weight, f_n",
        title="A solver with a velocity threshold meets it early by itself",
    )
    for axis in (left, right):
        axis.set_ylabel("mean velocity of the part [mm/s]")
        axis.grid(alpha=0.25)
        axis.axhline(0.0, color="0.5", lw=0.6)
        axis.legend(fontsize=8)
    figure.write(path)
