"""The figures of the limits, one message each."""

from typing import Any

import numpy as np

from cosim.files.picture import Picture
from cosim.studies.limits.answer import gains, in_short, noise
from cosim.studies.limits.changes import AS_IT_IS
from cosim.studies.limits.runs import Goal
from cosim.studies.limits.study import Study
from cosim.studies.plots import BLUE, GREEN, ORANGE, PURPLE, VERMILION, keep_ticks_inside, panels

COLORS = {
    **{"": "0.15", "waveform": VERMILION, "heat": ORANGE, "grip": GREEN},
    **{"circuit": BLUE, "coil": PURPLE},
}
"""Colour of each group of changes; the unchanged device is drawn on top of the others."""
MARKERS = dict(zip(COLORS, "D^svoP", strict=True))


def changes(study: Study, goal: Goal) -> Picture:
    """A row for each change with its robust gain in %, the largest on top."""
    every = [gain for gain in gains(study, goal) if gain.every]
    several = len(study.rigs) > 1
    each = " on each rig that fits the trials" if several else ""
    over = "median over the rigs" if several else "gain"
    ends = "; bar: their range; cross: the scene's rig" if several else ""
    note = (
        f"Robust: the median over errors of ±2 % in the knobs, set anew for each change{each}. "
        f"Dot: the {over}, hollow where it is within the noise{ends}; grey band: what nine in ten "
        "repeated searches differ by at most. Dark orange changes the waveform, yellow the heat, "
        "green the grip, blue the circuit, purple coil or magnet."
    )
    if study.of_trials:
        note += " All trials that were measured have a rising sawtooth."
    said = in_short(every, ranges=False) or ("" if every else "no robust gain could be found")
    title = f"{goal.title.capitalize()}: {said}" if said else goal.title
    figure, (axis,) = panels(title, note, (10.0, 0.27 * len(every) + 1.9))
    scatter = 100.0 * noise(study, goal)
    axis.axvspan(-scatter, scatter, color="0.88", zorder=0)
    axis.axvline(0.0, color="0.15", lw=1.0)
    upwards = every[::-1]
    for row, gain in enumerate(upwards):
        color = COLORS[gain.change.group]
        reach = 100.0 * np.array([min(gain.every), max(gain.every)])
        axis.plot(reach, [row, row], color=color, lw=1.6, alpha=0.55)
        filled = color if gain.counts else "white"
        axis.plot(100.0 * gain.middle, row, "o", color=color, mfc=filled, ms=6, zorder=3)
        if several:
            axis.plot(100.0 * gain.own, row, "x", color="0.15", ms=5, zorder=4)
    axis.set_yticks(range(len(every)), [gain.change.name for gain in upwards], fontsize=9)
    for label, gain in zip(axis.get_yticklabels(), upwards, strict=True):
        label.set_color(COLORS[gain.change.group])
    axis.set_ylim(-0.7, len(every) - 0.3)
    keep_ticks_inside(axis.xaxis)
    axis.set_xlabel(f"gain of the {goal.title}, robust [%]")
    return figure


def settings(study: Study) -> Picture:
    """Acceleration against velocity of every setting that was best or robust for something."""
    rig = "identified" if study.of_trials else "scene's"
    note = (
        "Each mark: a setting that is the best, or the most robust, for one goal with one change, "
        f"on the {rig} rig. Lines: accelerations at which a sticking part slips as the surface "
        "falls; the camera's reading is a mean over 4 ms, below the instant that decides."
    )
    points = study.rigs[0].points
    group = {change.name: change.group for change in study.changes}
    title = "No setting was found"
    if points:
        strongest = max(points.values(), key=lambda point: point.a_camera)
        fastest = max(abs(point.v_average) for point in points.values())
        words = "carries" if abs(strongest.v_average) == fastest else "does not carry"
        title = f"The largest acceleration {words} the part fastest"
    figure, (axis,) = panels(title, note, (9.0, 5.4))
    for rank, (name, color) in enumerate(COLORS.items()):
        some = [point for key, point in points.items() if group[key.change] == name]
        words = name or AS_IT_IS.name
        velocity = [point.v_average * 1e3 for point in some]
        reading = [point.a_camera for point in some]
        look: dict[str, Any] = {"color": color, "marker": MARKERS[name], "ms": 5, "alpha": 0.75}
        axis.plot(velocity, reading, ls="", zorder=3.0 - 0.1 * rank, label=words, **look)
    for way, style in (("up", "--"), ("down", ":")):
        label = f"slips, part going {way}"
        axis.axhline(-study.slips[0][way][0], color=PURPLE, lw=1.2, ls=style, label=label)
    axis.axvline(0.0, color="0.6", lw=0.8)
    axis.set_xlabel("mean velocity of the part, upwards [mm/s]")
    axis.set_ylabel("largest fall, as a camera reads it [m/s²]")
    axis.legend(fontsize=8.5)
    keep_ticks_inside(axis.xaxis, axis.yaxis)
    return figure
