"""The figures of the accuracy study, of the friction laws and of a chaotic scene."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path

from matplotlib.axes import Axes

from cosim.studies.accuracy.cases import CASES
from cosim.studies.accuracy.runs import Run
from cosim.studies.plots import BLUE, FAINT, GREEN, PURPLE, SKY, VERMILION, End, label_ends, panels
from cosim.studies.tables import Row

CREEP, ERROR = "creep of a held part [µm/s]", "error in the machine / range"
"""Columns of the study of friction laws, and the labels of its axes."""
_STYLES = tuple(zip((VERMILION, SKY, BLUE, GREEN, "black", PURPLE), "ovsDPX", strict=True))
"""Colours and markers of the strong lines, in their order."""


def draw_accuracy(runs: Sequence[Run], strong: Mapping[str, str], title: str, path: Path) -> None:
    """Draw error over CPU time, a panel a scene; ``strong`` are names of methods by label."""
    scenes = list(dict.fromkeys(run.scene for run in runs))
    wide = min(len(scenes), 2)
    high = -(-len(scenes) // wide)
    note = (
        "Grey: the other methods. ×: diverged; at the top edge: failed or in a false limit cycle."
    )
    figure, axes = panels(title, note, (5.5 * wide, 4.0 * high + 0.5), high, wide)
    for axis, scene in zip(axes, scenes, strict=True):
        _panel(axis, [run for run in runs if run.scene == scene], strong)
        axis.set_title(CASES[scene].title, fontsize=10.5, loc="left")
        axis.set(xlabel="CPU time [s]", ylabel="error / range")
    figure.write(path)


def _panel(axis: Axes, runs: Sequence[Run], strong: Mapping[str, str]) -> None:
    axis.set(xscale="log", yscale="log")
    ends: list[End] = []
    styles = dict(zip(strong.values(), zip(strong, _STYLES, strict=True), strict=True))
    for method in dict.fromkeys(run.method for run in runs):
        own = [run for run in runs if run.method == method]
        label, (color, marker) = styles.get(method, ("", ("0.6", "")))
        known = [run for run in own if run.counts]
        x, y = [run.seconds for run in known], [run.error for run in known]
        if label and known:
            axis.plot(x, y, color=color, marker=marker, ms=4.5, lw=2.0)
            ends.append(End(x[-1], y[-1], label, color))
        else:
            axis.plot(x, y, **FAINT)
        for run in own:
            if not run.counts:  # a failure without an error is marked at the top
                finite = isfinite(run.error)
                across = axis.transData if finite else axis.get_xaxis_transform()
                place = (run.seconds, run.error if finite else 0.97)
                axis.plot(*place, "x", color=color, ms=7, mew=1.8, transform=across)
    label_ends(axis, ends, gap=0.11)


_STATISTICS = {
    "v_average": ("mean velocity [mm/s]", 1e3),
    "stick_fraction": ("share of sticking [%]", 1e2),
    "impacts": ("impacts", 1.0),
    "stick_slip_events": ("changes of stick and slip", 1.0),
}
"""Labels, and factors to their units."""


def draw_chaos(
    ensembles: Mapping[str, Mapping[str, Sequence[float]]],
    average: Callable[[Sequence[float]], tuple[float, float]],
    title: str,
    path: Path,
) -> None:
    """Draw each method's values of each statistic: a tick a run, and their ``average``."""
    note = "One tick a run; dot and bar: their mean with two standard errors."
    figure, axes = panels(title, note, (11.0, 3.4), 1, len(_STATISTICS), sharey=True)
    for axis, (statistic, (label, scale)) in zip(axes, _STATISTICS.items(), strict=True):
        for place, one in enumerate(ensembles.values()):
            values = [scale * v for v in one[statistic]]
            middle, error = average(values)
            axis.plot(values, [place] * len(values), "|", color="0.55", ms=11)
            axis.errorbar(middle, place, xerr=2 * error, fmt="o", color=BLUE, capsize=4, lw=2)
        axis.locator_params(axis="x", nbins=4)
        axis.set(xlabel=label, ylim=(len(ensembles) - 0.4, -0.6))
    axes[0].set_yticks(range(len(ensembles)), list(ensembles))
    figure.write(path)


def draw_friction(rows: Sequence[Row], title: str, path: Path) -> None:
    """Draw what a held part creeps with each law, and the error in the whole machine."""
    note = "µm/s: width of the smoothed law; kN/m: stiffness of its bristle."
    figure, axes = panels(title, note, (11.0, 4.2), 1, 2, sharey=True)
    places = range(len(rows))
    laws = dict.fromkeys(row["law"] for row in rows)
    colors = dict(zip(laws, ("black", VERMILION, BLUE, GREEN), strict=True))
    for axis, column in zip(axes, (CREEP, ERROR), strict=True):
        values = [row[column] for row in rows]
        axis.set(xscale="log", ylim=(len(rows) - 0.5, -0.5), xlabel=column)
        known = [value for value in values if value > 0.0]
        axis.set_xlim(min(known) / 3.0, max(known) * 3.0)
        for place, row, value in zip(places, rows, values, strict=True):
            if value > 0.0:
                axis.plot(value, place, "o", color=colors[row["law"]], ms=8)
            else:
                said = "none" if value == 0.0 else "not solvable by LSODA"
                axis.annotate(said, (0.02, place), xycoords=axis.get_yaxis_transform(), va="center")
    axes[0].set_yticks(places, [f"{row['law']}  {row['width']}" for row in rows])
    figure.write(path)
