"""The study: each limit at each value, on each rig, with the best settings of the knobs found anew.

What is found for one machine is tried on the others of its rig, so that a difference between two
machines is not the luck of two searches.
"""

import json
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil
from pathlib import Path
from types import MappingProxyType

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.scene import Scene, changed
from cosim.search.local import STEADY_APART
from cosim.search.protocol import apart
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import NOWHERE, Bests, Effort, Frontiers, Leads
from cosim.studies.limits.table import LIMITS, Limit, Machine, Settings


@dataclass(frozen=True)
class Efforts:
    """What the searches may cost."""

    own: Effort
    """Of a circuit of the scene's own rig."""
    again: Effort
    """Of the own rig when it is searched again."""
    others: Effort
    """Of the other rigs of an ensemble, whose searches begin with what is best on the own one."""
    rigs: int
    """Of an ensemble, spread over their order, which is that of their cost."""

    def times(self, factor: float) -> "Efforts":
        """So many times the runs, roughly, of each search."""

        def more(effort: Effort) -> Effort:
            numbers = ("design", "first", "later")
            return replace(
                effort, **{name: ceil(factor * getattr(effort, name)) for name in numbers}
            )

        return replace(self, own=more(self.own), again=more(self.again), others=more(self.others))


FULL = Efforts(
    own=Effort(design=1024, first=8, later=6, rounds=2, looks=2),
    again=Effort(design=128, first=4, later=2, rounds=1),
    others=Effort(design=64, first=3, later=2, rounds=1),
    rigs=3,
)
_FEW = Effort(design=32, first=1, later=0, rounds=1)
QUICK = Efforts(Effort(design=64, first=1, later=1, rounds=1), _FEW, _FEW, rigs=1)

FIRST, LATER = 0.06, 0.03
"""Standard deviations with which samples begin, as shares of a knob's turn."""

CLOSE, HINTS = 0.02, 24
"""Warm starts closer than this to a better one are dropped; so many are kept for each quantity."""

Name = tuple[str, float]
"""A limit and its value; OWN and IDEAL besides."""

OWN, IDEAL = ("own", 0.0), ("ideal current", 0.0)


@dataclass
class Rig:
    """What was found on one rig."""

    name: str
    settings: Settings
    cases: dict[Name, Case] = field(default_factory=dict[Name, Case])
    found: dict[Name, Bests] = field(default_factory=dict[Name, Bests])
    searches: dict[Name, Frontiers] = field(default_factory=dict[Name, Frontiers])


@dataclass
class Study:
    """What was found: the scene's own rig first, then those of the ensemble.

    ``again`` is the own circuit of the first rig, searched anew with another seed and less effort.
    """

    scene: Scene
    limits: Sequence[Limit]
    rigs: list[Rig]
    again: Bests


def searched(limits: Iterable[Limit]) -> list[Limit]:
    """The limits for each value of which a search is made."""
    return [limit for limit in limits if limit.searched]


def climbed(limits: Iterable[Limit]) -> list[Limit]:
    """The others that the cheapest circuit has: there it climbs from what is best elsewhere."""
    return [limit for limit in limits if limit.rung == "limited" and not limit.searched]


def told_count(limits: Sequence[Limit], efforts: Efforts, rigs: int) -> int:
    """How many machines :func:`study` tells of, each round anew, with so many rigs besides the
    scene's own."""
    lifted = 2 + len(searched(limits))
    every = lifted + sum(len(limit.values) for limit in searched(limits))
    climbs = sum(len(limit.values) for limit in climbed(limits))
    of_rigs = (1 + efforts.again.rounds) + rigs * (1 + efforts.others.rounds)
    return every * (1 + efforts.own.rounds) + climbs + lifted * of_rigs


