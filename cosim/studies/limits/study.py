"""The study: each change on each rig, with the knobs set anew, and judged."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.store import Store
from cosim.files.reader import read
from cosim.scene import Scene, load, toml
from cosim.scene.messages import shown
from cosim.scene.rungs import RUNGS
from cosim.simulation.summary import budget
from cosim.studies.limits.changes import AS_IT_IS, CHANGES, Change, Settings
from cosim.studies.limits.judge import Key, Point, confirmed, judged, tried
from cosim.studies.limits.runs import Bench, Goal
from cosim.studies.limits.search import KINDS, Candidates, Effort, Points, searched


@dataclass(frozen=True)
class Efforts:
    """The efforts of the searches. Each tuple has one effort for each turn: in the first turn every
    machine is searched by itself, in later ones from the candidates of all machines so far."""

    own: tuple[Effort, ...]
    """On the scene's own rig."""
    others: tuple[Effort, ...]
    """On each other rig, where searches start from what was found on the scene's own."""
    again: int
    """How often the machines of REPEATED are searched again with other seeds on the scene's own
    rig (once at most on each other rig), which shows the search's noise."""

    def times(self, factor: float) -> "Efforts":
        """These efforts multiplied by a factor."""
        own = tuple(one.times(factor) for one in self.own)
        return Efforts(own, tuple(one.times(factor) for one in self.others), self.again)


_NONE = Effort(0, 0, 0)
"""A turn that only evaluates the best candidates of all other machines."""
FULL = Efforts(
    own=(Effort(512, 300, 120), Effort(0, 100, 80), _NONE),
    others=(Effort(512, 80, 0), Effort(0, 40, 120), Effort(0, 0, 80)),
    again=3,
)
_FEW = Effort(32, 20, 10)
QUICK = Efforts(own=(Effort(64, 40, 20), _FEW), others=(_FEW, Effort(0, 10, 10)), again=1)

REPEATED = ("as it is", "falling sawtooth", "sine", "supply ±10 V")
"""Changes whose search is repeated with other seeds."""


@dataclass(frozen=True)
class Rig:
    """The results on one rig."""

    settings: Settings
    points: dict[Key, Point]

    def point(self, change: Change, goal: Goal, kind: str) -> Point | None:
        """The judged point of a change; None where no candidate passed."""
        return self.points.get(Key(change.name, goal.name, kind))


@dataclass(frozen=True)
class Study:
    """The results of the study: on the scene's own rig, the first, and on the others."""

    scene: Scene
    changes: Sequence[Change]
    rigs: list[Rig]
    repeats: Sequence[tuple[int, Mapping[Key, Point]]]
    """Repeated searches: the number of a rig, and the points of REPEATED there."""

    @property
    def of_trials(self) -> bool:
        """Whether the paper's trials are about the scene's rig: coil and mechanics are theirs."""
        paper = load("paper")
        return (self.scene.coil, self.scene.mechanics) == (paper.coil, paper.mechanics)

    @property
    def slips(self) -> list[Mapping[str, tuple[float, float]]]:
        """For each rig the accelerations of the surface (m/s², least and most) beyond which a part
        slips, while it moves up or down."""
        return [budget(Bench.base(self.scene, rig.settings, "a rig")) for rig in self.rigs]


