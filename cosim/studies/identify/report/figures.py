"""The figures of an identification."""

from collections.abc import Callable

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from cosim.files.picture import Picture, grid
from cosim.scene import KEYS
from cosim.studies.identify.problem.space import OF_LAWS
from cosim.studies.identify.report.solved import KINDS, Solved, shown
from cosim.studies.identify.report.verdicts import TRUSTED, forces
from cosim.studies.plots import headline, legend
from cosim.studies.report import Row
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.quantities import label as labelled
from cosim.waveforms.quantities import percent

MEASURED, SIMULATED, OTHER, FLOOR = "0.15", "#d1495b", "#1f6fb2", "#2a9d8f"

VELOCITY = "nrmse_v_surface"
"""The error that the figures' titles report."""

COMPARED = (
    (VELOCITY, "floor_late", "Velocity of the surface, NRMSE (black: between its own cycles)"),
    ("nrmse_z_surface", "", "Height of the surface, NRMSE"),
    ("part_error_mm", "straight_line_error_mm", "Part, mean error [mm] (black: straight line)"),
    (
        *("v_average_mm_per_s", "v_average_measured_mm_per_s"),
        "Mean velocity of the part [mm/s] (black: measured)",
    ),
)
"""For each panel the names in ``identify.json`` of its bars and its black marks, and its title."""


def overlays(found: Solved) -> Picture:
    """A row for each trial: velocity and height of the surface, height of the part."""
    trials = [*found.trials, *found.apart]
    owns, rig = [*found.best.own, *found.apart_own], found.best.rig
    rows = {row["trial"]: row for row in [*found.numbers["trials"], *found.numbers["apart"]]}
    figure, axes = grid(3 * len(trials), 3, 15.0, 2.1, 0.8)
    for k, (trial, own) in enumerate(zip(trials, owns, strict=True)):
        simulated, row, time = shown(trial, rig, own), rows[trial.label], trial.fine.time * 1e3
        whose = f"Trial {trial.label}{' (not fitted)' if trial in found.apart else ''}"
        for axis, name, unit, scale, error, of in (
            (axes[3 * k], "v_surface", "m/s", 1.0, "nrmse_v_surface", "NRMSE {:.2f}"),
            (axes[3 * k + 1], "z_surface", "mm", 1e3, "nrmse_z_surface", "NRMSE {:.2f}"),
            (axes[3 * k + 2], "z_part", "mm", 1e3, "part_error_mm", "mean error {:.3f} mm"),
        ):
            if name not in simulated:
                axis.set_visible(False)
                continue
            for values, style in (
                (trial.fine.signals[name], {"color": MEASURED, "lw": 1.3, "label": "measured"}),
                (simulated[name], {"color": SIMULATED, "lw": 0.9, "label": "identified rig"}),
            ):
                axis.plot(time, values * scale, **style)
            what = f"{whose}: {COLUMNS[name].text} [{unit}], {of.format(row[error])}"
            axis.set_title(what, loc="left", fontsize=9)
    for axis in axes[-3:]:
        axis.set_xlabel("time [ms]")
    legend(figure, axes[:1], loc="outside upper right", ncols=2)
    told = [1.0 - rows[trial.label][VELOCITY] ** 2 for trial in found.trials]
    whole = " to ".join(dict.fromkeys(map(percent, (min(told), max(told)))))
    headline(figure, f"One rig explains {whole} of the variance of the surface's velocity")
    return figure


def errors(found: Solved) -> Picture:
    """Errors of each trial beside the floor of its own repeatability, and with held-out rigs."""
    numbers, rows = found.numbers, found.numbers["trials"]
    at, names = np.arange(len(rows)), [row["trial"] for row in rows]
    series = [("identified rig", SIMULATED, rows)]
    held = {one["trial"]: one for one in numbers["held_out"]}
    for kind, color in zip(KINDS, (OTHER, "#8fb8da"), strict=True):
        words = f"held out, drive from {kind.replace('_', ' ')}"
        if held:
            series.append((words, color, [held[name][kind] for name in names]))
    figure, axes = grid(4, 2, 13.0, 4.0, 0.0)
    for axis, (name, beside, title) in zip(axes, COMPARED, strict=True):
        width = 0.8 / len(series)
        for k, (label, color, source) in enumerate(series):
            values = [row.get(name, np.nan) for row in source]
            axis.bar(at + (k + 0.5) * width - 0.4, values, width, color=color, label=label)
        values = [row.get(beside) or np.nan for row in rows]
        axis.plot(at, values, color="k", ls="", marker="_", ms=22, mew=2)
        axis.set_xticks(at, names)
        axis.set_title(title, loc="left", fontsize=10.5)
        axis.grid(visible=False, axis="x")
        axis.set_xlabel("trial")
    legend(figure, axes[:1], loc="outside lower center", ncols=4)
    message = f"The surface's velocity is {numbers['overall'][VELOCITY]:.2f} off (NRMSE)"
    if held:
        apart = numbers["held_out_overall"][KINDS[0]][VELOCITY]
        message += f", {apart:.2f} where the rig is of other trials"
    headline(figure, message)
    return figure


