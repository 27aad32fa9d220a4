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
from cosim.studies.limits.search import Bests, Effort, Search, Setting
from cosim.studies.limits.table import LIMITS, Limit, Machine, Settings


@dataclass(frozen=True)
class Efforts:
    """What the searches may cost."""

    first: Effort
    """Of a circuit of the scene's own rig."""
    next: Effort
    """Of the same in a round."""
    others: Effort
    """Of the other rigs of an ensemble, and of the own rig when it is searched again."""
    rounds: tuple[int, int]
    """In which what is best on one machine of a rig is tried on all, and climbed on from: on the
    own rig, and on the others."""
    rigs: int
    """Of an ensemble, spread over their order, which is that of their cost."""


FULL = Efforts(
    Effort(512, (0.08, 0.05, 0.04, 0.03, 0.025, 0.02, 0.01, 0.005), 4),
    Effort(32, (0.04, 0.02, 0.01, 0.005), 4),
    Effort(32, (0.04, 0.02, 0.01, 0.005), 2),
    (3, 2),
    3,
)
_COARSE = Effort(32, (0.05, 0.02), 2)
QUICK = Efforts(Effort(64, (0.05, 0.02), 2), _COARSE, _COARSE, (1, 1), 1)

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

    ``told`` hears of each machine when it is done. The same for the same seed.
    """
    found = []
    # The last is the own rig once more, searched like the others.
    for number, settings in enumerate([{}, *rigs, {}]):
        again = number == len(rigs) + 1
        name = "another seed" if again else f"rig {number}" if number else "its own rig"
        rig = Rig(name, settings)
        scene = changed(bench.scene, rig.settings, rig.name)
        rig.cases = _cases(scene, settings, limits, all_values=number == 0)
        first, later = (efforts.others,) * 2 if number else (efforts.first, efforts.next)
        _search(bench, rig, (seed, number), first, later, efforts.rounds[number > 0], told)
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
    first: Effort,
    later: Effort,
    rounds: int,
    told: Callable[[str], object],
) -> None:
    searches = rig.searches
    for number, (name, case) in enumerate(rig.cases.items()):
        search = searches[name] = Search(partial(bench.scores, case), (*seed, number))
        search.run(first, _hints(bench, rig, name, _kin(rig, name)))
        rig.found[name] = search.bests()
        told(f"{rig.name}: {name[0]} {name[1]:.3g}")
    for number in range(1, rounds + 1):
        # What is best on one machine is tried on all, and climbed on from where it is better.
        for name, search in searches.items():
            search.climb(later, _hints(bench, rig, name, rig.found))
            rig.found[name] = search.bests()
            told(f"{rig.name}, round {number}: {name[0]} {name[1]:.3g}")
    for name, search in searches.items():
        # What its kin does best is looked at closely: no machine is the worse for a lifted limit
        # only because its search has missed that.
        rig.found[name] = search.bests(_of_kin(bench, rig, name))


def _of_kin(bench: Bench, rig: Rig, name: Name) -> list[Array]:
    """For each quantity the best places of a machine's kin, but for the ideal current's."""
    kin = [other for other in _kin(rig, name) if other not in (name, IDEAL)]
    every = []
    for quantity in range(len(QUANTITIES)):
        places = [np.empty((0, KNOB_COUNT))]
        for other in kin:
            tops = rig.found[other][quantity].tops
            places.append(moved(bench, tops, rig.cases[other], rig.cases[name]))
        every.append(np.vstack(places))
    return every


def _kin(rig: Rig, name: Name) -> list[Name]:
    """Of the machines that were searched those that are most like one."""
    return [other for other in rig.found if other in (OWN, IDEAL) or other[0] == name[0]]


def _hints(bench: Bench, rig: Rig, name: Name, others: Iterable[Name]) -> Array:
    here, cases = rig.cases[name], rig.cases
    found = [_as_hints(bench, rig.found[other], cases[other], here) for other in others]
    return np.vstack([np.empty((0, KNOB_COUNT)), *found])


def _as_hints(bench: Bench, found: Bests, there: Case, here: Case) -> Array:
    """The settings found for one machine as places of another."""
    tops = [one for best in found for one in best.tops]
    return np.unique(moved(bench, tops, there, here), axis=0)


def moved(bench: Bench, found: Sequence[Setting], there: Case, here: Case) -> Array:
    """Settings of one machine as places (rows) of another, with the same currents."""
    places = np.array([one.place for one in found]).reshape(-1, KNOB_COUNT)
    ratio = bench.amperes(there) / bench.amperes(here)
    return rounded(places * [ratio, 1.0, ratio])


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
