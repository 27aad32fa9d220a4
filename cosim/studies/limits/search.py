"""The search of one machine: settings that are the best, and those that stay good when knobs turn.

The best is sought by single runs: a design, then climbs. What stays good is sought by the medians
over all turns of the knobs, beginning where single runs show good surroundings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from cosim.arrays import Array
from cosim.search.known import Known
from cosim.search.searches import Climb, Design
from cosim.studies.limits.changes import STEPS, Machine
from cosim.studies.limits.runs import GOALS, Bench

KINDS = ("best", "robust")

Candidates = Mapping[str, Sequence[Sequence[Sequence[float]]]]
"""For each of KINDS and of GOALS the points that did best, the first one first."""

APART, KEPT, BEST = 0.03, 4, 12
"""How far apart the points are that a search tells, and how many for each goal: of the robust ones,
and of the best, of which many are nothing by longer runs where motion is chaotic."""

CLOSE = 0.015
"""The same of those whose turns are run since single runs show good surroundings."""


@dataclass(frozen=True)
class Effort:
    """Points that a search may ask for."""

    design: int
    """That fill the cube."""
    climb: int
    """Of climbs to the best, for each goal, each one run."""
    turned: int
    """Of climbs to what is robust, for each goal, each with all its turns."""

    def times(self, factor: float) -> "Effort":
        """So many times as much."""
        return replace(self, **{name: ceil(factor * many) for name, many in vars(self).items()})


def searched(
    bench: Bench,
    machine: Machine,
    effort: Effort,
    seed: Sequence[int],
    own: Candidates | None = None,
    warm: Sequence[Candidates] = (),
) -> Candidates:
    """The candidates of a machine, from its ``own``, as far as they are known, and from ``warm``
    starts, those of others whose cubes have the same dimensions. What is robust there need not show
    it here by single runs: the turns of the best of it are run in any case."""
    keys = machine.keys
    # ``once`` keeps scores of single runs, ``over_turns`` the medians over all turns of the knobs.
    once = Known(keys, len(GOALS), STEPS, bench.once(machine))
    over_turns = Known(keys, len(GOALS), STEPS, bench.over_turns(machine))
    for one in [own, *warm] if own else warm:
        for kind in KINDS:
            once.rows(_points(one[kind], keys))
    others = [row for one in warm for row in once.rows(_points(one["robust"], keys))]
    if effort.design:
        once.search({0: Design(keys, effort.design, [*seed, 0], ends=True)}, effort.design)
    once.search({n: Climb(keys, [*seed, 1, n]) for n in _within_reach(once)}, effort.climb)
    # The robust search begins where single runs are best, where they show good surroundings, and
    # where other machines were robust.
    starts = [_points(own["robust"], keys)] if own else []
    for n in range(len(GOALS)):
        starts += [once.ranked(n, APART, KEPT), once.steady(n, CLOSE, 2 * KEPT)]
        starts += [once.ranked(n, CLOSE, 2 * KEPT, others)]
    over_turns.rows(np.vstack(starts))
    climbs = {n: Climb(keys, [*seed, 2, n], step=0.03) for n in _within_reach(over_turns)}
    over_turns.search(climbs, effort.turned)
    return {"best": _told(once, BEST), "robust": _told(over_turns, KEPT)}


def _within_reach(known: Known) -> list[int]:
    """The goals for which there is a point to climb from."""
    return np.flatnonzero(np.isfinite(known.tops())).tolist()


def _points(every: Sequence[Sequence[Sequence[float]]], keys: int) -> Array:
    """Those (rows) that have so many keys."""
    found = [point for some in every for point in some if len(point) == keys]
    return np.array(found).reshape(-1, keys)


def _told(known: Known, count: int) -> list[list[list[float]]]:
    found: list[Array] = [known.ranked(n, APART, count) for n in range(len(GOALS))]
    return [points.tolist() for points in found]
