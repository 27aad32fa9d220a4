"""A search as a picture: its path, where it listened, and what a small turn costs."""

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from cosim.evaluate.keys import numeric_key
from cosim.files.picture import Picture
from cosim.studies.tune.found import TURNS, Search
from cosim.waveforms.quantities import bench_unit, label, with_unit

COLORS = ("#1f6fb2", "#d1495b", "#2a9d8f", "#e9a03b", "#8d99ae", "#6a4c93")
MOST_KEYS = 4


def draw(tuning: Search) -> Picture:
    """The figure of a search."""
    figure = Picture(13.0, 8.0, "constrained")
    rows: Any = figure.subfigures(2, 1)
    top, bottom = rows
    unit, scale = bench_unit(tuning.quantity)
    ylabel = label(tuning.quantity, unit)
    values = np.array([np.nan if run.value is None else run.value for run in tuning.runs]) * scale
    number = np.arange(1, len(values) + 1)

    path_axis, turn_axis = top.subplots(1, 2)
    path_axis.scatter(number, values, c=number, cmap="viridis", s=14)
    ranked = values if tuning.largest else -values
    so_far = np.fmax.accumulate(ranked)
    path_axis.step(number, so_far if tuning.largest else -so_far, where="post", color="#d1495b")
    failed = number[~np.isfinite(values)]
    path_axis.plot(
        failed, np.full(len(failed), 0.02), "x", color="#d1495b", ms=6,
        transform=path_axis.get_xaxis_transform(),
    )  # fmt: skip
    path_axis.set(xlabel="run", ylabel=ylabel)
    words = "Every run, and the best so far" + (
        f"; {len(failed)} failed (×)" if len(failed) else ""
    )
    path_axis.set_title(words, loc="left", fontsize=10.5)

    assert tuning.best.value is not None
    turns = [*(turn * 100 for turn in TURNS), 0.0]
    order = np.argsort(turns)
    for (key, row), color in zip(tuning.neighbours.items(), COLORS * 3, strict=False):
        found = [np.nan if value is None else value * scale for value in row]
        heights = np.array([*found, tuning.best.value * scale])[order]
        turn_axis.plot(np.array(turns)[order], heights, color=color, marker="o", ms=4, label=key)
    turn_axis.set(xlabel="turned by [% of the key's range]", ylabel=ylabel)
    turn_axis.set_title("The neighbourhood of the best", loc="left", fontsize=10.5)
    if tuning.neighbours:
        turn_axis.legend(fontsize=8.5)

    keys = list(tuning.ranges)[:MOST_KEYS]
    for axis, key in zip(np.atleast_1d(bottom.subplots(1, len(keys))), keys, strict=True):
        settings = [run.values[key] for run in tuning.runs]
        shown = axis.scatter(settings, values, c=number, cmap="viridis", s=14)
        axis.axvline(tuning.best.values[key], color="#d1495b", lw=0.9)
        axis.set(xlabel=label(key, numeric_key(key).unit), ylabel=ylabel)
        axis.xaxis.set_major_locator(MaxNLocator(6))
        if key == keys[-1]:
            bottom.colorbar(shown, ax=axis, label="run")
    for axis in figure.axes:
        if axis.get_label() != "<colorbar>":
            axis.grid(alpha=0.25)
    best = with_unit(tuning.best.value * scale, unit, 4)
    figure.suptitle(
        f"{tuning.scene.name}: {tuning.quantity} {best} after {len(values)} runs"
        + (f", and {tuning.scouts} ahead, cheaper" if tuning.scouts else ""),
        fontsize=12,
    )
    return figure