def steps(efforts: Efforts, changes: Sequence[Change], rigs: int) -> int:
    """How many steps :func:`study` reports to ``told``."""
    some = sum(change.searched for change in changes)
    repeated = sum(change.name in REPEATED for change in changes)

    def of(cost: tuple[Effort, ...], again: int) -> int:
        return len(cost) * some + 1 + again * (len(cost) * repeated + 1)

    return of(efforts.own, efforts.again) + rigs * of(efforts.others, min(1, efforts.again))


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

    ``store`` keeps the results, machine by machine; ``open_`` makes the evaluator of a rig.
    ``told`` is called at each step. Equal seeds give equal results.
    """
    found: list[Rig] = []
    repeats: list[tuple[int, dict[Key, Point]]] = []
    first = [change for change in changes if change.searched]
    again = [change for change in changes if change.name in REPEATED]
    own: list[dict[str, Candidates]] = []
    for number, rig in enumerate([{}, *rigs]):
        base = Bench.base(scene, rig, f"rig {number}")
        with open_(base) as evaluator:
            work = _Work(Bench(base, evaluator), store, number, changes, told)
            cost = efforts.others if number else efforts.own
            # Turn 0 is the study, further turns repeat REPEATED with other seeds. On other rigs a
            # turn starts from the candidates of the same turn on the scene's own rig.
            for turn in range(1 + (min(1, efforts.again) if number else efforts.again)):
                known, asked = own[turn] if number else {}, again if turn else first
                both = work.searched(asked, cost, [seed, number, turn], known)
                points = work.points(both, turn, own=not number and not turn)
                if turn:
                    repeats.append((number, points))
                else:
                    found.append(Rig(rig, points))
                if not number:
                    own.append(both)
    return Study(scene, changes, found, repeats)


@dataclass(frozen=True)
class _Work:
    """The searches on one rig; ``store`` keeps the result of each."""

    bench: Bench
    store: Store
    rig: int
    changes: Sequence[Change]
    told: Callable[[str], object]

    def searched(
        self,
        changes: Sequence[Change],
        efforts: tuple[Effort, ...],
        seed: list[int],
        known: Mapping[str, Candidates],
    ) -> dict[str, Candidates]:
        """The candidates of each change by name, starting from ``known`` ones. In the first turn
        each change is searched by itself; in later turns also from the best of all others: so what
        helps one change is tried on all, and easing a limit never lowers what is found."""
        found = dict(known)
        for turn, effort in enumerate(efforts):
            before, found = found, dict[str, Candidates]()
            for number, change in enumerate(changes):
                warm = [self._warm(change, other, before) for other in changes if turn]
                machine, own = change.machine(self.bench.scene), before.get(change.name)
                seeds = [*seed, turn, number]
                search = partial(searched, self.bench, machine, effort, seeds, own, warm)
                found[change.name] = self.store.once(f"{change.name} {seeds}", search)
                words = ", with what helps others" if turn else ""
                self.told(f"rig {self.rig}{words}: {change.name}")
        return found

    def _warm(self, change: Change, other: Change, found: Mapping[str, Candidates]) -> Candidates:
        """The best candidate for each goal of another change, as a start for ``change``. Where only
        the latter's command consists of levels, they are sampled from the other's waveform."""
        machine, donor = (each.machine(self.bench.scene) for each in (change, other))
        levels: list[float] = []
        if machine.levels and not donor.levels:
            levels = donor.sampled(self.bench.scene, machine.levels).tolist()

        def best(points: Points) -> Points:
            return [[*point, *levels] for point in points[:1]]

        return {kind: [*map(best, by_goal)] for kind, by_goal in found[other.name].items()}

    def points(self, candidates: dict[str, Candidates], turn: int, own: bool) -> dict[Key, Point]:
        """The judged points of the ``candidates`` of a turn. With ``own`` (turn 0 on the scene's
        rig) ngspice confirms them, and the changes that are not searched are tried."""
        found = self.store.once(f"judged {self.rig} {turn}", partial(self._judge, candidates, own))
        self.told(f"rig {self.rig}: judged")
        return {Key(*names): Point(**of) for names, of in found}

    def _judge(
        self, candidates: dict[str, Candidates], own: bool
    ) -> list[tuple[Key, dict[str, Any]]]:
        machines = {change.name: change.machine(self.bench.scene) for change in self.changes}
        found = judged(self.bench, machines, candidates, KINDS if own else KINDS[1:])
        if own:
            others = [change.name for change in self.changes if not change.searched]
            found = confirmed(self.bench, machines, found)
            own_points = {key: one for key, one in found.items() if key.change == AS_IT_IS.name}
            found |= tried(self.bench, machines, others, own_points)
        return [(key, vars(point)) for key, point in found.items()]


ALIKE = 1.25
"""Ratio of values up to which a rig counts as the scene's own, if all its keys keep to it: a search
ends with a finite step, and files round."""

MOST_BYTES = 1 << 24
"""Largest size of a file of rigs."""

MOST_RATIO = 1e6
"""Largest ratio of a rig's normal force to the scene's."""

_OF_A_RIG = re.compile(r"(coil|mechanics|friction|circuit)\.(?!model$|param\.).*")
_TABLES = "these are in the tables coil, mechanics, friction and circuit, but for circuit.model"
"""Which keys a rig may have: drive and run are set by the study itself."""


def ensemble(path: Path, scene: Scene) -> list[Settings]:
    """The rigs in a file's list ``ensemble``, without those that are the scene's own: tables of
    keys ("table.key") and values, SI. Of entries without a dot only ``normal_force_ratio`` is used:
    the ratio of the rig's normal force to the scene's. Raises BadInput.
    """
    name = plain(path)
    content = read(path, MOST_BYTES)
    try:
        text = content.decode("utf-8-sig")
        said = toml.parse(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{name}: is neither JSON nor, named .toml, TOML ({error}).") from error
    rigs = said.get("ensemble") if isinstance(said, dict) else None
    if not isinstance(rigs, list) or not rigs or not all(isinstance(rig, dict) for rig in rigs):
        raise BadInput(f'{name}: has no list "ensemble" of tables of keys and values.')
    found = []
    for number, rig in enumerate(rigs, 1):
        where = f"{name}, ensemble {number}"
        settings: Settings = {key: value for key, value in rig.items() if "." in key}
        if (rig and not settings) or any(isinstance(value, dict) for value in rig.values()):
            raise BadInput(f'{where}: must have keys "table.key", in quotes, and their values.')
        if other := [key for key in settings if not _OF_A_RIG.fullmatch(key)]:
            raise BadInput(f"{where}: {plain(other[0])} is no key of a rig: {_TABLES}.")
        Bench.base(scene, settings, where)
        if _is_own(scene, settings):
            continue
        if (ratio := rig.get("normal_force_ratio")) is not None:
            if type(ratio) not in (int, float) or not 0.0 < ratio <= MOST_RATIO:
                words = f"must be a number above 0, and at most {MOST_RATIO:g}"
                raise BadInput(f"{where}: normal_force_ratio = {shown(ratio)} {words}.")
            settings.setdefault("friction.normal_force", ratio * scene.friction.normal_force)
            Bench.base(scene, settings, where)
        found.append(settings)
    return found


def _is_own(scene: Scene, rig: Settings) -> bool:
    """Whether all values of a rig are those of the scene: words equal, numbers within ALIKE."""
    for key, value in rig.items():
        own = scene.value(key)
        if isinstance(own, str) or not isinstance(value, int | float) or not own:
            if own != value:
                return False
        elif not 1.0 / ALIKE <= value / own <= ALIKE:
            return False
    return True


def checked(scene: Scene) -> None:
    """Refuse a scene that cannot be studied. Raises BadInput."""
    if not scene.rung.on_ladder:
        raise scene.bad(
            f'circuit.model = "{scene.circuit.model}" has no limits to change; '
            f"it must be one of {', '.join(name for name in RUNGS if RUNGS[name].on_ladder)}."
        )
    if scene.drive.waveform != "sawtooth":
        words = f'drive.waveform = "{scene.drive.waveform}" has no knobs to search.'
        raise scene.bad(words)
