"""The figures of the limits, one message each."""

from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cosim.studies.limits.aims import QUANTITIES
from cosim.studies.limits.answer import (
    BINDS,
    NOTHING,
    NUMBER,
    Change,
    height,
    largest,
    listed,
    name_of,
)
from cosim.studies.limits.at import There, acting
from cosim.studies.limits.confirm import Point, Points
from cosim.studies.limits.study import IDEAL, OWN, Study, searched
from cosim.studies.limits.table import Limit, slip_falls
from cosim.studies.plots import BLUE, GREEN, ORANGE, PURPLE, VERMILION, panels
from cosim.studies.tables import brief

ANSWER = ("a_camera", "a_walls", "v_up")
"""What the first figure shows."""


def drawn(
    study: Study, points: Points, found: Sequence[Change], there: Sequence[There]
) -> dict[str, Callable[[Path], None]]:
    """What draws each figure into a file, by what its name has after the study's."""
    acceleration = {
        "a_walls": ("true peak, walls' contact law", PURPLE),
        "a_free": ("true peak, no wall touched", GREEN),
    }
    camera = {"a_camera": ("as a camera reads it, a mean over 4 ms", BLUE)}
    transport = {"v_up": ("upwards", BLUE), "v_down": ("downwards", VERMILION)}
    every: dict[str, Callable[[Path], None]] = {
        "": lambda path: answer(path, study, points, found),
        "-acceleration": lambda path: frontier(path, study, points, acceleration, True),
        "-camera": lambda path: frontier(path, study, points, camera, True),
        "-transport": lambda path: frontier(path, study, points, transport, False),
    }
    if there:
        every["-settings"] = lambda path: costs(path, there, acting(study.limits))
    return every


def answer(path: Path, study: Study, points: Points, found: Sequence[Change]) -> None:
    """What is achievable with each limit at each value: a row a limit, a panel a quantity."""
    order = list(largest(found))
    by_name = {limit.name: limit for limit in study.limits}
    note = (
        "Filled: best setting of the knobs for each value; open: robust (median over "
        "turns of ±2 %). Black line: the device as it is; blue: with the limit eased or lifted; "
        "orange: tightened. Names in red bind, in grey do not matter."
    )
    figure, axes = panels(
        title(study, points, found), fill(note, 165), (14.0, 6.8), 1, 3, sharey=True
    )
    for axis, name in zip(axes, ANSWER, strict=True):
        quantity, number = QUANTITIES[NUMBER[name]], NUMBER[name]
        for place, limit_name in enumerate(reversed(order)):
            _row(axis, place, study, points, by_name[limit_name], number)
        for kind, style in (("best", "-"), ("robust", ":")):
            own = height(points.get((OWN, number, kind))) * quantity.scale
            if isfinite(own):
                axis.axvline(own, color="0.15", lw=1.0, ls=style)
        axis.set_xlabel(f"{quantity.title} [{quantity.unit}]", fontsize=9)
        right = 1.12 * axis.get_xlim()[1]
        axis.set_xticks([tick for tick in axis.get_xticks() if 0.0 <= tick <= right])
        axis.set_xlim(-0.1 * right, right)  # room for the names of the low ends
        if quantity.falls:
            for k, (way, fall) in enumerate(slip_falls(study.scene).items()):
                axis.axvline(fall, color=VERMILION, lw=1.4, ls="--")
                axis.annotate(
                    f"slips, {way}", (fall, len(order) - 0.35 - 0.3 * k), color=VERMILION,
                    fontsize=8.5, ha=("left", "right")[k], xytext=(3 - 6 * k, 0),
                    textcoords="offset points",
                )  # fmt: skip
    axes[0].set_yticks(range(len(order)), list(reversed(order)), fontsize=10)
    axes[0].set_ylim(-0.7, len(order) - 0.1)
    for label in axes[0].get_yticklabels():
        its = [c for c in found if c.limit.name == label.get_text() and c.every]
        drawn = {c.verdict for c in its if QUANTITIES[c.quantity].name in ANSWER}
        nothing = {c.verdict for c in its} == {NOTHING}
        label.set_color(VERMILION if BINDS in drawn else "0.6" if nothing else "0.1")
    figure.write(path)


