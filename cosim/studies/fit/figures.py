"""The figures of a fit: each trial, the profile over µ_k, fitted against measured normal forces."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole

if TYPE_CHECKING:
    from cosim.studies.fit.fit import Outcome

SURFACE, MEASURED, SIMULATED = "#8fb8da", "0.15", "#d1495b"


def draw_all(outcome: "Outcome", folder: Path) -> None:
    """Write every figure into a folder; a profile only where something was fitted."""
    figures = {"fit-trials": trials(outcome), "fit-forces": forces(outcome)}
    if outcome.fit:
        figures["fit-profile"] = profile(outcome)
    for name, figure in figures.items():
        with whole(folder / f"{name}.png") as temporary:
            figure.savefig(temporary, format="png")


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _words(outcome: "Outcome") -> str:
    result = outcome.result
    plate = f", µ_p {result['mu_plate']:.3g}" if result["mu_plate"] else ""
    solver = "exact solution" if result["solver"] == "exact" else "the authors' scheme"
    return f"{result['parameters']} parameters, {solver}: µ_k {result['mu_k']:.3g}{plate}"


def trials(outcome: "Outcome") -> Figure:
    """Measured and simulated height of the part, and the surface's, a panel for each trial."""
    columns = min(2, len(outcome.cases))
    rows = math.ceil(len(outcome.cases) / columns)
    figure = _figure(13.0, 1.0 + 2.35 * rows)
    axes = figure.subplots(rows, columns, squeeze=False)
    rows_of_results = outcome.result["trials"]
    for axis, case, motion, row in zip(
        axes.flat, outcome.cases, outcome.motions, rows_of_results, strict=False
    ):
        time = case.time * 1e3
        axis.plot(time, case.z_surface * 1e3, color=SURFACE, lw=0.8, label="surface, measured")
        axis.plot(time, case.z_part * 1e3, color=MEASURED, lw=1.3, label="part, measured")
        axis.plot(
            *(motion.time * 1e3, motion.z * 1e3),
            color=SIMULATED,
            lw=1.3,
            ls=(0, (4, 1.2)),
            label="part, simulated",
        )
        axis.set_xlim(0, time[-1])
        axis.grid(alpha=0.25)
        axis.set_ylabel("height [mm]")
        name = f"Trial {row['trial']}" if case.trial.number is not None else case.trial.name
        axis.set_title(
            f"{name}: error {row['mean_error_mm']:.3f} mm, {row['mean_error_percent']:.1f} %; "
            f"F_n {row['normal_force_weights']:.2f} m g",
            loc="left",
            fontsize=10,
        )
    for axis in list(axes.flat)[len(outcome.cases) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("time [ms]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    result = outcome.result
    figure.suptitle(
        f"Trials with {_words(outcome)}; mean error {result['mean_error_mm']:.3f} mm, "
        f"{result['mean_error_percent']:.2f} %",
        fontsize=12,
    )
    return figure


def profile(outcome: "Outcome") -> Figure:
    """The mean error over µ_k, each normal force fitted anew, and what each trial adds."""
    from cosim.studies.fit.fit import profile as of_fit

    fit, result = outcome.fit, outcome.result
    assert fit
    figure = _figure(9.0, 5.2)
    axis = figure.subplots()
    line, error = of_fit(fit)
    rows = fit.tried[:, 0] == fit.tried[fit.best, 0]
    for i, column in enumerate(fit.errors[rows].T):
        axis.plot(line, column * 1e3, color="0.75", lw=0.7, label="" if i else "each trial")
    axis.plot(line, error * 1e3, color=SIMULATED, lw=1.8, marker=".", ms=4, label="mean")
    low, high = result["mu_k_95_percent"]
    axis.axvspan(low, high, color="#f4e3c1", alpha=0.6, lw=0, label="95 % of resampled trials")
    axis.axvline(fit.mu_k, color="0.3", lw=0.9, ls=":", label=f"best: µ_k = {fit.mu_k:.3f}")
    axis.axhline(
        result["straight_line_mean_error_mm"],
        color=SURFACE,
        lw=1.2,
        ls="--",
        label="straight line through each trial",
    )
    axis.set(xlabel="µ_k", ylabel="mean error [mm]", xlim=(line[0], line[-1]))
    axis.set_ylim(0, min(1.15 * float(fit.errors[rows].max()), 6 * float(error.min())) * 1e3)
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper left")
    axis.set_title(f"Error over µ_k, every normal force fitted; {_words(outcome)}", fontsize=11)
    return figure


def forces(outcome: "Outcome") -> Figure:
    """Fitted against measured normal forces, trial by trial, with the bounds of the fit."""
    figure = _figure(8.0, 4.6)
    axis = figure.subplots()
    rows = outcome.result["trials"]
    for x, (case, row) in enumerate(zip(outcome.cases, rows, strict=True)):
        axis.plot([x, x], case.bounds, color=SURFACE, lw=7.0, alpha=0.5, solid_capstyle="butt")
        if row["normal_force_measured_weights"] is not None:
            axis.plot(x, row["normal_force_measured_weights"], "D", mfc="none", color=MEASURED)
        axis.plot(x, row["normal_force_weights"], "o", color=SIMULATED, ms=6)
    axis.plot([], [], "D", mfc="none", color=MEASURED, label="measured")
    axis.plot([], [], "o", color=SIMULATED, ms=6, label=outcome.result["parameters"])
    axis.plot([], [], color=SURFACE, lw=7.0, alpha=0.5, label="bounds of the fit")
    axis.set_xticks(range(len(rows)), [str(row["trial"]) for row in rows])
    axis.set_ylim(0, None)
    axis.set(xlabel="trial", ylabel="normal force [m g]")
    axis.grid(alpha=0.25)
    axis.legend(fontsize=9, frameon=False, loc="upper center", ncols=3)
    change = outcome.result["normal_force_change_mean_percent"]
    axis.set_title(
        f"Normal forces, {_words(outcome)}"
        + ("" if change is None else f"; {change:.1f} % off on average"),
        fontsize=10,
    )
    return figure
