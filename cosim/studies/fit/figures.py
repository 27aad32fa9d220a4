"""The figures of a fit: each trial, how good each friction is, normal forces with intervals."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

from cosim.files.picture import Picture, grid
from cosim.studies.fit.forces import Force
from cosim.studies.fit.results import Shown, headline
from cosim.studies.fit.search import LOSS
from cosim.studies.plots import legend

SURFACE, MEASURED, SIMULATED = "#8fb8da", "0.15", "#d1495b"
DASHED = (0, (4, 1.2))
LARGEST_LOSS = 12.0  # on the axis


def _words(result: dict[str, Any]) -> str:
    plate = f", µ_plate {result['mu_plate']:.3g}" if result["mu_plate"] else ""
    return f"{result['parameters']} parameters: µ_k {result['mu_k']:.3g}{plate}"


def trials(shown: Sequence[Shown], result: dict[str, Any]) -> Picture:
    """Measured heights of part and surface, and each slide as predicted, or the whole path with
    published parameters; a panel for each trial."""
    fitted = result["parameters"] == "fitted"
    columns = min(2, len(shown))
    figure, axes = grid(len(shown), columns, 6.5 * columns, 2.35, 1.0)
    said = "part, predicted in each slide" if fitted else "part, simulated"
    for axis, one, row in zip(axes, shown, result["trials"], strict=True):
        for time, z, label, color, width, dashes in (
            (one.time, one.z_surface, "surface, measured", SURFACE, 0.8, "-"),
            (one.time, one.z_part, "part, measured", MEASURED, 1.3, "-"),
            (*one.simulated, said, SIMULATED, 2.0, DASHED),
        ):
            axis.plot(time * 1e3, z * 1e3, label=label, color=color, lw=width, ls=dashes)
        axis.set(xlim=(0, one.time[-1] * 1e3), ylabel="height [mm]")
        title = _slides(row) if fitted else _whole_path(row)
        axis.set_title(f"{one.name}: {title}", loc="left", fontsize=10)
    for axis in axes[-columns:]:
        axis.set_xlabel("time [ms]")
    legend(figure, axes[:1], loc="outside lower center", ncols=3)
    if fitted:
        title = headline(result)
    else:
        error, percent = result["mean_error_mm"], result["mean_error_percent"]
        title = f"Trials with {_words(result)}; mean error {error:.3f} mm, {percent:.2f} %"
    figure.suptitle(fill(title, 60 * columns), fontsize=12)
    return figure


def _slides(row: dict[str, Any]) -> str:
    count = f"{row['slides']} slide{'' if row['slides'] == 1 else 's'}"
    if row["normal_force_weights"] is None:
        return f"not determined: {count}"
    return (
        f"F_n {row['normal_force_weights']:.2f} m·g from {count}, misfit {row['misfit_um']:.1f} µm "
        f"(noise {row['noise_um']:.1f} µm)"
    )


def _whole_path(row: dict[str, Any]) -> str:
    return (
        f"error {row['mean_error_mm']:.3f} mm, {row['mean_error_percent']:.1f} %; "
        f"F_n {row['normal_force_weights']:.2f} m·g"
    )


def profiles(result: dict[str, Any]) -> Picture:
    """How much less likely than the best each µ_k F_n of a trial is, all else fitted anew."""
    figure, (axis,) = grid(1, 1, 9.0, 5.2, 0.0)
    near = [0.0]
    style: dict[str, Any] = {"lw": 1.4, "marker": ".", "ms": 4}
    for (name, profile), row in zip(result["profiles"].items(), result["trials"], strict=True):
        if row["normal_force_weights"] is not None:
            axis.plot(profile["kinetic_friction_weights"], profile["loss"], label=name, **style)
            both = zip(profile["kinetic_friction_weights"], profile["loss"], strict=True)
            near += [friction for friction, loss in both if loss <= LARGEST_LOSS]
    axis.axhline(LOSS, color="0.3", lw=1.0, ls="--", label="90 %, of slides that do not scatter")
    axis.set_xlim(0.0, 1.1 * max(near) or 1.0)
    axis.set(xlabel="µ_k F_n [m·g]", ylabel="loss of log-likelihood", ylim=(0, LARGEST_LOSS))
    axis.legend(fontsize=8, frameon=False, ncols=2)
    axis.set_title(
        "How well each friction explains its trial, all else fitted; determined trials", fontsize=11
    )
    return figure


def forces(known: Sequence[Force], result: dict[str, Any]) -> Picture:
    """Normal forces, trial by trial, with their intervals, measured ones and bounds."""
    rows = result["trials"]
    figure, (axis,) = grid(1, 1, 8.0, 4.6, 0.0)
    bounds: Any = {"color": SURFACE, "lw": 7.0, "alpha": 0.5, "label": "bounds of the fit"}
    measured: dict[str, Any] = {"marker": "D", "ls": "", "mfc": "none", "color": MEASURED}
    interval = " and 90 %" if "profiles" in result else ""
    dots: dict[str, Any] = {"color": SIMULATED, "ms": 6, "label": result["parameters"] + interval}
    for x, (force, row) in enumerate(zip(known, rows, strict=True)):
        if force.lower is not None and force.upper is not None:
            axis.plot([x, x], [force.lower, force.upper], solid_capstyle="butt", **bounds)
        if force.measured is not None:
            axis.plot(x, force.measured, label="measured", **measured)
        found = row["normal_force_weights"]
        if found is None:
            axis.text(x, 0.0, " not determined", rotation=90, ha="center", va="bottom", fontsize=8)
            continue
        low, high = row.get("normal_force_90_percent", (found, found))
        reach = [[max(0.0, found - low)], [max(0.0, high - found)]]
        axis.errorbar(x, found, reach, fmt="o", capsize=4, **dots)
    axis.set_xticks(range(len(rows)), [str(row["trial"]) for row in rows], fontsize=8)
    axis.margins(y=0.2)  # room for the legend
    axis.set_xlim(-0.5, len(rows) - 0.5)
    axis.set_ylim(0, None)
    axis.set(xlabel="trial", ylabel="normal force [m·g]")
    legend(axis, [axis], fontsize=9, loc="upper center", ncols=3)
    change = result["normal_force_change_mean_percent"]
    off = "" if change is None else f"; {change:.1f} % off the measured on average"
    axis.set_title(f"Normal forces, {_words(result)}{off}", fontsize=10)
    return figure
