"""Judges the candidates of a search by longer runs and more detailed circuits.

A search runs about a second of motion in fixed steps. Here the FMU locates each event, over at
least SETTLE + SPAN. A setting whose score in the last quarter differs from that in the last half is
not settled. The best settled candidate that is feasible represents its machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import nan
from typing import NamedTuple

import numpy as np

from cosim.arrays import Array
from cosim.evaluate.point import Outcome
from cosim.simulation.fidelity import SEARCHES, Fidelity, relative_error
from cosim.studies.limits.changes import Machine, Settings
from cosim.studies.limits.runs import GOALS, Bench, around, scored
from cosim.studies.limits.search import Candidates

SETTLE, SPAN = 1.5, 1.5
"""s, left out of averages and averaged over, at least."""

SHORT = 0.6
"""s, left out of averages where ngspice runs all turns of a setting, which takes long."""

SETTLED = 0.01
"""Relative difference between last quarter and last half of a run up to which it is settled."""

NUMBER = {goal.name: number for number, goal in enumerate(GOALS)}
"""The index of each goal in the scores."""


class Key(NamedTuple):
    """The names of the change, goal and kind (of KINDS) that a point represents."""

    change: str
    goal: str
    kind: str


@dataclass(frozen=True)
class Point:
    """What a setting achieves, SI: itself, and its median and worst over the knobs' turns."""

    value: float
    median: float
    worst: float
    heat: float
    """Of one coil, W."""
    v_average: float
    """Mean velocity of the part upwards (m/s), whatever the goal."""
    a_camera: float
    """Largest downward acceleration (m/s²) as a camera reads it, whatever the goal."""
    point: list[float]
    """The setting as a point of the machine's cube."""
    settings: Settings
    rung: str = ""
    """The circuit that confirms or refutes it; empty where none was asked."""
    there: float = nan
    """The setting's value on that circuit."""
    against: float = nan
    """The median of the unchanged device at the same setting on the same circuit, if the change was
    only tried there; NaN where the knobs were searched for it."""

    @property
    def confirmed(self) -> bool:
        return relative_error(self.value, self.there) <= SETTLED

    def rank(self, kind: str) -> float:
        """The number by which candidates of a kind are compared."""
        return self.value if kind == "best" else self.median


def judged(
    bench: Bench,
    machines: Mapping[str, Machine],
    candidates: Mapping[str, Candidates],
    kinds: Sequence[str],
) -> dict[Key, Point]:
    """For each machine, goal and kind of ``kinds`` the best candidate that is settled and feasible;
    no entry where no candidate is, or where none has a positive rank."""
    asked = [
        (Key(name, goal.name, kind), np.array(point))
        for name, by_kind in candidates.items()
        for kind in kinds
        for goal, points in zip(GOALS, by_kind[kind], strict=True)
        for point in points
    ]
    good = _settled(bench, machines, asked)
    # The first of the points around p, and so of each group of runs, is p itself.
    runs = [[machines[key.change].at(one, SETTLE, SPAN) for one in around(p)] for key, p in good]
    found: dict[Key, Point] = {}
    for (key, middle), settings, outcomes in zip(good, runs, bench.outcomes(runs), strict=True):
        point = _point(key.goal, middle.tolist(), outcomes, settings[0])
        best = found.get(key)
        if point.rank(key.kind) > (best.rank(key.kind) if best else 0.0):
            found[key] = point
    return found


_Asked = list[tuple[Key, Array]]


def _settled(bench: Bench, machines: Mapping[str, Machine], asked: _Asked) -> _Asked:
    """The candidates that are settled and feasible; of the kind "best" only the highest score for
    each machine and goal, since their turns need not be run."""
    # The last half and the last quarter of the same motion, if this has settled.
    times = (SETTLE, SPAN), (SETTLE + SPAN / 2.0, SPAN / 2.0)
    runs = [[machines[key.change].at(point, *each) for each in times] for key, point in asked]
    found: _Asked = []
    top: dict[Key, float] = {}
    for (key, point), pair in zip(asked, bench.outcomes(runs), strict=True):
        values = [scored(outcome)[NUMBER[key.goal]] for outcome in pair]
        if not bench.feasible(machines[key.change], pair[0]) or relative_error(*values) > SETTLED:
            continue
        if key.kind != "best":
            found.append((key, point))
        elif values[0] > top.get(key, 0.0):
            top[key] = values[0]
            found = [kept for kept in found if kept[0] != key] + [(key, point)]
    return found


def _point(goal: str, middle: list[float], turns: Sequence[Outcome], settings: Settings) -> Point:
    scores = np.array([scored(one)[NUMBER[goal]] for one in turns])
    numbers = turns[0].numbers
    return Point(
        *(float(scores[0]), float(np.median(scores)), float(scores.min())),
        *(numbers["coil_heat"], numbers["v_average"], -numbers["a_camera_min"]),
        *(middle, settings),
    )


def confirmed(
    bench: Bench, machines: Mapping[str, Machine], points: Mapping[Key, Point]
) -> dict[Key, Point]:
    """The points with their value on a circuit that ngspice solves: the amplifier, or the whole
    schematic where the current limit acts, which the amplifier lacks."""
    fidelity, own = Fidelity.of(bench.scene), bench.scene.circuit.current_limit
    asked = {key: point for key, point in points.items() if machines[key.change].rung == SEARCHES}
    run = bench.evaluator.outcomes
    detailed: list[Settings] = []
    outcomes = run([point.settings for point in asked.values()])
    for point, outcome in zip(asked.values(), outcomes, strict=True):
        current = max(outcome.numbers["current_max"], -outcome.numbers["current_min"])
        limit = point.settings.get("circuit.current_limit", own)
        rung = fidelity.judge(current * bench.scene.coil.count, limit)
        detailed.append(point.settings | {"circuit.model": rung})
    found = dict(points)
    for key, settings, outcome in zip(asked, detailed, run(detailed), strict=True):
        value = scored(outcome)[NUMBER[key.goal]]
        found[key] = replace(points[key], rung=settings["circuit.model"], there=value)
    return found


def tried(
    bench: Bench, machines: Mapping[str, Machine], names: Sequence[str], own: Mapping[Key, Point]
) -> dict[Key, Point]:
    """The machines of ``names`` at the robust settings of the unchanged device (``own``), each
    compared with the unchanged device at the same setting on the same circuit."""
    found: dict[Key, Point] = {}
    for key, name in product((key for key in own if key.kind == "robust"), names):
        point, changed = own[key], machines[name]
        unchanged = replace(machines[key.change], rung=changed.rung)
        runs = [
            [machine.at(turn, SHORT, SPAN) for turn in around(np.array(point.point))]
            for machine in (changed, unchanged)
        ]
        outcomes, others = bench.outcomes(runs)
        if not any(outcome.failure for outcome in (*outcomes, *others)):
            median = _point(key.goal, point.point, others, runs[1][0]).median
            judged_point = _point(key.goal, point.point, outcomes, runs[0][0])
            found[key._replace(change=name)] = replace(judged_point, against=median)
    return found
