"""Judges what the cheapest circuit has found by circuits with more in them.

A setting that the amplifier refutes gives way to the next one; where all good ones are refuted, the
best is sought on the amplifier itself. The limits that the cheapest circuit does not have
are turned here, at the settings found for the scene's own circuit, from which a climb begins where
the limit costs.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from cosim.arrays import Array
from cosim.scene import changed
from cosim.studies.limits.aims import KNOB_COUNT, Numbers, scores
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import STEADY_APART, Clouds, Leads, Search, Setting
from cosim.studies.limits.study import OWN, Name, Rig, Study, moved
from cosim.studies.limits.table import Limit, Machine, Settings

WITHIN = 0.02
"""Relative difference of a confirmed value."""

POORER = 0.05
"""So much less than a refuted setting does where it was judged, a confirmed one is passed over."""

SPARE = 4
"""Settings that stand by where one is refuted: the best of its own search, those with the best
surroundings there, and the best of other machines, so many of each."""

AT_LIMIT = 0.999
"""Of a current limit: where the current reaches so far, the limit acted."""

KINDS = ("best", "robust")

JUDGE = (Clouds(0.01, 2, 4), Clouds(0.002, 2, 6))
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
    where it confirms none, or only much poorer ones, the best one is that found there.

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
    places = np.unique([one.setting.place for one in tried], axis=0)
    there = replace(case, rung=point.rung)
    found = _climbed(bench, there, (point.name, point.quantity, point.kind), places)
    return replace(found, refuted=point.refuted) if found else point


def _climbed(bench: Bench, case: Case, key: Key, places: Array) -> Point | None:
    """The best that a climb from places (rows) finds on a circuit, if any of it is achievable."""

    def ask(places: Array) -> tuple[Array, NDArray[np.bool_]]:
        found, borne = bench.scores(case, places)
        return found[:, [key[1]]], borne

    search = Search(ask, (0,), 1)
    search.climb(JUDGE, Leads(places, search.scores(places)))
    best = search.ranked(0, STEADY_APART, 1)
    value = float(search.scores(best).max(initial=0.0))
    if value <= 0.0:
        return None
    return _at(bench, case, key, best[0], value)


def _at(bench: Bench, case: Case, key: Key, place: Array, value: float) -> Point:
    """A place with its value on the circuit that judges."""
    settings = case.settings(place)
    heat = bench.heat(case, settings, bench.outcomes([settings])[0].numbers)
    setting = Setting(tuple(place.tolist()), value, nan, nan)
    return Point(*key, setting, heat, settings, case.rung, value)


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
    outcomes = bench.outcomes(plain)
    rungs = [
        _more_complete(bench, cases[key[0]], settings, outcome.numbers)
        for key, settings, outcome in zip(chosen, plain, outcomes, strict=True)
    ]
    more = [s | {"circuit.model": rung} for s, rung in zip(plain, rungs, strict=True)]
    judges = bench.outcomes(more)
    found: Points = {}
    for n, (key, setting) in enumerate(chosen.items()):
        name, quantity, kind = key
        there = judges[n]
        value = nan if there.failure else float(scores(there.numbers)[quantity])
        heat = bench.heat(cases[name], plain[n], outcomes[n].numbers)
        found[key] = Point(name, quantity, kind, setting, heat, plain[n], rungs[n], value)
    return found


def _more_complete(bench: Bench, case: Case, settings: Settings, numbers: Numbers) -> str:
    """The circuit to confirm a run on; of an ideal current there is none. The amplifier has no
    current limit: where that acted, the whole schematic judges."""
    if case.rung == "ideal":
        return "ideal"
    limit = float(settings.get("circuit.current_limit", bench.scene.circuit.current_limit))
    peak = max(numbers["current_max"], -numbers["current_min"]) * bench.scene.coil.count
    return "full" if peak > AT_LIMIT * limit else "amplifier"


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
    found for the scene's own circuit and those of its ``points``, and the robust one, with its
    value. The own circuit's points stand among them, on the amplifier, too.

    Where the best does worse than it does on the own circuit, it is climbed on from.
    """
    rig = study.rigs[0]
    kept = [point.setting for key, point in points.items() if key[0] == OWN]
    for best in rig.found[OWN]:
        kept += [*best.settings[:2], *best.robust[:2]]
    rows = list(dict.fromkeys(setting.place for setting in kept))
    limits = [limit for limit in study.limits if limit.rung == "amplifier"] if rows else []
    found: Points = {}
    # What a climb finds for one value is tried for all.
    for climbing in (True, False):
        places = np.array(rows)
        for limit in limits:
            found |= _on_amplifier(bench, rig, limit, places, points, climbing)
        rows = list(dict.fromkeys([*rows, *(point.setting.place for point in found.values())]))
    told("judged on the amplifier")
    return found


def _on_amplifier(
    bench: Bench, rig: Rig, limit: Limit, places: Array, points: Points, climbing: bool
) -> Points:
    """For each value of a limit, and for its own, the best of places (rows), or of what a climb
    finds, and that of the own circuit's robust ``points``."""
    here = changed(bench.scene, rig.settings, rig.name)
    own, rows = limit.own(here), [tuple(place) for place in places.tolist()]
    found: Points = {}
    for value in dict.fromkeys((own, *limit.values, limit.gone)):
        machine = Machine() if value == own else limit.machine(here, value)
        name, case = (limit.name, value), Case(rig.settings, machine, "amplifier")
        every, borne = bench.scores(case, places)
        every[~borne] = -inf
        for quantity, column in enumerate(every.T):
            above = found.get(((limit.name, own), quantity, "best")) if climbing else None
            top = _top(bench, case, (name, quantity, "best"), places, column, above)
            if top:
                found[name, quantity, "best"] = top
            firm = points.get((OWN, quantity, "robust"))
            if firm and column[row := rows.index(firm.setting.place)] > 0.0:
                key = name, quantity, "robust"
                found[key] = _at(bench, case, key, places[row], float(column[row]))
    return found


def _top(
    bench: Bench, case: Case, key: Key, places: Array, column: Array, above: Point | None
) -> Point | None:
    """The best of places (rows) by their values, or what a climb from them finds where that does
    worse than ``above``."""
    row = int(column.argmax())
    value = max(float(column[row]), 0.0)
    if above and value < (1.0 - WITHIN) * above.confirmed:
        return _climbed(bench, case, key, places)
    return _at(bench, case, key, places[row], value) if value else None
