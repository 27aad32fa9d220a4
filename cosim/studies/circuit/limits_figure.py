"""The figure of the limits: what each costs, what turning it does, and what the walls do."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from cosim.files.picture import Picture
from cosim.studies.circuit.limits import Study, name_of

COLORS = {
    "binds": "#d1495b", "acts a little": "#e9a03b", "does not matter": "#8d99ae",
    "another motion": "#cfe3f5", "could not be lifted": "#ffffff",
}  # fmt: skip
LINES = (
    *("#1f6fb2", "#d1495b", "#2a9d8f", "#e9a03b", "#6a4c93"),
    *("#333333", "#8d99ae", "#b5651d", "#e07be0"),
)


def draw(studies: Sequence[Study], path: Path) -> None:
    """Draw the studies, the turned limits of the first one, into ``path`` (a PNG)."""
    turned = bool(studies[0].turned)
    figure = Picture(13.0, 9.0 if turned else 4.6, "constrained")
    rows: Any = figure.subfigures(2 if turned else 1, 1, squeeze=False)[:, 0]
    order = studies[0].ranked()[::-1]
    columns = np.atleast_1d(rows[0].subplots(1, len(studies), sharey=True))
    for axis, study in zip(columns, studies, strict=True):
        _bars(axis, study, order)
    given = {study.verdict(name) for study in studies for name in order}
    patches = [Patch(color=color, label=name) for name, color in COLORS.items() if name in given]
    columns[0].legend(handles=patches, fontsize=8, loc="lower right")
    if turned:
        first = studies[0]
        left, middle, right = rows[1].subplots(1, 3, width_ratios=(1.0, 1.0, 0.75))
        left.axhline(first.ideal.v_average * 1e3, color="#555555", ls="--", lw=1)
        _curves(left, first, lambda motion: motion.v_average * 1e3, legend=True)
        place = (0.5, first.ideal.v_average * 1e3)
        left.annotate("ideal current", place, fontsize=8.5, va="bottom")
        left.set_ylabel("v_average [mm/s]")
        left.set_title(f"Each limit turned: {name_of(first.scene)}", loc="left", fontsize=10)
        _curves(middle, first, lambda motion: motion.fall, legend=False)
        middle.set_ylabel("surface's peak downward acceleration [m/s²]")
        middle.set_title("The peak, impacts included", loc="left", fontsize=10)
        _peaks(right, studies)
    figure.write(path)


def _bars(axis: Any, study: Study, order: Sequence[str]) -> None:
    gains = [study.gain(name) * 1e3 for name in order]
    colors = [COLORS[study.verdict(name)] for name in order]
    axis.barh(order, np.nan_to_num(gains), color=colors)
    axis.axvline(0.0, color="#333333", lw=0.8)
    gap = (study.ideal.v_average - study.own.v_average) * 1e3
    axis.axvline(gap, color="#555555", ls="--", lw=1)
    axis.set_xlabel("change of v_average without the limit [mm/s]")
    axis.set_title(
        f"{name_of(study.scene)}\n{study.own.v_average * 1e3:.3g} mm/s; ideal current "
        f"{study.ideal.v_average * 1e3:.3g} mm/s (dashed)",
        loc="left", fontsize=9.5,
    )  # fmt: skip
    axis.margins(x=0.12)
    axis.grid(alpha=0.25, axis="x")


def _curves(axis: Any, study: Study, quantity: Any, legend: bool) -> None:
    for (name, row), color in zip(study.turned.items(), LINES * 2, strict=False):
        factors = sorted(row)
        heights = [quantity(row[factor]) for factor in factors]
        width, style = (0.9, ":") if study.verdict(name) == "does not matter" else (1.6, "-")
        look: dict[str, Any] = {"color": color, "marker": "o", "ms": 3.5, "label": name}
        axis.plot(factors, heights, lw=width, ls=style, **look)
    axis.set_xscale("log", base=2)
    ticks = sorted({factor for row in study.turned.values() for factor in row})
    axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()
    axis.set_xlabel("times the scene's own value")
    axis.grid(alpha=0.25)
    if legend:
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.45 * (high - low))
        axis.legend(fontsize=7.5, ncols=2, loc="upper left")


def _peaks(axis: Any, studies: Sequence[Study]) -> None:
    places = np.arange(len(studies))
    at_all, between = np.transpose([study.peaks for study in studies])
    needed = [study.needed for study in studies]
    axis.bar(places - 0.2, at_all, 0.38, color="#8d99ae", label="in all, walls included")
    axis.bar(places + 0.2, between, 0.38, color="#1f6fb2", label="while no wall is touched")
    for place in places[np.isnan(at_all)]:
        at = (place - 0.2, 1.2 * max(needed))
        axis.annotate("rigid:\nno number", at, ha="center", va="bottom", fontsize=8)
    for place, value in zip(places, needed, strict=True):
        label = "needed: µ_s F_n/m_p + g" if place == 0 else None
        axis.plot([place - 0.42, place + 0.42], [value] * 2, color="#d1495b", lw=1.6, label=label)
    axis.set_yscale("log")
    axis.set_ylim(top=20.0 * max(np.nanmax([*at_all, *between]), max(needed)))
    names = [name_of(study.scene).replace(", ", "\n") for study in studies]
    axis.set_xticks(places, names, fontsize=8)
    axis.set_ylabel("peak downward acceleration [m/s²]")
    axis.set_title("What the walls do", loc="left", fontsize=10)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.25, axis="y")
