"""The study's answer: gains of each change, paired rig by rig, and the sentences made of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from cosim.circuit.heat import DRIVE_RANGE_HEAT, LIFT, RATED_CURRENT, rises
from cosim.studies.limits.changes import AS_IT_IS, Change
from cosim.studies.limits.runs import GOALS, Goal
from cosim.studies.limits.study import REPEATED, Rig, Study
from cosim.studies.report import brief, span
from cosim.waveforms.report import warmer

BY_NAME = {goal.name: goal for goal in GOALS}

GROUPS = {
    "waveform": "waveform",
    "circuit": "circuit",
    "coil": "coil or magnet",
    "heat": "limit of heat",
    "grip": "grip force",
}
"""Words for the groups of changes, in the order of the sentences."""

IDEAL, TWICE_HEAT = "ideal current", "heat 7 W"
"""Names of the changes that the first sentence reports."""

LEGEND = (
    "Of each change below: the median gain over the rigs, the knobs set anew on each; in brackets "
    "the range, the gain on the scene's rig, and on how many of the rigs on which anything was "
    "found it has the median's sign and exceeds the search's noise."
)

NINE_IN_TEN = 0.9
"""Quantile of the differences between repeated searches that counts as the search's noise."""

NAMED, LEAST = 6, 2
"""How many changes a sentence names at most, and how many of these are the worst ones."""


@dataclass(frozen=True)
class Gain:
    """The gain of a change: its robust value over the unchanged device's on the rig, less 1."""

    change: Change
    goal: Goal
    own: float
    """Gain on the scene's own rig; NaN where nothing was found."""
    every: tuple[float, ...]
    """Gain on each rig on which both values are known."""
    noise: float
    """The search's own, relative: :func:`noise`."""

    @property
    def middle(self) -> float:
        """The median gain over the rigs; NaN without any."""
        return float(np.median(self.every)) if self.every else nan

    @property
    def counts(self) -> bool:
        """Whether the median gain exceeds the noise."""
        return abs(self.middle) > self.noise


def gain_on(rig: Rig, change: Change, goal: Goal) -> float:
    """The gain on one rig; NaN where it is not known."""
    point, own = (rig.point(one, goal, "robust") for one in (change, AS_IT_IS))
    if own is None or point is None:
        return nan
    # A change that was only tried has its reference at the same settings: ``against``.
    return point.median / (point.against if isfinite(point.against) else own.median) - 1.0


def gains(study: Study, goal: Goal) -> list[Gain]:
    """The gain of every change, the largest median first, those without a value last."""
    threshold, found = noise(study, goal), []
    for change in study.changes[1:]:
        by_rig = [gain_on(rig, change, goal) for rig in study.rigs]
        known = tuple(gain for gain in by_rig if isfinite(gain))
        found.append(Gain(change, goal, by_rig[0], known, threshold))
    return sorted(found, key=lambda gain: -gain.middle if gain.every else np.inf)


def noise(study: Study, goal: Goal) -> float:
    """The search's noise: nine in ten robust values of repeated searches differ by at most this;
    0 where none was repeated."""
    found = differences(study, goal) or [0.0]
    return float(np.quantile(found, NINE_IN_TEN, method="higher"))


def differences(study: Study, goal: Goal) -> list[float]:
    """Relative differences between the robust values of a repeated and the first search, on all
    rigs."""
    found = []
    for number, points in study.repeats:
        for key, point in points.items():
            first = study.rigs[number].points.get(key)
            if first is not None and (key.goal, key.kind) == (goal.name, "robust"):
                found.append(abs(point.median / first.median - 1.0))
    return found


def sentences(study: Study) -> list[str]:
    """The answer, the most important first."""
    up, camera = BY_NAME["v_up"], BY_NAME["a_camera"]
    by_up, by_camera = gains(study, up), gains(study, camera)
    said = [
        _in_short(by_up),
        _as_it_is(study, up),
        LEGEND if len(study.rigs) > 1 else "",
        *(_group(by_up, group) for group in GROUPS),
        _in_short(by_camera),
        _as_it_is(study, camera),
        *(_group(by_camera, group) for group in ("waveform", "circuit", "coil")),
        _slips(study),
        _warmth(study),
        _search(study),
    ]
    return [one for one in said if one]


def _in_short(every: Sequence[Gain]) -> str:
    """How much the amplifier, the command's waveform and the coil's heat each limit the goal."""
    rigs = max((len(gain.every) for gain in every), default=0)
    over = f"Median gain over {rigs} rigs" if rigs > 1 else "Gain"
    told = in_short(every)
    return told and f"{over} in {every[0].goal.title}, robust: {told}."


def in_short(every: Sequence[Gain], ranges: bool = True) -> str:
    """The median gains of an ideal current source, of the best other waveform and of twice the
    heat, as a list in words; empty where one of them is unknown."""
    known = {gain.change.name: gain for gain in every if gain.every}
    shapes = [gain for gain in every if gain.change.group == "waveform" and gain.every]
    if not (shapes and {IDEAL, TWICE_HEAT} <= known.keys()):
        return ""
    told = {
        "an ideal current source": known[IDEAL],
        f"the best other waveform ({shapes[0].change.name})": shapes[0],
        "twice the heat": known[TWICE_HEAT],
    }
    return ", ".join(
        f"{words} {percent(gain.middle)} %"
        + (f" ({ends(gain)})" if ranges and len(gain.every) > 1 else "")
        for words, gain in told.items()
    )


