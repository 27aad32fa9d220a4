"""The figures of an identification."""

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from cosim.files.picture import Picture
from cosim.scene import keys
from cosim.studies.identify.problem.space import OF_LAWS
from cosim.studies.identify.report.measures import shown
from cosim.studies.identify.report.solved import Solved
from cosim.studies.identify.report.verdicts import forces

MEASURED, SIMULATED, OTHER, FLOOR = "0.15", "#d1495b", "#1f6fb2", "#2a9d8f"

COMPARED = (
    ("nrmse_v_surface", "floor_late", "Velocity, NRMSE (black: its own cycles among themselves)"),
    ("nrmse_z_surface", "", "Height of the surface, NRMSE"),
    ("part_error_mm", "straight_line_error_mm", "Part, mean error [mm] (black: straight line)"),
    (
        *("v_average_mm_per_s", "v_average_measured_mm_per_s"),
        "Mean velocity of the part [mm/s] (black: measured)",
    ),
)
"""What the bars of a panel are, and what its black marks, by their names in ``identify.json``."""


def overlays(found: Solved) -> Picture:
    """A row for each trial: velocity and height of the surface, height of the part."""
    trials = [*found.trials, *found.apart]
    owns = [*found.best.own, *found.apart_own]
    rig = found.space.rigs(found.best.place[None])[0]
    rows = {row["trial"]: row for row in [*found.numbers["trials"], *found.numbers["apart"]]}
    figure = Picture(15.0, 0.8 + 2.1 * len(trials), "constrained")
    axes = figure.subplots(len(trials), 3, squeeze=False)
    panels = (("v_surface", "m/s", 1.0), ("z_surface", "mm", 1e3), ("z_part", "mm", 1e3))
    for trial, own, line in zip(trials, owns, axes, strict=True):
        simulated, row = shown(trial, rig, own), rows[trial.label]
        for axis, (name, unit, scale) in zip(line, panels, strict=True):
            if name not in simulated:
                axis.set_visible(False)
                continue
            measured, time = trial.fine.signals[name], trial.fine.time * 1e3
            axis.plot(time, measured * scale, color=MEASURED, lw=1.3, label="measured")
            axis.plot(
                time, simulated[name] * scale, color=SIMULATED, lw=0.9, label="identified rig"
            )
            body = "Part" if name.endswith("part") else "Surface"
            said = (
                f"error {row['part_error_mm']:.3f} mm"
                if body == "Part"
                else (f"NRMSE {row[f'nrmse_{name}']:.2f}")
            )
            apart = " (not fitted)" if trial in found.apart else ""
            axis.set_title(
                f"Trial {trial.label}{apart}: {body.lower()}, {said}", loc="left", fontsize=9
            )
            axis.set_ylabel(unit)
            axis.grid(alpha=0.25)
    for axis in axes[-1]:
        axis.set_xlabel("time [ms]")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False
    )
    return figure


def errors(found: Solved) -> Picture:
    """Errors of each trial beside the floor of its own repeatability and beside other rigs."""
    numbers = found.numbers
    rows = numbers["trials"]
    at, names = np.arange(len(rows)), [row["trial"] for row in rows]
    series = [("rig of the defaults, best drives", "0.75", numbers["made_up_rig"]["trials"])]
    series.append(("identified rig", SIMULATED, rows))
    held = {one["trial"]: one for one in numbers["held_out"]}
    for kind, color in (("surface", OTHER), ("surface_and_part", "#8fb8da")):
        words = f"held out, drive from {kind.replace('_', ' ')}"
        if held:
            series.append((words, color, [held[name][kind] for name in names]))
    figure = Picture(13.0, 8.0, "constrained")
    axes = figure.subplots(2, 2)
    for axis, (name, beside, title) in zip(axes.flat, COMPARED, strict=True):
        width = 0.8 / len(series)
        for k, (label, color, source) in enumerate(series):
            values = [row.get(name, np.nan) for row in source]
            axis.bar(at + (k + 0.5) * width - 0.4, values, width, color=color, label=label)
        values = [row.get(beside) or np.nan for row in rows]
        axis.plot(at, values, color="k", ls="", marker="_", ms=22, mew=2)
        axis.set_xticks(at, names)
        axis.set_title(title, loc="left", fontsize=10.5)
        axis.grid(axis="y", alpha=0.25)
        axis.set_xlabel("trial")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    return figure