COLOURS = {"cubic": SIMULATED, "knee": OTHER, "repulsion": FLOOR}
"""Of the laws of the suspension."""


def rigs(found: Solved) -> Picture:
    """The suspension's force on each rig that may be the true one; a panel for each key with the
    rigs' costs over its values, the key's range shaded."""
    units, space = {key.full: key.unit for key in KEYS.values()}, found.best.space
    verdicts = {verdict.key: verdict for verdict in found.verdicts}
    names = [name for name in space.names if name not in OF_LAWS]
    figure, (first, *others) = grid(len(names) + 1, 4, 12.8, 2.8, 0.6)
    places = np.linspace(-2e-3, 2e-3, 81)
    for one in found.meant:
        law, settings = one.space.law, one.settings
        first.plot(places * 1e3, forces(one, places)[1], color=COLOURS[law], lw=0.8, label=law)
        for axis, name in zip(others, names, strict=True):
            axis.plot([settings[name]], [one.total], color=COLOURS[law], ls="", marker="x", ms=5)
    first.set_title("suspension, (F(q) - F(0))/Bl [A]", loc="left", fontsize=9)
    first.set_xlabel("q [mm]", fontsize=8)
    first.set_ylim(-1.0, 2.5)
    for axis, name in zip(others, names, strict=True):
        low, high = verdicts[name].low, verdicts[name].high
        if low is not None and high is not None:
            axis.axvspan(low, high, color="0.92", zorder=0)
        if space.log[space.names.index(name)]:
            axis.set_xscale("log")
            low, high = axis.get_xlim()
            decades = LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,))
            axis.xaxis.set_major_locator(decades if high > 5.0 * low else MaxNLocator(4))
            axis.xaxis.set_major_formatter("{x:.3g}")
            axis.xaxis.set_minor_formatter(NullFormatter())
        else:
            axis.locator_params(axis="x", nbins=4)
        named = labelled(name.partition(".")[2], units[name])
        axis.set_title(f"{named}: cost", loc="left", fontsize=9)
    for axis in (first, *others):
        axis.tick_params(labelsize=7)
    legend(figure, [first], loc="outside upper right", ncols=3)
    known = sum(verdict.kind == "identified" for verdict in found.verdicts)
    message = (
        f"The trials tell {known} of {len(names)} keys within {percent(TRUSTED)}; shaded: ranges"
    )
    headline(figure, message if found.numbers["converged"] else "Not converged: no range is told")
    return figure


def spectrum(found: Solved) -> Picture:
    """Where in frequency the measured velocity and the residual have their power."""
    every: dict[str, list[Row]] = {trial.label: [] for trial in found.trials}
    for row in found.numbers["bands"]:
        every[row["trial"]].append(row)
    figure, axes = grid(len(every), min(3, len(every)), 13.0, 2.4, 1.0)
    for axis, (name, rows) in zip(axes, every.items(), strict=True):
        at = np.arange(len(rows))
        for shift, of, color, label in (
            (-0.2, "measured", MEASURED, "measured velocity"),
            (0.2, "residual", SIMULATED, "residual"),
        ):
            axis.bar(at + shift, [row[of] for row in rows], 0.4, color=color, label=label)
        ends = [f"{row['from_hz']:.0f}–{row['to_hz']:.0f}" for row in rows]
        axis.set_xticks(at, ends, fontsize=7)
        axis.set_yscale("log")
        axis.set_ylim(1e-4, 1.5)
        axis.grid(visible=False, axis="x")
        axis.set_title(f"Trial {name}", loc="left", fontsize=9.5)
    legend(figure, axes[:1], loc="outside upper right", ncols=2)
    missed: dict[str, float] = {}
    for row in found.numbers["bands"]:
        band = f"{row['from_hz']:.0f} to {row['to_hz']:.0f} Hz"
        missed[band] = missed.get(band, 0.0) + row["residual"]
    most = max(missed, key=missed.__getitem__)
    share = missed[most] / sum(missed.values())
    headline(figure, f"{percent(share)} of what the rig misses of the velocity lies at {most}")
    figure.supylabel("share of the measured velocity's power", fontsize=10)
    figure.supxlabel("frequency [Hz]", fontsize=10)
    return figure


FIGURES: dict[str, Callable[[Solved], Picture]] = {
    "trials": overlays,
    "errors": errors,
    "rigs": rigs,
    "bands": spectrum,
}
"""By the end of their files' names."""
