"""Judges what a search found by longer runs of circuits with more in them.

A search looks at a second of motion in fixed steps. Here the FMU finds each event, over at least
SETTLE + SPAN; a setting whose last quarter differs from its last half is not settled. The best of
those that are, and make no more heat than they may, stands for its machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan

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
"""s, left out of averages where ngspice runs all turns of a setting."""

SETTLED = 0.01
"""Relative difference between the last quarter and the last half of a run that is settled."""

NUMBER = {goal.name: number for number, goal in enumerate(GOALS)}

Key = tuple[str, str, str]
"""Names of a change, a goal and a kind."""


@dataclass(frozen=True)
class Point:
    """What a setting achieves, SI: by itself, and over the turns of the knobs."""

    value: float
    median: float
    worst: float
    heat: float
    """W, of a coil."""
    v_average: float
    """m/s, whatever was wanted."""
    a_camera: float
    """m/s², downwards."""
    point: list[float]
    """Of the machine's cube."""
    settings: Settings
    rung: str = ""
    """The circuit that confirms or refutes it; empty where none was asked."""
    there: float = nan
    """Its value there."""
    against: float = nan
    """What the device as it is achieves at the same setting on the same circuit, by the median;
    NaN where it has settings of its own."""

    @property
    def confirmed(self) -> bool:
        return relative_error(self.value, self.there) <= SETTLED

    def rank(self, kind: str) -> float:
        """What is to be large."""
        return self.value if kind == "best" else self.median


def judged(
    bench: Bench,
    machines: Mapping[str, Machine],
    candidates: Mapping[str, Candidates],
    kinds: Sequence[str],
) -> dict[Key, Point]:
    """For each machine, goal and one of ``kinds`` the best of the candidates that are settled and
    feasible; none where there is none, or where none achieves anything."""
    asked = [
        ((name, goal.name, kind), np.array(point))
        for name, of in candidates.items()
        for kind in kinds
        for goal, some in zip(GOALS, of[kind], strict=True)
        for point in some
    ]
    good = _settled(bench, machines, asked)
    # A list for each candidate: the setting itself, then all turns of its knobs.
    runs = [[machines[key[0]].at(one, SETTLE, SPAN) for one in around(p)] for key, p in good]
    found: dict[Key, Point] = {}
    for (key, middle), settings, outcomes in zip(good, runs, bench.outcomes(runs), strict=True):
        point = _point(key[1], middle.tolist(), outcomes, settings[0])
        best = found.get(key)
        if point.rank(key[2]) > (best.rank(key[2]) if best else 0.0):
            found[key] = point
    return found


_Asked = list[tuple[Key, Array]]


def _settled(bench: Bench, machines: Mapping[str, Machine], asked: _Asked) -> _Asked:
    """The candidates that are settled and feasible; of the kind "best" only the best one of each
    machine and goal, as the turns of the others would be run for nothing."""
    # Averages over the last half and over the last quarter of the same run.
    times = (SETTLE, SPAN), (SETTLE + SPAN / 2.0, SPAN / 2.0)
    runs = [[machines[key[0]].at(point, *each) for each in times] for key, point in asked]
    found: _Asked = []
    top: dict[Key, float] = {}
    for (key, point), both in zip(asked, bench.outcomes(runs), strict=True):
        values = [scored(one)[NUMBER[key[1]]] for one in both]
        if not bench.feasible(machines[key[0]], both[0]) or relative_error(*values) > SETTLED:
            continue
        if key[2] != "best":
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
    """The points with what the amplifier says of them, or the whole schematic where the current
    limit acts, which the amplifier does not have."""
    fidelity, own = Fidelity.of(bench.scene), bench.scene.circuit.current_limit
    asked = {key: point for key, point in points.items() if machines[key[0]].rung == SEARCHES}
    run = bench.evaluator.outcomes
    every: list[Settings] = []
    outcomes = run([point.settings for point in asked.values()])
    for point, outcome in zip(asked.values(), outcomes, strict=True):
        current = max(outcome.numbers["current_max"], -outcome.numbers["current_min"])
        limit = point.settings.get("circuit.current_limit", own)
        rung = fidelity.judge(current * bench.scene.coil.count, limit)
        every.append(point.settings | {"circuit.model": rung})
    found = dict(points)
    for key, there, outcome in zip(asked, every, run(every), strict=True):
        value = scored(outcome)[NUMBER[key[1]]]
        found[key] = replace(points[key], rung=there["circuit.model"], there=value)
    return found


def tried(
    bench: Bench, machines: Mapping[str, Machine], names: Sequence[str], own: Mapping[Key, Point]
) -> dict[Key, Point]:
    """The machines of ``names`` at the robust settings of the device as it is (``own``), against
    that device on the same circuit."""
    found: dict[Key, Point] = {}
    for (as_it_is, goal, kind), point in own.items():
        if kind != "robust":
            continue
        for name in names:
            here = machines[name]
            there = replace(machines[as_it_is], rung=here.rung)
            each = [
                [machine.at(one, SHORT, SPAN) for one in around(np.array(point.point))]
                for machine in (here, there)
            ]
            told, others = bench.outcomes(each)
            if not any(one.failure for one in (*told, *others)):
                median = _point(goal, point.point, others, each[1][0]).median
                one = _point(goal, point.point, told, each[0][0])
                found[name, goal, kind] = replace(one, against=median)
    return found
