"""Which limit binds, from which value on, and what a change brings: from the data, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, nan

from cosim.scene import Scene
from cosim.simulation.guards import LM348_SUPPLY, OPA548_SUPPLY
from cosim.studies.limits.aims import QUANTITIES
from cosim.studies.limits.confirm import KINDS, Point, Points
from cosim.studies.limits.search import Best
from cosim.studies.limits.study import IDEAL, OWN, Name, Study
from cosim.studies.limits.table import Limit, slip_falls
from cosim.studies.tables import brief

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
    before, after = (
        height(points.get((name_of(study.scene, limit, value), quantity, kind)))
        for value in (limit.at_work(study.scene), limit.gone)
    )
    return after / before - 1.0


def _others(study: Study, limit: Limit, quantity: int, kind: int) -> list[float]:
    if not limit.searched:
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
        top = height(points.get((name_of(study.scene, limit, limit.gone), quantity, kind)))
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
    found = []
    for limit in (limit for limit in study.limits if limit.real):
        before = name_of(study.scene, limit, limit.own(study.scene))
        own = height(points.get((before, quantity, kind)))
        for value in limit.values:
            better = (value > limit.own(study.scene)) is limit.more_is_better
            there = height(points.get(((limit.name, value), quantity, kind)))
            if better and isfinite(there / own):
                found.append(Step(limit, value, quantity, there / own - 1.0))
    return sorted(found, key=lambda step: -step.gain)


ASKED = ("a_camera", "a_free", "v_up", "v_down")
"""The quantities that sentences are about, in this order; the others follow them closely."""

NUMBER = {quantity.name: number for number, quantity in enumerate(QUANTITIES)}


def paragraphs(study: Study, points: Points, found: Sequence[Change]) -> list[str]:
    """The answer, a paragraph for each of its parts."""
    return [
        achievable(study, points),
        binding(study, points, found),
        nothing(found),
        first(study, points),
        (
            "Best is the best setting of the three knobs, of the 1024 that the firmware reads of "
            "each, found anew for each circuit (for the gain-bandwidth and slew rate climbed on to "
            "from the own circuit's where the limit costs; their robust one is the own circuit's); "
            "robust the one with the greatest median over turns "
            "of ±2 % of a whole turn, of one knob and of all together. An interval is over the "
            "rigs; a change counts where it exceeds 2 % and what two searches of the same circuit "
            "differ by. A setting that makes more heat than the coil bears does not count."
        ),
    ]


def achievable(study: Study, points: Points) -> str:
    """What the scene's own circuit and an ideal current achieve."""
    said = []
    for name in ASKED:
        quantity = QUANTITIES[NUMBER[name]]
        heights = [
            height(points.get((machine, NUMBER[name], kind))) * quantity.scale
            for machine in (OWN, IDEAL)
            for kind in ("best", "robust")
        ]
        own, robust, ideal, ideal_robust = (brief(x) if isfinite(x) else "none" for x in heights)
        said.append(
            f"{quantity.title}: {own} {quantity.unit} at best, {robust} robust; with an ideal "
            f"current {ideal} and {ideal_robust}"
        )
    falls = slip_falls(study.scene)
    needed = " and ".join(f"a part {way} from {brief(fall)}" for way, fall in falls.items())
    return (
        f"{study.scene.name}, over the range of the knobs. {'; '.join(said)}. "
        f"Where the surface falls, {needed} m/s² on slips ((µ_s ± µ_plate) F_n/m_p + g)."
    )


def binding(study: Study, points: Points, found: Sequence[Change]) -> str:
    """Which limits bind and which help, the largest change first."""
    said = []
    for verdict, words, none in (
        (BINDS, "What binds, with what lifting it brings", "No limit binds for sure"),
        (HELPS, "What is better with a limit than without, with what lifting it costs", ""),
    ):
        listed_ = [
            text for name in largest(found) if (text := _sure(study, points, found, name, verdict))
        ]
        if listed_:
            said.append(f"{words}: {', '.join(listed_)}.")
        elif none:
            said.append(f"{none}: none raises a frontier by more than the search's own difference.")
    return " ".join(said)


def _sure(study: Study, points: Points, found: Sequence[Change], name: str, verdict: str) -> str:
    """A limit with the quantities of a verdict; empty where there are none."""
    parts = []
    for change in found:
        quantity = QUANTITIES[change.quantity]
        if change.limit.name != name or change.verdict != verdict or quantity.name not in ASKED:
            continue
        noise = max(change.noise) if isfinite(max(change.noise)) else 0.0
        since = costs_from(study, points, change.limit, change.quantity, noise)
        where = _since(change.limit, since) if verdict == BINDS else ""
        parts.append(f"{quantity.title} {interval(change)}{where}")
    return f"{name} ({'; '.join(parts)})" if parts else ""


def interval(change: Change) -> str:
    """The range of a change, best and robust, over the rigs, in per cent."""
    low, high = (100.0 * end for end in (min(change.every), max(change.every)))
    return f"{low:+.0f} %" if round(low) == round(high) else f"{low:+.0f} to {high:+.0f} %"


def nothing(found: Sequence[Change]) -> str:
    """Which limits do not matter, and of which nothing can be said."""
    free, open_ = [], []
    for name in dict.fromkeys(change.limit.name for change in found):
        verdicts = {c.verdict for c in found if c.limit.name == name and known(c)}
        if verdicts == {NOTHING}:
            free.append(name)
        elif UNTOLD in verdicts:
            open_.append(f"the {name}")
    said = []
    if free:
        said.append(f"No frontier changes by more than 2 % without the {listed(free)}.")
    if open_:
        said.append(
            f"What lifting {listed(open_)} does to some of the frontiers cannot be told from the "
            f"search's own difference, or the rigs differ in it."
        )
    return " ".join(said)


def known(change: Change) -> bool:
    """Whether there is anything to tell a verdict from."""
    return bool(change.every)


def first(study: Study, points: Points) -> str:
    """What to change first on the real device."""
    said = []
    for name in ("a_camera", "v_up"):
        for kind in ("robust", "best"):
            found = steps(study, points, NUMBER[name], kind)
            if not found:
                continue
            top = found[0]
            limit, scale = top.limit, top.limit.scale
            words = (
                f"{limit.name} {brief(limit.own(study.scene) * scale)} → "
                f"{brief(top.value * scale)} {limit.unit}{rated(limit, top.value)} "
                f"changes the {kind} {QUANTITIES[NUMBER[name]].title} by {top.gain:+.0%}"
            )
            said.append(words)
            break
    return f"What to change first: {'; '.join(said)}." if said else ""


def rated(limit: Limit, value: float) -> str:
    """What a value of a limit demands of the parts."""
    if limit.name != "supply voltage" or value <= LM348_SUPPLY:
        return ""
    if value > OPA548_SUPPLY[1]:
        return " (more than the OPA548 bears)"
    return " (the LM348 then needs a supply of its own)"


def refuted(points: Points) -> list[Point]:
    """Points that the more complete circuit does not confirm."""
    return [point for point in points.values() if not point.holds]


def sought(points: Points) -> list[Point]:
    """Points that were found on the circuit that had refuted others."""
    return [p for p in points.values() if p.refuted and p.settings["circuit.model"] == p.rung]


def _since(limit: Limit, value: float | None) -> str:
    if value is None:
        return ""
    side = "at most" if limit.more_is_better else "at least"
    return f", where it is {side} {brief(value * limit.scale)} {limit.unit}"


def listed(names: Sequence[str]) -> str:
    """Names with commas and an "and"."""
    *rest, last = names
    return f"{', '.join(rest)} and {last}" if rest else last
