"""What each limit costs at given settings: scenes with knobs of their own, such as the trials."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from cosim.evaluate.point import Outcome
from cosim.scene import Scene, changed
from cosim.scene.tables import KNOBS
from cosim.studies.limits.runs import Bench
from cosim.studies.limits.table import Limit, Settings

OWN = "own"
"""The key of a scene as it is."""

WITHOUT = ("knobs' range", "coil heat")
"""Limits that only bound the choice of a setting."""


@dataclass
class There:
    """One scene, SI: what it does, and what it would do with each limit lifted."""

    scene: Scene
    own: Outcome
    heat: float
    """W, of a coil."""
    against: dict[str, Outcome] = field(default_factory=dict[str, Outcome])
    """The same on the circuit in which the limit was lifted."""
    lifted: dict[str, Outcome] = field(default_factory=dict[str, Outcome])


def at(
    bench: Bench,
    scenes: Sequence[Scene],
    limits: Sequence[Limit],
    told: Callable[[str], object],
) -> list[There]:
    """Lift each limit at each scene's own setting, on the amplifier where it has the limit."""
    runs: dict[tuple[int, str, bool], Settings] = {}
    for number, scene in enumerate(scenes):
        own = _apart(scene, bench.scene)
        runs[number, OWN, False] = own | {"circuit.model": "amplifier"}
        for limit in acting(limits):
            rung = _rung(limit)
            here = limit.machine(scene, limit.at_work(scene)).settings
            runs[number, limit.name, False] = own | here | {"circuit.model": rung}
            machine = limit.machine(scene, limit.gone)
            volts = {
                f"drive.{key}": machine.reach * getattr(scene.drive, key)
                for key in ("amplitude", "offset")
            }
            runs[number, limit.name, True] = (
                own | volts | machine.settings | {"circuit.model": rung}
            )
    outcomes = dict(zip(runs, bench.outcomes(list(runs.values())), strict=True))
    found = []
    for number, scene in enumerate(scenes):
        own = outcomes[number, OWN, False]
        heat = own.numbers.get("coil_heat", float("nan"))
        there = There(scene, own, heat)
        for limit in acting(limits):
            there.against[limit.name] = outcomes[number, limit.name, False]
            there.lifted[limit.name] = outcomes[number, limit.name, True]
        found.append(there)
        told(scene.name)
    return found


def acting(limits: Iterable[Limit]) -> list[Limit]:
    """Those of the limits that act at a given setting."""
    return [limit for limit in limits if limit.name not in WITHOUT]


def _rung(limit: Limit) -> str:
    return "limited" if limit.name == "current limit" else "amplifier"


def _apart(scene: Scene, base: Scene) -> Settings:
    """The keys of a scene that differ from those of the base, knobs as volts and hertz."""
    knobs = {f"drive.{knob}": None for knob in KNOBS}
    knobs |= {f"drive.{key}": getattr(scene.drive, key) for key in KNOBS.values()}
    there = changed(scene, knobs, f"scene {scene.name}").as_dict()
    known = base.as_dict()
    found: Settings = {}
    for table, keys in there.items():
        if isinstance(keys, dict):
            for key, value in keys.items():
                if value is not None and value != known[table].get(key):
                    found[f"{table}.{key}"] = value
    return found
