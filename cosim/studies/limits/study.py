"""The study: each limit at each value, on each rig, with the best settings of the knobs found anew.

What is found for one machine is tried on the others of its rig, so that a difference between two
machines is not the luck of two searches.
"""

import json
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.scene import Scene, changed
from cosim.studies.limits.aims import KNOB_COUNT, QUANTITIES, rounded
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import (
    NOWHERE,
    STEADY_APART,
    Bests,
    Clouds,
    Effort,
    Leads,
    Search,
    apart,
)
from cosim.studies.limits.table import LIMITS, Limit, Machine, Settings


@dataclass(frozen=True)
class Efforts:
    """What the searches may cost."""

    own: Effort
    """Of a circuit of the scene's own rig."""
    others: Effort
    """Of the other rigs of an ensemble, and of the own rig when it is searched again."""
    rounds: tuple[int, int]
    """In which what is best on one machine of a rig is tried on all, and climbed on from: on the
    own rig, and on the others; after the first."""
    rigs: int
    """Of an ensemble, spread over their order, which is that of their cost."""


def _clouds(*every: tuple[float, int, int, int]) -> tuple[Clouds, ...]:
    return tuple(Clouds(*one) for one in every)


FULL = Efforts(
    Effort(
        1024,
        _clouds(
            *((0.06, 8, 4, 1), (0.04, 6, 4, 1), (0.02, 4, 4, 4), (0.01, 2, 4, 8)),
            *((0.005, 1, 4, 8), (0.002, 1, 4, 6), (0.001, 1, 4, 6)),
        ),
        _clouds((0.03, 3, 4, 1), (0.01, 2, 4, 4), (0.003, 1, 4, 6), (0.001, 1, 4, 6)),
    ),
    Effort(
        128,
        _clouds((0.05, 4, 4, 1), (0.02, 2, 4, 2), (0.005, 1, 4, 4), (0.001, 1, 4, 3)),
        _clouds((0.02, 2, 4, 1), (0.005, 1, 4, 2), (0.001, 1, 4, 2)),
    ),
    (2, 1),
    3,
)
_COARSE = _clouds((0.05, 2, 2, 1), (0.02, 1, 4, 1))
QUICK = Efforts(Effort(64, _COARSE, _COARSE), Effort(32, _COARSE, _COARSE), (1, 1), 1)

CLOSE_BY, HINTS = 0.02, 24
"""Of places of other machines closer than this, of a knob's turn, one is tried; and how many for
each quantity."""

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
    searches: dict[Name, Search] = field(default_factory=dict[Name, Search])


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
    """The limits that the cheapest circuit has, so that a search can be made for each value."""
    return [limit for limit in limits if limit.rung == "limited"]


def search_count(limits: Iterable[Limit], rounds: int, all_values: bool) -> int:
    """How many searches and rounds of them a rig takes."""
    machines = 2 + sum(1 + all_values * len(limit.values) for limit in searched(limits))
    return machines * (1 + rounds)


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
    found = []
    # The last is the own rig once more, searched like the others.
    for number, settings in enumerate([{}, *rigs, {}]):
        again = number == len(rigs) + 1
        name = "another seed" if again else f"rig {number}" if number else "its own rig"
        rig = Rig(name, settings)
        scene = changed(bench.scene, rig.settings, rig.name)
        rig.cases = _cases(scene, settings, limits, all_values=number == 0)
        effort = efforts.others if number else efforts.own
        _search(bench, rig, (seed, number), effort, efforts.rounds[number > 0], told)
        found.append(rig)
    return Study(bench.scene, limits, found[:-1], found[-1].found[OWN])


def _cases(
    scene: Scene, rig: Settings, limits: Iterable[Limit], all_values: bool
) -> dict[Name, Case]:
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
    rounds: int,
    told: Callable[[str], object],
) -> None:
    searches = rig.searches
    leads: dict[Name, Leads] = {}
    for number, (name, case) in enumerate(rig.cases.items()):
        search = searches[name] = Search(partial(bench.scores, case), (*seed, number))
        search.fill(effort.design)
        leads[name] = search.leads()
    for number in range(1 + rounds):
        # What is best on one machine is tried on all, and climbed on from where it is better.
        for name, search in searches.items():
            hints = _hints(bench, rig, leads, name)
            search.climb(effort.next if number else effort.first, hints)
            leads[name] = search.leads()
            told(f"{rig.name}, round {number}: {name[0]} {name[1]:.3g}")
    rig.found = {name: search.bests() for name, search in searches.items()}
    for name, search in searches.items():
        # What its kin does best is looked at closely: no machine is the worse for a lifted limit
        # only because its search has missed that.
        rig.found[name] = search.bests(_of_kin(bench, rig, name))


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
        places = [NOWHERE]
        for other in kin:
            tops = np.array([one.place for one in rig.found[other][quantity].tops])
            places.append(moved(bench, tops, rig.cases[other], rig.cases[name]))
        tried = np.vstack(places)
        every.append(tried[apart(tried, STEADY_APART, len(tried))])
    return every


def _hints(bench: Bench, rig: Rig, leads: dict[Name, Leads], name: Name) -> Leads:
    """The leads of all other machines as places of one, for each quantity without those that lie
    close to one that does better on its own machine."""
    others = [other for other in leads if other != name]
    places = np.vstack(
        [moved(bench, leads[x].places, rig.cases[x], rig.cases[name]) for x in others]
    )
    relative = np.vstack([_relative(leads[x].scores) for x in others])
    kept: set[int] = set()
    for quantity in range(len(QUANTITIES)):
        order = np.argsort(-relative[:, quantity], kind="stable")
        kept |= set(order[apart(places[order], CLOSE_BY, HINTS)].tolist())
    rows = sorted(kept)
    return Leads(places[rows], np.vstack([leads[x].scores for x in others])[rows])


def _relative(scores: Array) -> Array:
    """Scores (rows), relative to the best of each column."""
    best = np.abs(scores.max(axis=0, initial=-np.inf))
    found: Array = scores / np.where(np.isfinite(best) & (best > 0.0), best, 1.0)
    return found


def moved(bench: Bench, places: Array, there: Case, here: Case) -> Array:
    """Places (rows) of one machine as places of another, with the same currents."""
    ratio = bench.amperes(there) / bench.amperes(here)
    return rounded(places.reshape(-1, KNOB_COUNT) * [ratio, 1.0, ratio])


def ensemble(path: Path, most: int) -> list[Settings]:
    """The rigs of a file: the tables of its list ``ensemble``, each of keys ("table.key") and
    values, SI; entries without a dot are passed over. Of more than ``most`` these are spread over
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
    return [{key: value for key, value in rig.items() if "." in key} for rig in rigs]


def checked(scene: Scene, rigs: Sequence[Settings], path: Path) -> None:
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
        changed(scene, rig, f"{plain(str(path))}, ensemble {number}")