def ends(gain: Gain) -> str:
    """The range of the gain over the rigs, %."""
    return f"{percent(min(gain.every))} to {percent(max(gain.every))}"


def percent(share: float) -> str:
    """A share in whole %, with its sign, but no minus before a zero."""
    return f"{round(100.0 * share):+d}"


def _as_it_is(study: Study, goal: Goal) -> str:
    every = [rig.point(AS_IT_IS, goal, "robust") for rig in study.rigs]
    robust, best = every[0], study.rigs[0].point(AS_IT_IS, goal, "best")
    if robust is None or best is None:
        return f"With the device unchanged no setting was found for a robust {goal.title}."
    # A short search may find the greatest value where it looks for a robust one.
    best = max(best, robust, key=lambda point: point.value)
    known = [one.median * goal.scale for one in every if one]
    value, median, worst, single = (
        f"{brief(x * goal.scale)} {goal.unit}"
        for x in (robust.median, best.median, robust.worst, best.value)
    )
    if len(known) > 1:
        middle = f"{brief(float(np.median(known)))} {goal.unit}"
        reached = f"a robust {middle} of {goal.title} (median of {len(known)} rigs, {span(known)})"
        reached += f". On the scene's rig it is {value}"
    else:
        reached = f"a robust {value} of {goal.title}"
    if not goal.name.startswith("v_"):
        reached += f", where the part moves at {robust.v_average * 1e3:+.1f} mm/s"
    return (
        f"Unchanged, the device reaches {reached}, and {worst} with the worst error of ±2 % in the "
        f"knobs. The setting that is best without errors gives {single} there, and {median} in the "
        "median over them."
    )


def _group(every: Sequence[Gain], group: str) -> str:
    """The gains of a group's changes: by name where they exceed the noise, else their range."""
    some = [gain for gain in every if gain.change.group == group and gain.every]
    if not some:
        return ""
    named = [gain for gain in some if gain.counts]
    shown = named if len(named) <= NAMED else [*named[: NAMED - LEAST], *named[-LEAST:]]
    told = [f"{gain.change.name} {_share(gain)}" for gain in shown]
    rest = [gain.middle for gain in some if gain not in shown]
    if len(rest) == 1:
        told.append(f"one other {percent(rest[0])} %")
    elif rest:
        told.append(f"{len(rest)} others {percent(min(rest))} to {percent(max(rest))} %")
    return f"The {some[0].goal.title}, robustly, with another {GROUPS[group]}: {'; '.join(told)}."


def _share(gain: Gain) -> str:
    text = f"{percent(gain.middle)} %"
    if len(gain.every) > 1:
        own = percent(gain.own) if isfinite(gain.own) else "nothing"
        alike = sum(np.sign(gain.middle) * one > gain.noise for one in gain.every)
        text += f" ({ends(gain)}; {own}; {alike} of {len(gain.every)})"
    return text


def _slips(study: Study) -> str:
    told = []
    for way, end in (("up", 0), ("up", 1), ("down", 0)):
        values = [abs(slips[way][end]) for slips in study.slips]
        told.append(f"{values[0]:.0f} m/s²" + f" ({span(values)})" * (len(values) > 1))
    up, rising, down = told
    over = ", in brackets over the rigs" if len(study.slips) > 1 else ""
    return (
        f"While the part moves up it slips where the surface accelerates downwards at more than "
        f"{up} or upwards at more than {rising}; while it moves down, downwards at more than "
        f"{down}{over}. A camera averages over 4 ms, so it reads less than the peak that makes the "
        "part slip."
    )


def _warmth(study: Study) -> str:
    coil = study.scene.coil
    lift, ever = map(warmer, rises(coil, DRIVE_RANGE_HEAT))
    current = np.sqrt(DRIVE_RANGE_HEAT / coil.resistance)
    return (
        f"The coil may make {DRIVE_RANGE_HEAT:.1f} W here, the most of the drives that the data "
        "sheet of the paper's actuator names, (5 V)²/7.1 Ω. That is no rating: it takes "
        f"{current:.2f} A rms, "
        f"{current / RATED_CURRENT:.1f} times the current that the sheet names. By an estimate the "
        f"winding warms by {lift} in a lift of {LIFT:.0f} s, and by {ever} in continuous use."
    )


def _search(study: Study) -> str:
    apart = ", ".join(
        f"{goal.name} {100.0 * noise(study, goal):.0f} % "
        f"({100.0 * max(differences(study, goal)):.0f} %)"
        for goal in GOALS
        if differences(study, goal)
    )
    own = study.rigs[0].points.values()
    asked = [point for point in own if point.rung]
    held = sum(point.confirmed for point in asked)
    repeated = sum(change.name in REPEATED for change in study.changes)
    said = [
        f"Searches of {repeated} changes were repeated with other seeds, {len(study.repeats)} "
        "times in all: nine in ten robust values differ by at most, and in brackets all, "
        f"{apart or 'nothing, since none was found'}; the former is the noise.",
        f"Of {len(asked)} points the circuit with more in it confirms {held} within 1 %.",
    ]
    if study.of_trials:
        said.append(
            "The paper's trials have a rising sawtooth, at 30 Hz at most except one at 51 Hz: "
            "what other shapes and higher frequencies bring is a prediction."
        )
    return " ".join(said)
