"""Judges what the cheapest circuit has found by circuits with more in them.

A setting that the amplifier refutes gives way to the next one; where all good ones are refuted, the
amplifier is searched itself. The limits that the cheapest circuit does not have are turned here, at
the settings found for the scene's own circuit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import nan

import numpy as np
from numpy.typing import NDArray

from cosim.arrays import Array
from cosim.scene import changed
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES, scores
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import STEADY_APART, Clouds, Leads, Search, Setting
from cosim.studies.limits.study import IDEAL, OWN, Name, Rig, Study, moved
from cosim.studies.limits.table import Machine, Settings

WITHIN = 0.02
"""Relative difference of a confirmed value."""

POORER = 0.05
"""So much less than a refuted setting does where it was judged, a confirmed one is passed over."""

SPARE = 4
"""Settings that stand by where one is refuted: the best of its own search, those with the best
surroundings there, and the best of other machines, so many of each."""

KINDS = ("best", "robust")

JUDGE = (Clouds(0.01, 2, 4), Clouds(0.003, 2, 4), Clouds(0.001, 2, 6))
"""Climbed with on the more complete circuit itself."""

CORNERS = (OWN, ("supply voltage", 10.0), ("supply voltage", 30.0))
"""Machines whose points are run on the whole schematic."""


@dataclass(frozen=True)
class Point:
    """A point of a frontier, SI: on the circuit that was searched, ``confirmed`` on ``rung``, and
    in ``full`` on the whole schematic; NaN where it was not run there.
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
    confirmed: float
    full: float = nan
    refuted: int = 0
    """Settings that seemed better and were not confirmed."""

    @property
    def off(self) -> float:
        """Relative difference of the confirmed value."""
        return abs(self.confirmed / self.setting.value - 1.0)

    @property
    def holds(self) -> bool:
        """Whether the more complete circuit confirms it."""
        return self.off <= WITHIN


Key = tuple[Name, int, str]
"""A machine, the number of a quantity, and one of KINDS."""

Points = dict[Key, Point]


def confirmed(bench: Bench, study: Study, told: Callable[[str], object]) -> Points:
    """The points of the scene's own rig: of those settings that the amplifier confirms the best;
    where it confirms none, or only much poorer ones, the best that is found on the amplifier.

    Where it refutes a setting, others that its own search found apart from it are tried, and those
    that are confirmed on other machines.
    """
    rig = study.rigs[0]
    choices = {
        (name, quantity, kind): settings
        for name, bests in rig.found.items()
        for quantity, best in enumerate(bests)
        for kind, settings in zip(KINDS, (best.settings, best.robust), strict=True)
        if settings
    }
    tried = _until_one_holds(bench, rig.cases, choices)
    points = {key: _chosen(found) for key, found in tried.items()}
    more = {
        key: settings
        for key, point in points.items()
        if point.refuted and (settings := _spare(bench, rig, points, key, choices[key]))
    }
    for key, found in _until_one_holds(bench, rig.cases, more).items():
        tried[key] += found
        points[key] = _chosen(tried[key])
    for key, point in points.items():
        if point.kind == "best" and not point.holds:
            points[key] = _searched(bench, rig.cases[key[0]], point, tried[key])
    told("confirmed")
    return _on_full(bench, rig.cases, points)


def _until_one_holds(
    bench: Bench, cases: dict[Name, Case], choices: dict[Key, tuple[Setting, ...]]
) -> dict[Key, list[Point]]:
    """For each point its settings, judged, up to the first that is confirmed."""
    tried: dict[Key, list[Point]] = {key: [] for key in choices}
    number = 0
    while left := {
        key: settings[number]
        for key, settings in choices.items()
        if number < len(settings) and not any(point.holds for point in tried[key])
    }:
        for key, point in _points(bench, cases, left).items():
            tried[key].append(point)
        number += 1
    return tried


def _chosen(tried: list[Point]) -> Point:
    """The best of those that are confirmed; but the one that does best where it was judged, if it
    does so much better there that the frontier would be the poorer without it."""
    held = [point for point in tried if point.holds]
    point = max(held, key=_rank) if held else tried[0]
    known = [one for one in tried if one.confirmed > 0.0]
    if point.kind == "best" and known:
        there = max(known, key=lambda one: one.confirmed)
        if not held or point.confirmed < (1.0 - POORER) * there.confirmed:
            point = there
    return replace(point, refuted=len(tried) - len(held))


def _searched(bench: Bench, case: Case, point: Point, tried: list[Point]) -> Point:
    """What a climb on the circuit that refuted all good settings of a point finds from these; the
    point itself where none of them is achievable there."""
    judge = replace(case, rung=point.rung)

    def ask(places: Array) -> tuple[Array, NDArray[np.bool_]]:
        found, borne = bench.scores(judge, places)
        return found[:, [point.quantity]], borne

    places = np.unique([one.setting.place for one in tried], axis=0)
    search = Search(ask, (0,), 1)
    search.climb(JUDGE, Leads(places, search.scores(places)))
    best = search.ranked(0, STEADY_APART, 1)
    value = float(search.scores(best).max(initial=0.0))
    if value <= 0.0:
        return point
    settings = judge.settings(best[0])
    heat = bench.heat(case, settings, bench.outcomes([settings])[0].numbers)
    setting = Setting(tuple(best[0].tolist()), value, nan, nan)
    return replace(point, setting=setting, heat=heat, settings=settings, confirmed=value)


