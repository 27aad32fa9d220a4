"""The figures of a fit: each trial, how good each µ_k is, normal forces with their intervals."""

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from cosim.files.picture import Picture
from cosim.studies.fit.results import Shown, Solved

SURFACE, MEASURED, SIMULATED = "#8fb8da", "0.15", "#d1495b"
DASHED = (0, (4, 1.2))
LARGEST_LOSS = 12.0  # on the axis


def draw_all(results: Solved, folder: Path) -> None:
    """Write every figure into a folder; a profile only where something was fitted."""
    trials(results).write(folder / "fit-trials.png")
    forces(results).write(folder / "fit-forces.png")
    if "profile" in results.numbers:
        profile(results).write(folder / "fit-profile.png")


def _words(result: dict[str, Any]) -> str:
    plate = f", µ_plate {result['mu_plate']:.3g}" if result["mu_plate"] else ""
    return f"{result['parameters']} parameters: µ_k {result['mu_k']:.3g}{plate}"


def trials(results: Solved) -> Picture:
    """Measured and simulated height of the part, and the surface's, a panel for each trial."""
    columns = min(2, len(results.shown))
    rows = math.ceil(len(results.shown) / columns)
    figure = Picture(13.0, 1.0 + 2.35 * rows, "constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    result = results.numbers
    for panel in zip(axes.flat, results.shown, result["trials"], strict=False):
        _trial(*panel)
    for axis in list(axes.flat)[len(results.shown) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("time [ms]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(
        f"Trials with {_words(result)}; mean error {result['mean_error_mm']:.3f} mm, "
        f"{result['mean_error_percent']:.2f} %",
        fontsize=12,
    )
    return figure


def _trial(axis: Axes, shown: Shown, row: dict[str, Any]) -> None:
    for time, z, label, color, width, dashes in (
        (shown.time, shown.z_surface, "surface, measured", SURFACE, 0.8, "-"),
        (shown.time, shown.z_part, "part, measured", MEASURED, 1.3, "-"),
        (*shown.simulated, "part, simulated", SIMULATED, 1.3, DASHED),
    ):
        axis.plot(time * 1e3, z * 1e3, label=label, color=color, lw=width, ls=dashes)
    axis.set_xlim(0, shown.time[-1] * 1e3)
    axis.grid(alpha=0.25)
    axis.set_ylabel("height [mm]")
    axis.set_title(
        f"{shown.name}: error {row['mean_error_mm']:.3f} mm, {row['mean_error_percent']:.1f} %; "
        f"F_n {row['normal_force_weights']:.2f} m g",
        loc="left",
        fontsize=10,
    )


def profile(results: Solved) -> Picture:
    """How much worse than the best each µ_k is, all else fitted anew."""
    result = results.numbers
    figure = Picture(9.0, 5.2, "constrained")
    axis = figure.subplots()
    line = result["profile"]["mu_k"]
    axis.plot(line, result["profile"]["loss"], color=SIMULATED, lw=1.8, marker=".", ms=4)
    low, high = result["mu_k_95_percent"]
    axis.axvspan(low, high, color="#f4e3c1", alpha=0.6, lw=0, label=f"95 %: {low:.3f} … {high:.3f}")
    axis.axvline(result["mu_k"], color="0.3", lw=0.9, ls=":", label=f"best: {result['mu_k']:.3f}")
    impacts = result["between_frames"] == "impacts"
    bound = "what bounds 95 %" if impacts else "5 % more error than the least"
    axis.axhline(1.0, color=SURFACE, lw=1.2, ls="--", label=bound)
    loss = "loss of log-likelihood" if impacts else "mean error above the least"
    axis.set(xlabel="µ_k", ylabel=f"{loss}, relative", xlim=(line[0], line[-1]))
    axis.set_ylim(0, LARGEST_LOSS)
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper left")
    axis.set_title(
        f"How well each µ_k explains the trials, all else fitted; {_words(result)}", fontsize=11
    )
    return figure


def forces(results: Solved) -> Picture:
    """Normal forces, trial by trial, with their intervals, measured ones and bounds."""
    result = results.numbers
    rows = result["trials"]
    figure = Picture(8.0, 4.6, "constrained")
    axis = figure.subplots()
    bounds: dict[str, Any] = {"color": SURFACE, "lw": 7.0, "alpha": 0.5}
    measured: dict[str, Any] = {"marker": "D", "ls": "", "mfc": "none", "color": MEASURED}
    drawn = set()
    for x, (force, row) in enumerate(zip(results.forces, rows, strict=True)):
        if force.lower is not None and force.upper is not None:
            axis.plot([x, x], [force.lower, force.upper], solid_capstyle="butt", **bounds)
            drawn.add("bounds")
        if force.measured is not None:
            axis.plot(x, force.measured, **measured)
            drawn.add("measured")
        found = row["normal_force_weights"]
        low, high = row.get("normal_force_95_percent", (found, found))
        axis.errorbar(
            x,
            found,
            [[max(0.0, found - low)], [max(0.0, high - found)]],
            fmt="o",
            color=SIMULATED,
            ms=6,
            capsize=4,
        )
    if "measured" in drawn:
        axis.plot([], [], label="measured", **measured)
    interval = " and 95 %" if "profile" in result else ""
    axis.plot([], [], "o", color=SIMULATED, ms=6, label=result["parameters"] + interval)
    if "bounds" in drawn:
        axis.plot([], [], label="bounds of the fit", **bounds)
    axis.set_xticks(range(len(rows)), [str(row["trial"]) for row in rows], fontsize=8)
    axis.set_ylim(0, None)
    axis.set(xlabel="trial", ylabel="normal force [m g]")
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper center", ncols=3)
    change = result["normal_force_change_mean_percent"]
    off = "" if change is None else f"; {change:.1f} % off the measured on average"
    axis.set_title(f"Normal forces, {_words(result)}{off}", fontsize=10)
    return figure