def title(study: Study, points: Points, found: Sequence[Change]) -> str:
    """The message of the first figure."""
    camera = NUMBER["a_camera"]
    own = height(points.get((OWN, camera, "best")))
    needed = slip_falls(study.scene)["going up"]
    binds = {
        name: [c.limit.name for c in found if c.verdict == BINDS and c.quantity == NUMBER[name]]
        for name in ANSWER
    }
    what = "; ".join(
        f"{words}: {listed(list(dict.fromkeys(binds[name])))}"
        for name, words in zip(
            ANSWER, ("camera's reading", "true peak", "transport upwards"), strict=True
        )
        if binds[name]
    )
    said = (
        f"The surface's fall reaches {brief(own)} m/s² on camera, a mean over 4 ms; a part going "
        f"up slips from {brief(needed)} m/s² on"
    )
    return f"{said}; what binds — {what}" if what else f"{said}; no limit of the circuit binds"


def _row(axis: Axes, place: int, study: Study, points: Points, limit: Limit, quantity: int) -> None:
    scale, own = QUANTITIES[quantity].scale, limit.own(study.scene)
    for kind, filled, shift in (("best", True, 0.12), ("robust", False, -0.2)):
        known = []
        for value in (own, *limit.values, limit.gone):
            at = height(points.get((name_of(study.scene, limit, value), quantity, kind))) * scale
            if at > 0.0:
                known.append((value, at))
        if not known:
            continue
        heights = [at for _, at in known]
        axis.plot([min(heights), max(heights)], [place + shift] * 2, color="0.8", lw=2, zorder=1)
        for value, at in known:
            color = "0.15" if value == own else BLUE if _eased(limit, value, own) else ORANGE
            look: dict[str, Any] = {"color": color, "mfc": color if filled else "white"}
            marker = "D" if value == limit.gone else "o"
            axis.plot(
                at, place + shift, marker, ms=6 if filled else 5, zorder=3 + (value == own), **look
            )
        if filled:
            _name_ends(axis, place + shift, limit, known, own)


def _name_ends(
    axis: Axes, place: float, limit: Limit, known: list[tuple[float, float]], own: float
) -> None:
    """Write the values of the two ends beside them."""
    low, high = min(known, key=lambda one: one[1]), max(known, key=lambda one: one[1])
    if low[1] > 0.97 * high[1]:
        return
    for (value, at), side in ((low, "right"), (high, "left")):
        if value != own:
            axis.annotate(
                named(limit, value), (at, place), (-6 if side == "right" else 6, 3),
                textcoords="offset points", fontsize=7.5, ha=side, color="0.3",
            )  # fmt: skip


def named(limit: Limit, value: float) -> str:
    """A value of a limit, short."""
    return "lifted" if value == limit.gone else f"{brief(value * limit.scale)} {limit.unit}"


def _eased(limit: Limit, value: float, own: float) -> bool:
    return (value > own) is limit.more_is_better


