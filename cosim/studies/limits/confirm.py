"""Judges what the cheapest circuit has found by circuits with more in them.

A setting that the judge refutes gives way to the next one; where none is confirmed, or the judge
itself knows a better one, the best is sought on the judge. The limits that the cheapest circuit
does not have are turned here, at the settings found for the scene's own circuit, from which a climb
begins where the limit costs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from cosim.arrays import Array
from cosim.scene import changed
from cosim.search.protocol import Feasible
from cosim.studies.limits.aims import scores
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import Frontiers, Setting
from cosim.studies.limits.study import OWN, Name, Rig, Study, moved
from cosim.studies.limits.table import Limit, Machine, Settings

SPARE = 4
"""Settings that stand by where one is refuted: the best of its own search, those with the best
surroundings there, and the best of other machines, so many of each."""

KINDS = ("best", "robust")

ON_JUDGE, SPREAD = 1, 0.01
"""Patience of a climb on the judge itself, and the standard deviation with which it begins."""

CORNERS = (OWN, ("supply voltage", 10.0), ("supply voltage", 30.0))
"""Machines whose points are run on the whole schematic."""


@dataclass(frozen=True)
class Point:
    """A point of a frontier, SI: on the circuit that was searched, ``judged`` on ``rung``, and in
    ``full`` on the whole schematic; NaN where it was not run there.
    """

    name: Name
    quantity: int
    kind: str
    setting: Setting
    heat: float
    """W."""
    settings: Settings
    """Of the run that has the setting's value."""
    rung: str
    judged: float
    holds: bool
    """Whether the judge confirms it."""
    full: float = nan
    refuted: int = 0
    """Settings that seemed better and were not confirmed."""

    @property
    def rank(self) -> float:
        """What is to be large: the value or, of a robust one, the median over the turns."""
        return self.setting.value if self.kind == "best" else self.setting.median


Key = tuple[Name, int, str]
"""A machine, the number of a quantity, and one of KINDS."""

Points = dict[Key, Point]


def confirmed(bench: Bench, study: Study, told: Callable[[str], object]) -> Points:
    """The points of the scene's own rig: of those settings that the judge confirms the best.

    Where it refutes a setting, others that its own search found apart from it are tried, and those
    that are confirmed on other machines.
    """
    rig = study.rigs[0]
    choices: dict[Key, Sequence[Setting]] = {
        (name, quantity, kind): settings
        for name, bests in rig.found.items()
        for quantity, best in enumerate(bests)
        for kind, settings in zip(KINDS, (best.settings, best.robust), strict=True)
        if settings
    }
    tried = _until_one_holds(bench, rig.cases, choices)
    points = {key: _chosen(found) for key, found in tried.items()}
    refuted = [key for key, point in points.items() if point.refuted]
    spare = {key: _spare(bench, rig, points, key, tried[key]) for key in refuted}
    for key, found in _until_one_holds(bench, rig.cases, spare).items():
        tried[key] += found
        points[key] = _chosen(tried[key])
        if key[2] == "best":
            points[key] = _sought(bench, rig.cases[key[0]], points[key], tried[key])
    told("confirmed")
    return _on_full(bench, points)


def _until_one_holds(
    bench: Bench, cases: dict[Name, Case], choices: Mapping[Key, Sequence[Setting]]
) -> dict[Key, list[Point]]:
    """For each point its settings, judged, up to the first that is confirmed."""
    tried: dict[Key, list[Point]] = {key: [] for key in choices}
    for number in range(max(map(len, choices.values()), default=0)):
        left = {
            key: settings[number]
            for key, settings in choices.items()
            if number < len(settings) and not any(point.holds for point in tried[key])
        }
        for key, point in _judged(bench, cases, left).items():
            tried[key].append(point)
    return tried


def _chosen(tried: Sequence[Point]) -> Point:
    """The best of those that are confirmed; where none is, the first."""
    held = [point for point in tried if point.holds]
    point = max(held, key=lambda one: one.rank) if held else tried[0]
    return replace(point, refuted=len(tried) - len(held))


def _sought(bench: Bench, case: Case, point: Point, tried: Sequence[Point]) -> Point:
    """A point that is confirmed; of those that were ``tried`` the one that is better on the judge,
    by more than the two must agree within; or what a climb there finds where none is confirmed."""
    top = np.nanmax([0.0, *(one.judged for one in tried)])
    if point.holds and top <= (1.0 + bench.fidelity.tolerance) * point.judged:
        return point
    starts = np.array([one.setting.point for one in tried])
    patience = 0 if point.holds else ON_JUDGE
    there = replace(case, rung=point.rung)
    found = _climbed(bench, there, (point.name, point.quantity, point.kind), starts, patience)
    return replace(found, refuted=point.refuted) if found else point


def _climbed(
    bench: Bench, case: Case, key: Key, starts: Array, patience: int = ON_JUDGE
) -> Point | None:
    """The best of points (rows) and what a climb from these finds on a circuit, if any of it is
    achievable."""

    def evaluate(points: Array) -> tuple[Array, Feasible]:
        found, feasible = bench.scores(case, points)
        return found[:, [key[1]]], feasible

    search = Frontiers(evaluate, (0,), 1)
    search.known.rows(starts)
    search.climb(SPREAD, patience)
    value = float(search.known.tops()[0])
    if value <= 0.0:
        return None
    return _at(bench, case, key, search.known.ranked(0, 0.0, 1)[0], value)