def study(
    bench: Bench,
    rigs: Sequence[Settings],
    limits: Sequence[Limit] = LIMITS,
    seed: int = 0,
    efforts: Efforts = FULL,
    told: Callable[[str], object] = lambda name: None,
) -> Study:
    """Search the machines of the bench's scene, and those of ``rigs`` with each limit lifted.

    ``told`` hears of each machine in each round. The same for the same seed.
    """
    own = Rig("its own rig", {}, _cases(bench.scene, {}, limits, all_values=True))
    late = {
        (limit.name, value): Case({}, limit.machine(bench.scene, value))
        for limit in climbed(limits)
        for value in limit.values
    }
    _search(bench, own, (seed, 0), efforts.own, told, late=late)
    found = [own]
    for number, settings in enumerate(rigs, 1):
        scene = changed(bench.scene, settings, f"rig {number}")
        rig = Rig(f"rig {number}", settings, _cases(scene, settings, limits))
        _search(bench, rig, (seed, number), efforts.others, told, own)
        found.append(rig)
    again = Rig("another seed", {}, _cases(bench.scene, {}, limits))
    _search(bench, again, (seed, len(found)), efforts.again, told)
    return Study(bench.scene, limits, found, again.found[OWN])


def _cases(
    scene: Scene, rig: Settings, limits: Iterable[Limit], all_values: bool = False
) -> dict[Name, Case]:
    """The machines of a rig, with each limit lifted, and with ``all_values``."""
    cases = {OWN: Case(rig, Machine()), IDEAL: Case(rig, Machine(), "ideal")}
    for limit in searched(limits):
        for value in (*limit.values, limit.gone) if all_values else (limit.gone,):
            cases[limit.name, value] = Case(rig, limit.machine(scene, value))
    return cases


def _search(
    bench: Bench,
    rig: Rig,
    seed: tuple[int, int],
    effort: Effort,
    told: Callable[[str], object],
    known: Rig | None = None,
    late: Mapping[Name, Case] = MappingProxyType({}),
) -> None:
    """Search the machines of a rig, from the best places of ``known``, if there is one; those in
    ``late`` only climb from what is best on the others."""
    searches = rig.searches
    leads: dict[Name, Leads] = {}
    for number, (name, case) in enumerate(rig.cases.items()):
        search = searches[name] = Frontiers(partial(bench.scores, case), (*seed, number))
        search.fill(effort.design)
        if known:
            there = known.searches[name].leads()
            points = moved(bench, there.points, known.cases[name], case)
            search.heed(Leads(points, there.scores))
        leads[name] = search.leads()
    for number in range(1 + effort.rounds):
        # The others' optima are run too, so that relaxing a limit never lowers what is found.
        for name, search in searches.items():
            search.heed(_hints(bench, rig, leads, name))
            search.climb(*((LATER, effort.later) if number else (FIRST, effort.first)))
            leads[name] = search.leads()
            told(f"{rig.name}, round {number}: {name[0]} {name[1]:.3g}")
    for name, case in late.items():
        rig.cases[name] = case
        hints = _hints(bench, rig, leads, name)
        if len(hints.points):
            searches[name] = Frontiers(partial(bench.scores, case), (*seed, len(rig.cases)))
            searches[name].heed(hints)
            searches[name].climb(LATER, effort.later)
        told(f"{rig.name}: {name[0]} {name[1]:.3g}")
    rig.found = {name: search.bests(effort.looks) for name, search in searches.items()}
    for name, search in searches.items():
        rig.found[name] = search.bests(effort.looks, _of_kin(bench, rig, name))


def _of_kin(bench: Bench, rig: Rig, name: Name) -> list[Array]:
    """For each quantity, as far as they lie apart, the best places of the scene's own circuit and
    of the same limit's other values; for the own circuit those of all limits."""
    kin = [
        other
        for other in rig.found
        if other not in (name, IDEAL) and (OWN in (name, other) or other[0] == name[0])
    ]
    every = []
    for quantity in range(len(QUANTITIES)):
        points = [NOWHERE]
        for other in kin:
            tops = np.array([one.point for one in rig.found[other][quantity].tops])
            points.append(moved(bench, tops, rig.cases[other], rig.cases[name]))
        tried = np.vstack(points)
        every.append(tried[apart(tried, STEADY_APART, len(tried))])
    return every