def _spare(
    bench: Bench, rig: Rig, points: Points, key: Key, tried: tuple[Setting, ...]
) -> tuple[Setting, ...]:
    """Settings of a point's own search, and those that are confirmed on other machines, that do
    better there than what is confirmed, the best first."""
    name, quantity, kind = key
    elsewhere = [
        moved(bench, np.array(point.setting.place), rig.cases[other], rig.cases[name])
        for (other, number, _), point in points.items()
        if other != name and number == quantity and point.holds
    ]
    search = rig.searches[name]
    places = [search.distinct(quantity, SPARE)]
    if elsewhere:
        best = search.best_of(np.unique(np.vstack(elsewhere), axis=0), quantity, SPARE)
        places += [np.array([one.place for one in best.settings]).reshape(-1, KNOB_COUNT)]
    best = search.best_of(np.unique(np.vstack(places), axis=0), quantity, 3 * SPARE)
    known, point = {one.place for one in tried}, points[key]
    return tuple(
        one
        for one in (best.settings if kind == "best" else best.robust)
        if one.place not in known
        and not (point.holds and _rank(replace(point, setting=one)) <= _rank(point))
    )


def _rank(point: Point) -> float:
    return point.setting.value if point.kind == "best" else point.setting.median


def _points(bench: Bench, cases: dict[Name, Case], chosen: dict[Key, Setting]) -> Points:
    """Each setting on its own circuit, of which the run is known, and on a more complete one."""
    plain = [cases[key[0]].settings(np.array(one.place)) for key, one in chosen.items()]
    rungs = [_more_complete(key[0]) for key in chosen]
    more = [s | {"circuit.model": rung} for s, rung in zip(plain, rungs, strict=True)]
    outcomes, judges = bench.outcomes(plain), bench.outcomes(more)
    found: Points = {}
    for n, (key, setting) in enumerate(chosen.items()):
        name, quantity, kind = key
        there = judges[n]
        value = nan if there.failure else float(scores(there.numbers)[quantity])
        heat = bench.heat(cases[name], plain[n], outcomes[n].numbers)
        found[key] = Point(name, quantity, kind, setting, heat, plain[n], rungs[n], value)
    return found


def _more_complete(name: Name) -> str:
    """The circuit to confirm a machine's points on; of an ideal current there is none."""
    if name == IDEAL:
        return "ideal"
    return "full" if name[0] == "current limit" else "amplifier"


def _on_full(bench: Bench, cases: dict[Name, Case], points: Points) -> Points:
    corners = [key for key in points if key[0] in CORNERS]
    runs = [points[key].settings | {"circuit.model": "full"} for key in corners]
    found = dict(points)
    for key, outcome in zip(corners, bench.outcomes(runs), strict=True):
        if not outcome.failure:
            value = float(scores(outcome.numbers)[key[1]])
            found[key] = replace(points[key], full=value)
    return found


def judged(bench: Bench, study: Study, points: Points, told: Callable[[str], object]) -> Points:
    """The limits that only the amplifier has: for each value the best among the settings that were
    found for the scene's own circuit and those of its ``points``, and the robust one. The own
    circuit's points stand among them, on the amplifier, too.
    """
    rig = study.rigs[0]
    kept = [point.setting for key, point in points.items() if key[0] == OWN]
    for best in rig.found[OWN]:
        kept += [*best.settings[:2], *best.robust[:2]]
    places = list(dict.fromkeys(setting.place for setting in kept))
    found: Points = {}
    here = changed(bench.scene, rig.settings, rig.name)
    asked: dict[Name, Machine] = {}
    for limit in study.limits:
        if limit.rung == "amplifier":
            asked[limit.name, limit.own(here)] = Machine()
            for value in (*limit.values, limit.gone):
                asked[limit.name, value] = limit.machine(here, value)
    for name, machine in asked.items():
        case = Case(rig.settings, machine, "amplifier")
        every = [case.settings(np.array(place)) for place in places]
        outcomes = bench.outcomes(every)
        for quantity in range(len(QUANTITIES)):
            values = {
                place: (value, settings, outcome)
                for place, settings, outcome in zip(places, every, outcomes, strict=True)
                if not outcome.failure
                and bench.bearable(case, settings, outcome.numbers)
                and (value := float(scores(outcome.numbers)[quantity])) > 0.0  # achievable
            }
            if not values:
                continue
            top = max(values, key=lambda place: values[place][0])
            chosen = {"best": top}
            robust = points.get((OWN, quantity, "robust"))
            if robust is not None and robust.setting.place in values:
                chosen["robust"] = robust.setting.place
            for kind, place in chosen.items():
                value, settings, outcome = values[place]
                heat = bench.heat(case, settings, outcome.numbers)
                setting = Setting(place, value, nan, nan)
                key = (name, quantity, kind)
                found[key] = Point(*key, setting, heat, settings, "amplifier", value)
    told("judged on the amplifier")
    return found
