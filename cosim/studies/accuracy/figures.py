"""The figure of the accuracy study."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from matplotlib.axes import Axes

from cosim.studies.accuracy.cases import CASES
from cosim.studies.accuracy.runs import Run
from cosim.studies.plots import BLUE, FAINT, GREEN, PURPLE, SKY, VERMILION, End, label_ends, panels

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
    styles = dict(zip(strong.values(), zip(strong, _STYLES, strict=False), strict=True))
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