def _hints(bench: Bench, rig: Rig, leads: dict[Name, Leads], name: Name) -> Leads:
    """The leads of all other machines as points of one, for each quantity without those that lie
    close to one that does better on its own machine."""
    others = [other for other in leads if other != name]
    points = np.vstack(
        [moved(bench, leads[x].points, rig.cases[x], rig.cases[name]) for x in others]
    )
    relative = np.vstack([_relative(leads[x].scores) for x in others])
    kept: set[int] = set()
    for quantity in range(len(QUANTITIES)):
        order = np.argsort(-relative[:, quantity], kind="stable")
        kept |= set(order[apart(points[order], CLOSE, HINTS)].tolist())
    rows = sorted(kept)
    return Leads(points[rows], np.vstack([leads[x].scores for x in others])[rows])


def _relative(scores: Array) -> Array:
    """Scores (rows), relative to the best of each column."""
    best = np.abs(scores.max(axis=0, initial=-np.inf))
    found: Array = scores / np.where(np.isfinite(best) & (best > 0.0), best, 1.0)
    return found


def moved(bench: Bench, points: Array, there: Case, here: Case) -> Array:
    """Points (rows) of one machine as points of another, with the same currents."""
    ratio = bench.amperes(there) / bench.amperes(here)
    return np.clip(points.reshape(-1, KNOB_COUNT) * [ratio, 1.0, ratio], 0.0, 1.0)


def ensemble(path: Path, most: int, normal_force: float) -> list[Settings]:
    """The rigs of a file: the tables of its list ``ensemble``, each of keys ("table.key") and
    values, SI; of entries without a dot only ``normal_force_ratio`` counts, by which a rig wants
    another normal force than the scene's, N. Of more than ``most`` these are spread over
    the list, without its first, the best, for which the scene stands.

    Raises BadInput.
    """
    name = plain(str(path))
    try:
        text = path.read_text(encoding="utf-8")
        said = tomllib.loads(text) if path.suffix == ".toml" else json.loads(text)
    except OSError as error:
        raise BadInput(f"{name}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise BadInput(f"{name}: is neither JSON nor, named .toml, TOML ({error}).") from error
    rigs = said.get("ensemble") if isinstance(said, dict) else None
    if not isinstance(rigs, list) or not rigs or not all(isinstance(rig, dict) for rig in rigs):
        raise BadInput(f'{name}: has no list "ensemble" of tables of keys and values.')
    if len(rigs) > most:
        places = np.linspace(0, len(rigs) - 1, most + 1)[1:]
        rigs = [rigs[k] for k in np.unique(places.round().astype(int)).tolist()]
    found = [{key: value for key, value in rig.items() if "." in key} for rig in rigs]
    for settings, rig in zip(found, rigs, strict=True):
        if isinstance(ratio := rig.get("normal_force_ratio"), int | float):
            settings.setdefault("friction.normal_force", ratio * normal_force)
    return found


def checked(scene: Scene, rigs: Sequence[Settings], file: str | os.PathLike[str] | None) -> None:
    """Refuse a scene or a rig that cannot be studied. Raises BadInput."""
    if not scene.rung.on_ladder:
        raise BadInput(
            f'scene {scene.name}: circuit.model = "{scene.circuit.model}" has no limits to lift; '
            'it must be "full", "amplifier", "limited", "ideal" or "auto".'
        )
    if scene.drive.waveform != "sawtooth":
        raise BadInput(
            f'scene {scene.name}: drive.waveform = "{scene.drive.waveform}" has no knobs to search.'
        )
    for number, rig in enumerate(rigs):
        changed(scene, rig, f"{plain(str(file))}, ensemble {number}")
