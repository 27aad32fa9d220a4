"""The figures of a fit: each trial, the profile over µ_k, fitted against measured normal forces."""

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from cosim.files.picture import Picture
from cosim.mechanics.part import PartMotion
from cosim.studies.fit.cases import Case
from cosim.studies.fit.search import Fit, Solved

SURFACE, MEASURED, SIMULATED = "#8fb8da", "0.15", "#d1495b"
DASHED = (0, (4, 1.2))


def draw_all(results: Solved, folder: Path) -> None:
    """Write every figure into a folder; a profile only where something was fitted."""
    trials(results).write(folder / "fit-trials.png")
    forces(results).write(folder / "fit-forces.png")
    if results.fit:
        profile(results, results.fit).write(folder / "fit-profile.png")


def _words(result: dict[str, Any]) -> str:
    plate = f", µ_p {result['mu_plate']:.3g}" if result["mu_plate"] else ""
    solver = "exact solution" if result["solver"] == "exact" else "the authors' scheme"
    return f"{result['parameters']} parameters, {solver}: µ_k {result['mu_k']:.3g}{plate}"


def trials(results: Solved) -> Picture:
    """Measured and simulated height of the part, and the surface's, a panel for each trial."""
    columns = min(2, len(results.cases))
    rows = math.ceil(len(results.cases) / columns)
    figure = Picture(13.0, 1.0 + 2.35 * rows, "constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    result = results.numbers
    shown = zip(axes.flat, results.cases, results.motions, result["trials"], strict=False)
    for panel in shown:
        _trial(*panel)
    for axis in list(axes.flat)[len(results.cases) :]:
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


def _trial(axis: Axes, case: Case, motion: PartMotion, row: dict[str, Any]) -> None:
    name = f"Trial {row['trial']}" if case.trial.number is not None else case.trial.name
    for time, z, label, color, width, dashes in (
        (case.time, case.z_surface, "surface, measured", SURFACE, 0.8, "-"),
        (case.time, case.z_part, "part, measured", MEASURED, 1.3, "-"),
        (motion.time, motion.z, "part, simulated", SIMULATED, 1.3, DASHED),
    ):
        axis.plot(time * 1e3, z * 1e3, label=label, color=color, lw=width, ls=dashes)
    axis.set_xlim(0, case.time[-1] * 1e3)
    axis.grid(alpha=0.25)
    axis.set_ylabel("height [mm]")
    axis.set_title(
        f"{name}: error {row['mean_error_mm']:.3f} mm, {row['mean_error_percent']:.1f} %; "
        f"F_n {row['normal_force_weights']:.2f} m g",
        loc="left",
        fontsize=10,
    )


def profile(results: Solved, fit: Fit) -> Picture:
    """The mean error over µ_k, each normal force fitted anew, and the error of each trial."""
    result = results.numbers
    figure = Picture(9.0, 5.2, "constrained")
    axis = figure.subplots()
    line, error = fit.profile()
    each = fit.errors[fit.at_best_plate]
    axis.plot(
        line, each * 1e3, color="0.75", lw=0.7, label=["each trial", *[""] * (each.shape[1] - 1)]
    )
    axis.plot(line, error * 1e3, color=SIMULATED, lw=1.8, marker=".", ms=4, label="mean")
    low, high = result["mu_k_95_percent"]
    axis.axvspan(low, high, color="#f4e3c1", alpha=0.6, lw=0, label="95 % of resampled trials")
    axis.axvline(fit.mu_k, color="0.3", lw=0.9, ls=":", label=f"best: µ_k = {fit.mu_k:.3f}")
    straight = result["straight_line_mean_error_mm"]
    axis.axhline(straight, color=SURFACE, lw=1.2, ls="--", label="straight line through each trial")
    axis.set(xlabel="µ_k", ylabel="mean error [mm]", xlim=(line[0], line[-1]))
    axis.set_ylim(0, min(1.15 * float(each.max()), 6 * float(error.min())) * 1e3)
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper left")
    axis.set_title(f"Error over µ_k, every normal force fitted; {_words(result)}", fontsize=11)
    return figure


def forces(results: Solved) -> Picture:
    """Fitted against measured normal forces, trial by trial, with the bounds of the fit."""
    result = results.numbers
    rows = result["trials"]
    figure = Picture(8.0, 4.6, "constrained")
    axis = figure.subplots()
    bounds: dict[str, Any] = {"color": SURFACE, "lw": 7.0, "alpha": 0.5}
    measured: dict[str, Any] = {"marker": "D", "ls": "", "mfc": "none", "color": MEASURED}
    for x, (case, row) in enumerate(zip(results.cases, rows, strict=True)):
        axis.plot([x, x], case.bounds, solid_capstyle="butt", **bounds)
        if row["normal_force_measured_weights"] is not None:
            axis.plot(x, row["normal_force_measured_weights"], **measured)
        axis.plot(x, row["normal_force_weights"], "o", color=SIMULATED, ms=6)
    axis.plot([], [], label="measured", **measured)
    axis.plot([], [], "o", color=SIMULATED, ms=6, label=result["parameters"])
    axis.plot([], [], label="bounds of the fit", **bounds)
    axis.set_xticks(range(len(rows)), [str(row["trial"]) for row in rows])
    axis.set_ylim(0, None)
    axis.set(xlabel="trial", ylabel="normal force [m g]")
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper center", ncols=3)
    change = result["normal_force_change_mean_percent"]
    off = "" if change is None else f"; {change:.1f} % off on average"
    axis.set_title(f"Normal forces, {_words(result)}{off}", fontsize=10)
    return figure
