"""Which limit binds, from which value on, and what a real change brings, from the data."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, nan

from cosim.scene import Scene
from cosim.studies.limits.find.confirm import KINDS, Point, Points
from cosim.studies.limits.find.quantities import QUANTITIES
from cosim.studies.limits.find.search import Best
from cosim.studies.limits.find.study import OWN, Name, Study
from cosim.studies.limits.find.table import Limit

LEAST = 0.02
"""Relative change that matters."""

BINDS, HELPS, NOTHING, UNTOLD = "binds", "helps", "does not matter", "cannot be told"


@dataclass(frozen=True)
class Change:
    """What lifting a limit does to what is achievable, relative, of best and robust settings.

    The first of ``best`` and ``robust`` is the scene's own rig, the others are those of the
    ensemble; ``noise`` of each is the difference between two searches of the same.
    """

    limit: Limit
    quantity: int
    best: tuple[float, ...]
    robust: tuple[float, ...]
    noise: tuple[float, float]

    @property
    def every(self) -> list[float]:
        """All changes that are known."""
        return [change for change in (*self.best, *self.robust) if isfinite(change)]

    @property
    def verdict(self) -> str:
        """What can be said of the limit."""
        if not self.every:
            return UNTOLD
        if max(map(abs, self.every)) <= LEAST:
            return NOTHING
        sure = [
            (min(known), max(known), max(LEAST, noise))
            for changes, noise in zip((self.best, self.robust), self.noise, strict=True)
            if (known := [change for change in changes if isfinite(change)])
        ]
        if any(low > noise for low, _, noise in sure) and all(low > -n for low, _, n in sure):
            return BINDS
        if any(high < -noise for _, high, noise in sure) and all(high < n for _, high, n in sure):
            return HELPS
        return UNTOLD


@dataclass(frozen=True)
class Step:
    """A change that can be made to the real device, and what it does to a quantity, relative."""

    limit: Limit
    value: float
    quantity: int
    gain: float


def height(point: Point | None) -> float:
    """A frontier's height, SI: the median over the turns of a robust point, else the value."""
    if point is None:
        return nan
    setting = point.setting
    return setting.median if point.kind == "robust" and isfinite(setting.median) else setting.value


def name_of(scene: Scene, limit: Limit, value: float) -> Name:
    """The machine with a limit at a value; the scene's own where it has that value anyway."""
    own = value == limit.own(scene) and limit.rung == "limited"
    return OWN if own else (limit.name, value)


def changes(study: Study, points: Points) -> list[Change]:
    """What lifting each limit does to each quantity."""
    found = []
    for limit in study.limits:
        for quantity in range(len(QUANTITIES)):
            best, robust = (
                [
                    _nominal(study, points, limit, quantity, kind),
                    *_others(study, limit, quantity, k),
                ]
                for k, kind in enumerate(KINDS)
            )
            noise = _noise(study, quantity)
            found.append(Change(limit, quantity, tuple(best), tuple(robust), noise))
    return found


def _nominal(study: Study, points: Points, limit: Limit, quantity: int, kind: str) -> float:
    own = name_of(study.scene, limit, limit.own(study.scene))
    before, after = (
        height(points.get((name, quantity, kind))) for name in (own, (limit.name, limit.gone))
    )
    return after / before - 1.0


def _others(study: Study, limit: Limit, quantity: int, kind: int) -> list[float]:
    if limit.rung != "limited":
        return []
    return [
        _height(rig.found[limit.name, limit.gone][quantity], kind)
        / _height(rig.found[OWN][quantity], kind)
        - 1.0
        for rig in study.rigs[1:]
    ]


def _noise(study: Study, quantity: int) -> tuple[float, float]:
    own, again = study.rigs[0].found[OWN][quantity], study.again[quantity]
    best, robust = (
        abs(_height(again, kind) / _height(own, kind) - 1.0) for kind in range(len(KINDS))
    )
    return best, robust


def _height(best: Best, kind: int) -> float:
    if kind:
        return best.robust[0].median if best.robust else nan
    return best.settings[0].value if best.settings else nan


def largest(found: Sequence[Change]) -> dict[str, float]:
    """Each limit's largest sure change, for the order of a ranking: those that bind first."""
    order: dict[str, float] = {}
    for change in found:
        sure = change.verdict in (BINDS, HELPS)
        typical = [abs(change.best[0]), abs(change.robust[0])]
        size = min((x for x in typical if isfinite(x)), default=0.0) if sure else 0.0
        order[change.limit.name] = max(order.get(change.limit.name, 0.0), size)
    return dict(sorted(order.items(), key=lambda item: -item[1]))


def costs_from(
    study: Study, points: Points, limit: Limit, quantity: int, noise: float
) -> float | None:
    """The mildest value at which a limit costs, against lifting it, more than ``noise`` of the
    robust frontier (of the best where there is no robust one); None where none does.
    """
    for kind in reversed(KINDS):
        top = height(points.get(((limit.name, limit.gone), quantity, kind)))
        if not isfinite(top):
            continue
        own = limit.own(study.scene)
        tighter = sorted({*limit.values, own}, reverse=limit.more_is_better)
        for value in tighter:
            there = height(points.get((name_of(study.scene, limit, value), quantity, kind)))
            if isfinite(there) and there < top * (1.0 - max(LEAST, noise)):
                return value
        return None
    return None


def steps(study: Study, points: Points, quantity: int, kind: str) -> list[Step]:
    """Real changes for the better of a quantity, the largest gain first."""
    own = height(points.get((OWN, quantity, kind)))
    found = []
    for limit in (limit for limit in study.limits if limit.real):
        for value in limit.values:
            better = (value > limit.own(study.scene)) is limit.more_is_better
            there = height(points.get(((limit.name, value), quantity, kind)))
            if better and isfinite(there / own):
                found.append(Step(limit, value, quantity, there / own - 1.0))
    return sorted(found, key=lambda step: -step.gain)
