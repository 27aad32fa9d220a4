"""The ranking in sentences."""

from collections.abc import Sequence
from math import isfinite

from cosim.simulation.guards import LM348_SUPPLY, OPA548_SUPPLY
from cosim.studies.limits.find.confirm import Point, Points
from cosim.studies.limits.find.quantities import QUANTITIES
from cosim.studies.limits.find.study import IDEAL, OWN, Study
from cosim.studies.limits.find.table import Limit, needed_acceleration
from cosim.studies.limits.report.ranking import (
    BINDS,
    HELPS,
    NOTHING,
    UNTOLD,
    Change,
    costs_from,
    height,
    largest,
    steps,
)
from cosim.studies.tables import brief

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
            "Best is the best setting of the three knobs, found anew for each circuit; robust the "
            "one with the greatest median over turns of ±2 % of a whole turn, of one knob and of "
            "all together. An interval is over the rigs; a change counts where it exceeds 2 % and "
            "what two searches of the same circuit differ by. A setting that makes more heat than "
            "the coil bears does not count."
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
    needed = needed_acceleration(study.scene)
    return (
        f"{study.scene.name}, over the range of the knobs. {'; '.join(said)}. "
        f"The part slips down from {brief(needed)} m/s² on (µ_s F_n/m_p + g)."
    )


def binding(study: Study, points: Points, found: Sequence[Change]) -> str:
    """Which limits bind, the largest change first."""
    said = []
    for name in largest(found):
        parts = []
        limit = next(change.limit for change in found if change.limit.name == name)
        for change in found:
            quantity = QUANTITIES[change.quantity]
            sure = change.verdict in (BINDS, HELPS)
            if change.limit is not limit or not sure or quantity.name not in ASKED:
                continue
            noise = max(change.noise) if isfinite(max(change.noise)) else 0.0
            since = costs_from(study, points, limit, change.quantity, noise)
            parts.append(f"{quantity.title} {interval(change)}{_since(limit, since)}")
        if parts:
            said.append(f"{name} ({'; '.join(parts)})")
    if not said:
        return "No limit binds: none changes a frontier by more than the interval of its change."
    return f"What binds, with what lifting it changes: {', '.join(said)}."


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
            some = [c for c in found if c.limit.name == name and c.verdict == UNTOLD and known(c)]
            titles = ", ".join(QUANTITIES[c.quantity].name for c in some)
            open_.append(f"the {name} ({titles})")
    said = []
    if free:
        said.append(f"No frontier changes by more than 2 % without the {listed(free)}.")
    if open_:
        said.append(
            f"Whether these bind cannot be told from the search's own difference, or the rigs "
            f"differ in it: {listed(open_)}."
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


def _since(limit: Limit, value: float | None) -> str:
    if value is None:
        return ""
    side = "at most" if limit.more_is_better else "at least"
    return f", where it is {side} {brief(value * limit.scale)} {limit.unit}"


def listed(names: Sequence[str]) -> str:
    """Names with commas and an "and"."""
    *rest, last = names
    return f"{', '.join(rest)} and {last}" if rest else last
