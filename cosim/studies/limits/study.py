"""The study: each change on each rig, with the knobs set anew, and judged."""

import json
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.store import Store
from cosim.files.reader import read
from cosim.scene import Scene
from cosim.simulation.summary import budget
from cosim.studies.limits.changes import AS_IT_IS, CHANGES, Change, Settings
from cosim.studies.limits.judge import TRIES, Key, Point, confirmed, judged, tried
from cosim.studies.limits.runs import Bench, Goal
from cosim.studies.limits.search import KINDS, Candidates, Effort, searched


@dataclass(frozen=True)
class Efforts:
    """What the searches may cost: of each machine by itself, and once all others are known."""

    own: tuple[Effort, Effort]
    others: tuple[Effort, Effort]
    """On the other rigs, whose searches begin with what was found on the scene's own."""
    again: int
    """How often some machines are searched with other seeds, which tells the search's noise."""

    def times(self, factor: float) -> "Efforts":
        """So many times as much."""
        own, others = ((a.times(factor), b.times(factor)) for a, b in (self.own, self.others))
        return Efforts(own, others, self.again)


FULL = Efforts(
    own=(Effort(512, 300, 120), Effort(0, 100, 50)),
    others=(Effort(64, 40, 25), Effort(0, 20, 10)),
    again=3,
)
_FEW = Effort(32, 20, 10)
QUICK = Efforts(own=(Effort(64, 40, 20), _FEW), others=(_FEW, Effort(0, 10, 10)), again=1)

REPEATED = ("as it is", "falling sawtooth", "sine", "supply ±10 V")
"""Changes that are searched again."""


@dataclass(frozen=True)
class Rig:
    """What was found on one rig."""

    settings: Settings
    points: dict[Key, Point]

    def point(self, change: Change, goal: Goal, kind: str) -> Point | None:
        """What stands for a change; None where nothing was found."""
        return self.points.get((change.name, goal.name, kind))


@dataclass(frozen=True)
class Study:
    """What was found: on the scene's own rig, first, and on others."""

    scene: Scene
    changes: Sequence[Change]
    rigs: list[Rig]
    repeats: list[dict[Key, Point]]
    """Of REPEATED on the own rig, searched alone with other seeds."""

    @property
    def slips(self) -> list[Mapping[str, tuple[float, float]]]:
        """Accelerations of the surface, m/s², beyond which a part slips on its way up or down, on
        each rig."""
        return [budget(Bench.base(self.scene, rig.settings, "a rig")) for rig in self.rigs]


def steps(efforts: Efforts, changes: Sequence[Change], rigs: int) -> int:
    """How many steps :func:`study` tells."""
    some = sum(change.searched for change in changes)
    repeated = sum(change.name in REPEATED for change in changes)
    return (2 * some + 1) * (1 + rigs) + efforts.again * repeated + bool(efforts.again)


def study(
    scene: Scene,
    rigs: Sequence[Settings],
    store: Store,
    open_: Callable[[Scene], Evaluator],
    seed: int = 0,
    efforts: Efforts = FULL,
    changes: Sequence[Change] = CHANGES,
    told: Callable[[str], object] = lambda what: None,
) -> Study:
    """Search and judge ``changes`` on the scene's own rig and on ``rigs``.

    ``store`` keeps what is found, machine by machine; ``open_`` makes the evaluator of a rig.
    ``told`` hears of each step. The same for the same seed.
    """
    found: list[Rig] = []
    repeats: list[dict[Key, Point]] = []
    searched = [change for change in changes if change.searched]
    own: dict[str, Candidates] = {}
    for number, rig in enumerate([{}, *rigs]):
        base = Bench.base(scene, rig, f"rig {number}")
        with open_(base) as evaluator:
            work = _Work(Bench(base, evaluator), store, number, changes, told)
            first, second = efforts.others if number else efforts.own
            alone = work.candidates(searched, first, [seed, number, 0], own)
            # Each with the best of all others, so that what helps one is tried on all, and a limit
            # that is eased never lowers what is found.
            words, seeds = ", with what helps others", [seed, number, 1]
            both = work.candidates(searched, second, seeds, alone, alone, words)
            found.append(Rig(rig, work.points(both, own=not number)))
            if number:
                continue
            own = both
            again = [change for change in changes if change.name in REPEATED]
            for other in range(efforts.again):
                apart = work.candidates(again, first, [seed, number, 2 + other])
                repeats.append(work.points(apart, name=f"repeat {other}"))
            if efforts.again:
                told("searched again")
    return Study(scene, changes, found, repeats)


_NOTHING: Mapping[str, Candidates] = MappingProxyType({})


