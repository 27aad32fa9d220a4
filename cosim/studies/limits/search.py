"""The search of one machine, for the best settings and for robust ones.

The best settings are found by single runs: a space-filling design, then climbs. Robust ones
maximise the median over all turns of the knobs; their search starts from points whose neighbours
did well in single runs.
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

Points = Sequence[Sequence[float]]
"""Points of a machine's cube, the best first, as lists, which a store can hold."""

Candidates = Mapping[str, Sequence[Points]]
"""What a search found: ``candidates[kind][n]`` are the points of a kind (of KINDS) for GOALS[n]."""

APART, KEPT, BEST = 0.03, 4, 12
"""Least distance (in the cube) of the points that a search returns, and their number for each goal:
of robust ones, and of best ones, many of which fail in longer runs where motion is chaotic."""

CLOSE = 0.015
"""Least distance of the points from which the search for robust settings starts."""


@dataclass(frozen=True)
class Effort:
    """Numbers of points that a search may run."""

    design: int
    """Points of the design, which fills the cube."""
    climb: int
    """Points of the climbs to best settings, for each goal; each point is one run."""
    turned: int
    """Points of the climbs to robust settings, for each goal; each is run with all its turns."""

    def times(self, factor: float) -> "Effort":
        """This effort multiplied by a factor."""
        return replace(self, **{name: ceil(factor * many) for name, many in vars(self).items()})


def searched(
    bench: Bench,
    machine: Machine,
    effort: Effort,
    seed: Sequence[int],
    own: Candidates | None = None,
    warm: Sequence[Candidates] = (),
) -> Candidates:
    """The candidates of a machine. Warm starts are its ``own`` earlier candidates, and those of
    other machines (``warm``), as far as their cubes have the same dimensions. Single runs need not
    show that a robust point of another machine is robust here, too: so the turns of the best of
    these points are run in any case."""
    keys = machine.keys
    # ``once`` keeps scores of single runs, ``over_turns`` the medians over all turns of the knobs.
    once = Known(keys, len(GOALS), STEPS, bench.once(machine))
    over_turns = Known(keys, len(GOALS), STEPS, bench.over_turns(machine))
    for start in [own, *warm] if own else warm:
        for kind in KINDS:
            once.rows(_stacked(start[kind], keys))
    others = [row for start in warm for row in once.rows(_stacked(start["robust"], keys))]
    if effort.design:
        once.search({0: Design(keys, effort.design, [*seed, 0], ends=True)}, effort.design)
    once.search({n: Climb(keys, [*seed, 1, n]) for n in _within_reach(once)}, effort.climb)
    # The robust search begins where single runs are best, where they show good surroundings, and
    # where other machines were robust.
    starts = [_stacked(own["robust"], keys)] if own else []
    for n in range(len(GOALS)):
        starts += [once.ranked(n, APART, KEPT), once.steady(n, CLOSE, 2 * KEPT)]
        starts += [once.ranked(n, CLOSE, 2 * KEPT, others)]
    over_turns.rows(np.vstack(starts))
    climbs = {n: Climb(keys, [*seed, 2, n], step=0.03) for n in _within_reach(over_turns)}
    over_turns.search(climbs, effort.turned)
    return {"best": _by_goal(once, BEST), "robust": _by_goal(over_turns, KEPT)}


def _within_reach(known: Known) -> list[int]:
    """The indices of the goals for which a feasible point with a score is known."""
    return np.flatnonzero(np.isfinite(known.tops())).tolist()


def _stacked(by_goal: Sequence[Points], keys: int) -> Array:
    """The points of all goals (rows) that have ``keys`` coordinates."""
    found = [point for points in by_goal for point in points if len(point) == keys]
    return np.array(found).reshape(-1, keys)


def _by_goal(known: Known, count: int) -> list[Points]:
    """For each goal the ``count`` best points that are APART."""
    return [known.ranked(n, APART, count).tolist() for n in range(len(GOALS))]