def frontier(
    path: Path,
    study: Study,
    points: Points,
    lines: dict[str, tuple[str, str]],
    falls: bool,
) -> None:
    """A panel a limit: what is achievable over its value, from the tightest to none."""
    limits = searched(study.limits)
    what = "acceleration" if falls else "transport"
    note = (
        "Line and dots: best setting of the knobs; band: the robust setting, from the worst to the "
        "median of its turns by ±2 %; dotted: ideal current"
        + (
            "; dashed: from where on a part slips that goes down, and up, at an instant. "
            if falls
            else ". "
        )
        + "Short grey lines: other rigs, from their own to the lifted limit."
    )
    words = f"Achievable {what} over the value of each limit, from the tightest to none"
    rows = -(-len(limits) // 3)
    size = (13.0, 2.9 * rows + 1.1)
    figure, axes = panels(words, fill(note, 150), size, rows, 3, sharey=True)
    for axis in axes[len(limits) :]:
        axis.remove()
    for axis, limit in zip(axes, limits, strict=False):
        own = limit.own(study.scene)
        values = sorted({own, *limit.values, limit.gone}, reverse=not limit.more_is_better)
        for name, (label, color) in lines.items():
            _line(axis, study, points, limit, values, NUMBER[name], label, color)
            _other_rigs(axis, study, limit, values, NUMBER[name])
        if falls:
            for fall in slip_falls(study.scene).values():
                axis.axhline(fall, color=VERMILION, lw=1.1, ls="--")
            axis.set_yscale("log")
        marks = [named(limit, value).removesuffix(f" {limit.unit}") for value in values]
        axis.set_xticks(range(len(values)), marks)
        axis.axvline(values.index(own), color="0.15", lw=0.8)
        axis.set_title(f"{limit.name} [{limit.unit}]", loc="left", fontsize=10)
    unit = QUANTITIES[NUMBER[next(iter(lines))]].unit
    for axis in axes[::3]:
        axis.set_ylabel(f"{'downward acceleration' if falls else 'mean velocity'} [{unit}]")
    # Bands of settings that a turn spoils reach down to nothing, which is not worth three decades.
    axes[0].set_ylim(bottom=10.0 if falls else 0.0)
    axes[0].legend(fontsize=8)
    figure.write(path)


def _line(
    axis: Axes, study: Study, points: Points, limit: Limit, values: Sequence[float],
    quantity: int, label: str, color: str,
) -> None:  # fmt: skip
    scale = QUANTITIES[quantity].scale

    def row(kind: str) -> list[Point | None]:
        return [points.get((name_of(study.scene, limit, v), quantity, kind)) for v in values]

    best = [height(point) * scale for point in row("best")]
    axis.plot(best, color=color, marker="o", ms=4, lw=1.5, label=label)
    robust = row("robust")
    low = [(point.setting.worst if point else np.nan) * scale for point in robust]
    high = [(point.setting.median if point else np.nan) * scale for point in robust]
    axis.fill_between(range(len(values)), low, high, color=color, alpha=0.18, lw=0)
    ideal = height(points.get((IDEAL, quantity, "best"))) * scale
    axis.axhline(ideal, color=color, lw=0.9, ls=":")


def _other_rigs(
    axis: Axes, study: Study, limit: Limit, values: Sequence[float], quantity: int
) -> None:
    ends = (values.index(limit.own(study.scene)), values.index(limit.gone))
    for rig in study.rigs[1:]:
        both = [rig.found[name][quantity].settings for name in (OWN, (limit.name, limit.gone))]
        if all(both):
            heights = [one[0].value * QUANTITIES[quantity].scale for one in both]
            axis.plot(ends, heights, color="0.6", lw=0.8, marker=".", ms=3, zorder=1)


def costs(path: Path, there: Sequence[There], limits: Sequence[Limit]) -> None:
    """At given settings: the change of v_average without each limit."""
    table = np.array(
        [
            [
                (
                    one.lifted[limit.name].numbers.get("v_average", np.nan)
                    - one.against[limit.name].numbers.get("v_average", np.nan)
                )
                * 1e3
                for limit in limits
            ]
            for one in there
        ]
    )
    most = float(np.nanmax(np.abs(table)))
    row, column = np.unravel_index(int(np.nanargmax(np.abs(table))), table.shape)
    words = (
        f"At the {len(there)} given settings a limit changes the part's velocity by "
        f"{brief(most)} mm/s at most: {limits[int(column)].name}, {there[int(row)].scene.name}"
    )
    note = "Change of v_average [mm/s] when one limit is lifted, knobs as given. Blue: faster up."
    figure, (axis,) = panels(words, note, (12.0, 0.42 * len(there) + 2.4))
    axis.grid(False)
    shown = axis.imshow(table, cmap="RdBu", vmin=-most, vmax=most, aspect="auto")
    for (r, c), value in np.ndenumerate(table):
        if isfinite(value):
            color = "white" if abs(value) > 0.6 * most else "0.15"
            text = f"{value:+.2f}" if abs(value) >= 0.005 else "0"
            axis.annotate(text, (c, r), ha="center", va="center", color=color, fontsize=8.5)
    names = [limit.name.replace(" ", "\n", 1) for limit in limits]
    axis.set_xticks(range(len(limits)), names, fontsize=8.5)
    own = [one.own.numbers.get("v_average", np.nan) * 1e3 for one in there]
    rows = [f"{one.scene.name}: {v:+.2f} mm/s" for one, v in zip(there, own, strict=True)]
    axis.set_yticks(range(len(there)), rows, fontsize=9)
    figure.colorbar(shown, ax=axis, label="[mm/s]")
    figure.write(path)