@dataclass(frozen=True)
class _Work:
    """What is done on one rig, each piece once: ``store`` keeps it."""

    bench: Bench
    store: Store
    rig: int
    changes: Sequence[Change]
    told: Callable[[str], object]

    def candidates(
        self,
        changes: Sequence[Change],
        effort: Effort,
        seed: list[int],
        known: Mapping[str, Candidates] = _NOTHING,
        others: Mapping[str, Candidates] = _NOTHING,
        words: str = "",
    ) -> dict[str, Candidates]:
        """The candidates of each change by name, from its own that are ``known`` and the best of
        those of all ``others``."""
        found: dict[str, Candidates] = {}
        for number, change in enumerate(changes):
            warm = [self._warm(change, other, others) for other in changes if others]
            machine, own = change.machine(self.bench.scene), known.get(change.name)
            seeds = [*seed, number]
            search = partial(searched, self.bench, machine, effort, seeds, own, warm)
            found[change.name] = self.store.once(f"{change.name} {seeds}", search)
            self.told(f"rig {self.rig}{words}: {change.name}")
        return found

    def _warm(self, change: Change, other: Change, found: Mapping[str, Candidates]) -> Candidates:
        """The best one for each goal of another change, its shape as levels where this one's
        command has such: the nearest that it has."""
        machine, there = (one.machine(self.bench.scene) for one in (change, other))
        more: list[float] = []
        if machine.levels and not there.levels:
            more = there.sampled(self.bench.scene, machine.levels).tolist()
        of = found[other.name]
        return {kind: [[[*one, *more] for one in some[:1]] for some in of[kind]] for kind in KINDS}

    def points(
        self, candidates: dict[str, Candidates], own: bool = False, name: str = ""
    ) -> dict[Key, Point]:
        """The judged points of machines; on the scene's ``own`` rig also by the amplifier, and with
        those of the changes that are not searched."""
        found = self.store.once(f"judged {self.rig} {name}", partial(self._judge, candidates, own))
        if not name:
            self.told(f"rig {self.rig}: judged")
        return {(change, goal, kind): Point(**of) for (change, goal, kind), of in found}

    def _judge(
        self, candidates: dict[str, Candidates], own: bool
    ) -> list[tuple[Key, dict[str, Any]]]:
        machines = {change.name: change.machine(self.bench.scene) for change in self.changes}
        kinds, tries = (KINDS, TRIES) if own else (KINDS[1:], 1)
        found = judged(self.bench, machines, candidates, kinds, tries)
        if own:
            others = [change.name for change in self.changes if not change.searched]
            found = confirmed(self.bench, machines, found)
            own_points = {key: one for key, one in found.items() if key[0] == AS_IT_IS.name}
            found |= tried(self.bench, machines, others, own_points)
        return [(key, vars(point)) for key, point in found.items()]


ALIKE = 1.25
"""Ratio of the values of every key up to which a rig is the scene's own, by the digits and the step
that a search ended with."""


MOST_BYTES = 1 << 24
"""Of a file of rigs."""


def ensemble(path: Path, scene: Scene) -> list[Settings]:
    """The rigs of a file, without those for which the scene stands: the tables of its list
    ``ensemble``, each of keys ("table.key") and values, SI; of entries without a dot only
    ``normal_force_ratio`` counts, by which a rig wants another normal force than the scene's, N.

    Raises BadInput.
    """
    name = plain(str(path))
    content = read(path, MOST_BYTES)
    try:
        text = content.decode()
        said = tomllib.loads(text) if path.suffix == ".toml" else json.loads(text)
    except ValueError as error:
        raise BadInput(f"{name}: is neither JSON nor, named .toml, TOML ({error}).") from error
    rigs = said.get("ensemble") if isinstance(said, dict) else None
    if not isinstance(rigs, list) or not rigs or not all(isinstance(rig, dict) for rig in rigs):
        raise BadInput(f'{name}: has no list "ensemble" of tables of keys and values.')
    found = []
    for rig in rigs:
        settings: Settings = {key: value for key, value in rig.items() if "." in key}
        if _is_own(scene, settings):
            continue
        if isinstance(ratio := rig.get("normal_force_ratio"), int | float):
            settings.setdefault("friction.normal_force", ratio * scene.friction.normal_force)
        found.append(settings)
    return found


def _is_own(scene: Scene, rig: Settings) -> bool:
    known = scene.as_dict()
    for key, value in rig.items():
        table, _, name = key.partition(".")
        own = known.get(table, {}).get(name)
        if isinstance(own, str) or not isinstance(value, int | float) or not own:
            if own != value:
                return False
        elif not 1.0 / ALIKE <= value / own <= ALIKE:
            return False
    return True


def checked(scene: Scene, rigs: Sequence[Settings], file: str | os.PathLike[str] | None) -> None:
    """Refuse a scene or a rig that cannot be studied. Raises BadInput."""
    if not scene.rung.on_ladder:
        raise BadInput(
            f'scene {scene.name}: circuit.model = "{scene.circuit.model}" has no limits to change; '
            'it must be "full", "amplifier", "limited", "ideal" or "auto".'
        )
    if scene.drive.waveform != "sawtooth":
        raise BadInput(
            f'scene {scene.name}: drive.waveform = "{scene.drive.waveform}" has no knobs to search.'
        )
    for number, rig in enumerate(rigs, 1):
        Bench.base(scene, rig, f"{plain(str(file))}, ensemble {number}")