def _at(bench: Bench, case: Case, key: Key, point: Array, value: float) -> Point:
    """A point of the cube with its value on the circuit that judges."""
    settings = case.settings(point)
    heat = bench.heat(case, bench.outcomes([settings])[0].numbers)
    setting = Setting(tuple(point.tolist()), value, nan, nan)
    return Point(*key, setting, heat, settings, case.rung, value, True)


def _spare(
    bench: Bench, rig: Rig, points: Points, key: Key, tried: Sequence[Point]
) -> list[Setting]:
    """Settings of a point's own search, and those that are confirmed on other machines, that do
    better there than what is confirmed, the best first."""
    name, quantity, kind = key
    search, point = rig.searches[name], points[key]
    every = [search.distinct(quantity, SPARE)]
    elsewhere = [
        moved(bench, np.array(other.setting.point), rig.cases[other.name], rig.cases[name])
        for other in points.values()
        if other.name != name and other.quantity == quantity and other.holds
    ]
    if elsewhere:
        best = search.settings(np.vstack(elsewhere), quantity, SPARE)
        every += [np.array([one.point]) for one in best]
    known = {one.setting.point for one in tried}
    spare = [
        replace(point, setting=one)
        for one in search.settings(np.vstack(every), quantity)
        if one.point not in known and (kind == "best" or one.firm)
    ]
    better = [one for one in spare if not point.holds or one.rank > point.rank]
    return [one.setting for one in sorted(better, key=lambda one: -one.rank)]


def _judged(bench: Bench, cases: dict[Name, Case], chosen: dict[Key, Setting]) -> Points:
    """Each setting on its own circuit, of which the run is known, and on the one that judges it."""
    own = [cases[key[0]].settings(np.array(one.point)) for key, one in chosen.items()]
    outcomes = bench.outcomes(own)
    rungs = [
        bench.judge(cases[key[0]], settings, outcome.numbers)
        for key, settings, outcome in zip(chosen, own, outcomes, strict=True)
    ]
    judges = bench.outcomes([s | {"circuit.model": r} for s, r in zip(own, rungs, strict=True)])
    found: Points = {}
    for n, (key, setting) in enumerate(chosen.items()):
        value = nan if judges[n].failure else float(scores(judges[n].numbers)[key[1]])
        heat = bench.heat(cases[key[0]], outcomes[n].numbers)
        holds = bench.fidelity.agrees(setting.value, value)
        found[key] = Point(*key, setting, heat, own[n], rungs[n], value, holds)
    return found


def _on_full(bench: Bench, points: Points) -> Points:
    corners = [key for key in points if key[0] in CORNERS]
    runs = [points[key].settings | {"circuit.model": "full"} for key in corners]
    found = dict(points)
    for key, outcome in zip(corners, bench.outcomes(runs), strict=True):
        if not outcome.failure:
            found[key] = replace(points[key], full=float(scores(outcome.numbers)[key[1]]))
    return found


def judged(bench: Bench, study: Study, points: Points, told: Callable[[str], object]) -> Points:
    """The limits that only the amplifier has: for each value the best among the settings that were
    found for the scene's own circuit and those of its ``points``, and the robust one, with its
    value. The own circuit's points stand among them, on the amplifier, too.

    Where the best does worse than it does on the own circuit, it is climbed on from.
    """
    rig = study.rigs[0]
    kept = [point.setting for key, point in points.items() if key[0] == OWN]
    for best in rig.found[OWN]:
        kept += [*best.settings[:2], *best.robust[:2]]
    rows = list(dict.fromkeys(setting.point for setting in kept))
    limits = [limit for limit in study.limits if limit.rung == "amplifier"] if rows else []
    found: Points = {}
    # What a climb finds for one value is tried for all.
    for climbing in (True, False):
        for limit in limits:
            found |= _on_amplifier(bench, rig, limit, np.array(rows), points, climbing)
        rows = list(dict.fromkeys([*rows, *(point.setting.point for point in found.values())]))
    told("judged on the amplifier")
    return found


def _on_amplifier(
    bench: Bench, rig: Rig, limit: Limit, rows: Array, points: Points, climbing: bool
) -> Points:
    """For each value of a limit, and for its own, the best of points of the cube (rows), or of what
    a climb finds, and that of the own circuit's robust ``points``."""
    here = changed(bench.scene, rig.settings, rig.name)
    own, places = limit.own(here), [tuple(row) for row in rows.tolist()]
    found: Points = {}
    for value in dict.fromkeys((own, *limit.values, limit.gone)):
        machine = Machine() if value == own else limit.machine(here, value)
        name, case = (limit.name, value), Case(rig.settings, machine, "amplifier")
        every, feasible = bench.scores(case, rows)
        every[~feasible] = -np.inf
        for quantity, column in enumerate(every.T):
            key, row = (name, quantity, "best"), int(column.argmax())
            above = found.get(((limit.name, own), quantity, "best"))
            top = max(float(column[row]), 0.0)
            if climbing and above and top < (1.0 - bench.fidelity.tolerance) * above.judged:
                better = _climbed(bench, case, key, rows)
            else:
                better = _at(bench, case, key, rows[row], top) if top else None
            if better:
                found[key] = better
            firm = points.get((OWN, quantity, "robust"))
            if firm and column[row := places.index(firm.setting.point)] > 0.0:
                key = name, quantity, "robust"
                found[key] = _at(bench, case, key, rows[row], float(column[row]))
    return found