COLOURS = {"cubic": SIMULATED, "knee": OTHER, "repulsion": FLOOR}
"""Of the laws of the suspension."""


def rigs(found: Solved) -> Picture:
    """The suspension's force on each rig that may be meant, and their costs over each key."""
    units = {key.full: key.unit for key in keys()}
    names = [name for name in found.space.names if name not in OF_LAWS]
    panels, columns = len(names) + 1, 4
    figure = Picture(3.2 * columns, 2.8 * math.ceil(panels / columns) + 0.6, "constrained")
    axes = figure.subplots(math.ceil(panels / columns), columns, squeeze=False)
    first, *others = axes.flat
    places = np.linspace(-2e-3, 2e-3, 81)
    for space, one in found.meant:
        colour = COLOURS[space.law]
        force = forces((space, one), places)[1]
        first.plot(places * 1e3, force, color=colour, lw=0.8, label=space.law)
        values = dict(zip(space.names, space.values(one.place).tolist(), strict=True))
        for axis, name in zip(others, names, strict=False):
            axis.plot([values[name]], [one.total], color=colour, ls="", marker="x", ms=5)
    first.set_title("suspension, (F(q) - F(0))/Bl [A]", loc="left", fontsize=9)
    first.set_xlabel("q [mm]", fontsize=8)
    first.set_ylim(-1.0, 2.5)
    for axis, name in zip(others, names, strict=False):
        if found.space.log[found.space.names.index(name)]:
            axis.set_xscale("log")
            low, high = axis.get_xlim()
            many = high > 5.0 * low
            axis.xaxis.set_major_locator(
                LogLocator(subs=(1.0, 2.0, 5.0)) if many else MaxNLocator(4)
            )
            axis.xaxis.set_major_formatter("{x:.3g}")
            axis.xaxis.set_minor_formatter(NullFormatter())
        else:
            axis.locator_params(axis="x", nbins=4)
        unit = "" if units[name] in ("1", "") else f" [{units[name]}]"
        axis.set_title(f"{name.partition('.')[2]}{unit}: cost", loc="left", fontsize=9)
    for axis in axes.flat:
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=7)
    for axis in [*axes.flat][panels:]:
        axis.set_visible(False)
    handles, labels = first.get_legend_handles_labels()
    each = dict(zip(labels, handles, strict=True))
    figure.legend([*each.values()], [*each], loc="outside upper right", ncols=3, frameon=False)
    return figure


def spectrum(found: Solved) -> Picture:
    """Where in frequency the measured velocity and the residual have their power."""
    names = [trial.label for trial in found.trials]
    figure = Picture(13.0, 1.0 + 2.4 * math.ceil(len(names) / 3), "constrained")
    axes = figure.subplots(math.ceil(len(names) / 3), min(3, len(names)), squeeze=False)
    for axis, name in zip(axes.flat, names, strict=False):
        rows = [row for row in found.numbers["bands"] if row["trial"] == name]
        _bands(axis, rows)
        axis.set_title(f"Trial {name}", loc="left", fontsize=9.5)
    for axis in [*axes.flat][len(names) :]:
        axis.set_visible(False)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False
    )
    figure.supylabel("share of the measured velocity's power", fontsize=10)
    figure.supxlabel("frequency [Hz]", fontsize=10)
    return figure


def _bands(axis: Axes, rows: list[dict[str, float]]) -> None:
    at = np.arange(len(rows))
    axis.bar(
        at - 0.2, [row["measured"] for row in rows], 0.4, color=MEASURED, label="measured velocity"
    )
    axis.bar(at + 0.2, [row["residual"] for row in rows], 0.4, color=SIMULATED, label="residual")
    axis.set_xticks(at, [f"{row['from_hz']:.0f}–{row['to_hz']:.0f}" for row in rows], fontsize=7)
    axis.set_yscale("log")
    axis.set_ylim(1e-4, 1.5)
    axis.grid(axis="y", alpha=0.25)


FIGURES: dict[str, Callable[[Solved], Picture]] = {
    "trials": overlays,
    "errors": errors,
    "rigs": rigs,
    "bands": spectrum,
}
"""By the end of their files' names."""
