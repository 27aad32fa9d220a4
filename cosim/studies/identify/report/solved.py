"""What an identification has found, in numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.mechanics.stickslip import rests_of
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import SUSPENSION
from cosim.studies.identify.problem.targets import Measured
from cosim.studies.identify.report.measures import errors, own_parameters, repeatability
from cosim.studies.identify.report.scenes import exact, trial_settings
from cosim.studies.identify.report.verdicts import Verdict, at_bounds, forces
from cosim.studies.identify.search.plan import Searched
from cosim.studies.identify.search.search import Found
from cosim.studies.report import Row

PLACES = np.linspace(-2e-3, 2e-3, 9)
"""Of the ram in the actuator (q, m), at which the suspension's force is told."""

KINDS = ("surface", "surface_and_part")
"""By what a held-out trial's own parameters are fitted: its surface alone; surface and part."""


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """``numbers`` is what ``identify.json`` holds."""

    trials: list[Measured]
    best: Found
    """The best solution, of the law with which it was found."""
    apart: list[Measured]
    """Trials that were not fitted."""
    apart_own: Array
    meant: list[Found]
    """The rigs that may be meant, the best first."""
    verdicts: list[Verdict]
    numbers: dict[str, Any]

    @property
    def rig(self) -> dict[str, Any]:
        """The identified rig by the keys of a scene, SI."""
        return self.best.settings


def overall(rows: Sequence[Row]) -> Row:
    """Means over trials of what ``errors`` says of each, and the worst velocity."""
    names = dict.fromkeys(name for row in rows for name in row)
    known = {name: [row[name] for row in rows if row.get(name) is not None] for name in names}
    found: Row = {
        name: float(np.mean(values))
        for name, values in known.items()
        if values and name not in ("trial", "at_bounds", *OWN)
    }
    off = known.get("v_average_error_mm_per_s")
    found["nrmse_v_surface_worst"] = max(known.get("nrmse_v_surface", ()), default=None)
    found["v_average_error_mm_per_s_median"] = float(np.median(off)) if off else None
    return found


def errors_on(rig: Found, trials: Sequence[Measured]) -> list[Row]:
    """The errors of the trials of a solution."""
    return [errors(trial, rig.rig, own) for trial, own in zip(trials, rig.own, strict=True)]


def told_of_trials(trials: Sequence[Measured], best: Found) -> tuple[list[Row], list[Row]]:
    """A row for each trial that was fitted; and its mean velocity of the part by the search's steps
    and on the bench's rungs, mm/s."""
    rows, checks = [], []
    every = zip(trials, best.own, best.costs.tolist(), errors_on(best, trials), strict=True)
    for trial, own, cost, row in every:
        ends = at_bounds(trial.fine.low, trial.fine.high, trial.fine.scale, own)
        row |= repeatability(trial) | {"cost": cost, "at_bounds": ", ".join(ends)}
        rows.append(row | own_parameters(own))
        if trial.target.current is None and trial.has_part:
            settings, first = trial_settings(best.settings, trial, own)
            check = exact(best.settings | settings, first, trial.fine.time)
            checks.append({"trial": trial.label, "steps": row["v_average_mm_per_s"]} | check)
    return rows, checks


def told_of_law(trials: Sequence[Measured], found: Searched) -> Row:
    """What one law of the suspension comes to."""
    best = found.best
    whole = overall(errors_on(best, trials))
    names = ("nrmse_v_surface", "nrmse_v_surface_worst", "v_average_error_mm_per_s")
    return {
        "law": best.space.law,
        "costs": [one.total for one in found.ends],
        "converged": found.converged,
        "rests_mm": [q * 1e3 for q in rests_of(best.numbers)],
        **{name: whole.get(name) for name in names},
        "rig": best.settings,
        "trials": [
            {"trial": trial.label} | own_parameters(own)
            for trial, own in zip(trials, best.own, strict=True)
        ],
    }


def told_of_force(meant: Sequence[Found]) -> list[Row]:
    """The suspension's force less that at the centre, on all rigs that may be meant."""
    every = np.array([forces(one, PLACES) for one in meant])
    ends = np.stack([every.min(axis=0), every.max(axis=0)], axis=1).reshape(4, -1).T
    names = ("low_N", "high_N", "low_A", "high_A")
    return [
        {"q_mm": q * 1e3} | dict(zip(names, row, strict=True))
        for q, row in zip(PLACES.tolist(), ends.tolist(), strict=True)
    ]


def told_of_rig(one: Found, best: Found | None = None) -> Row:
    """A rig by the keys of a scene; how much larger than the best's its normal forces are."""
    found: Row = {"cost": one.total, SUSPENSION: one.space.law}
    if best is not None:
        k = OWN.index("normal_force")
        found["normal_force_ratio"] = float(np.exp(np.log(one.own[:, k] / best.own[:, k]).mean()))
    return found | {name: one.settings[name] for name in one.space.names}
