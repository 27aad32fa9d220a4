"""Identifies one rig from several measured trials: the function that users call."""

import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import workers_asked
from cosim.evaluate.store import Store, reported
from cosim.files.picture import Picture
from cosim.studies.identify.problem.space import Space, read_space
from cosim.studies.identify.problem.targets import WEIGHTS, Measured, own_parameters, read_trials
from cosim.studies.identify.report import figures, files, solved
from cosim.studies.identify.report.verdicts import judge, rigs_meant
from cosim.studies.identify.search.plan import FULL, QUICK, Plan, folds, searched
from cosim.studies.identify.search.search import Found, Progress, Search, best_of, deviations
from cosim.studies.report import Row
from cosim.studies.study import check_seed
from cosim.typed import typed

UNSTEADY = 0.5
"""Scatter of a velocity's cycles (NRMSE) above which no periodic drive can explain the trial."""


class Identification(solved.Solved):
    """A finished identification."""

    def plot(self) -> Picture:
        """Every trial: surface and part, measured and simulated."""
        return figures.overlays(self)

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``identify.json``, ``.csv``, ``.md``, the figures ``identify-*.png``, the rig's
        scene ``rig.toml`` and one for each trial."""
        files.write(Path(folder), self)

    def __repr__(self) -> str:
        return files.summary(self)


@typed
def identify(
    trials: str | os.PathLike[str],
    *,
    bounds: str | os.PathLike[str] | None = None,
    apart: Sequence[str] = (),
    quick: bool = False,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify the rig that moved in the trials (CSVs) of a folder, and each trial's drive.

    ``bounds`` is a TOML file in the form of the shipped ``bounds.toml``, for one's own rig; trials
    named in ``apart``, and those that do not repeat themselves, are not fitted but only reported.
    ``quick`` searches little. In the folder ``out`` it leaves what ``Identification.save`` writes,
    and takes up what an interrupted identification has left there. The same ``seed`` gives the same
    result, on any number of ``workers`` (threads; one for each processor by default). ``progress``
    is told what is done and the best cost so far.

    ``numbers`` of what comes back is what ``identify.json`` holds: ``rig``, keys and values, SI,
    ``verdicts`` on how well each key is known, ``trials`` with errors and their own drives,
    ``ensemble``, the rigs that may be meant, and a check by ``held_out`` trials.
    The method: :mod:`cosim.studies.identify.search.plan`. Raises BadInput.
    """
    check_seed(seed)
    space = read_space(Path(bounds) if bounds is not None else None)
    everything = read_trials(Path(trials), space)
    labels = [trial.label for trial in everything]
    for label in apart:
        if label not in labels:
            raise BadInput(
                f"There is no trial {plain(label)} to set apart; there are {', '.join(labels)}."
            )
    steady = [trial for trial in everything if trial.label not in apart and _steady(trial)]
    others = [trial for trial in everything if trial not in steady]
    if not steady:
        raise BadInput(f"{plain(trials)}: no trial that repeats itself is left to be fitted.")
    effort, count = QUICK if quick else FULL, workers_asked(workers)

    def made(store: Store) -> Identification:
        def plan(law: str, number: int) -> Plan:
            own = space.of_law(law)
            return Plan(
                Search(own, [trial.target for trial in steady], count),
                Search(own, [trial.fine for trial in steady], count),
                effort,
                store.once,
                seed,
                progress or (lambda what, best: None),
                f"{law} {number}",
            )

        laws = space.laws[: effort.laws]
        plans = [[plan(law, k) for k in range(1, effort.searches + 1)] for law in laws]
        found = _identified(plans, steady, others)
        return replace(found, numbers={"seed": seed, "quick": quick} | found.numbers)

    return reported(made, out, "identify.sqlite", seed, *_asked(space, steady, effort))


def _identified(
    plans: list[list[Plan]], trials: list[Measured], apart: list[Measured]
) -> Identification:
    """The best rig of all laws, with its errors, and the other rigs that may be meant."""
    laws = [searched(several) for several in plans]
    best = best_of([law.best for law in laws])
    # Stages on the best rig run in the first plan of its law.
    plan = plans[[law.best for law in laws].index(best)][0]
    effective = solved.samples(trials, best)
    meant = rigs_meant(laws, effective)
    converged = [law.best.space.law for law in laws if law.converged]
    errors = [deviations(plan.fine, rig, effective) for rig in meant] if converged else None
    verdicts = judge(best, meant, errors)
    # Three-fold cross-validation needs a trial in each fold.
    fold_rigs, held_out = _folds(plan, trials) if len(trials) >= 3 else ([], [])
    apart_own, rows_apart = _apart(plan, best, apart)
    rows, checks = solved.told_of_trials(trials, best)
    means = {kind: solved.overall([row[kind] for row in held_out]) for kind in solved.KINDS}
    numbers = {
        "cost": best.total,
        "rig": best.settings,
        "verdicts": [asdict(verdict) for verdict in verdicts],
        "overall": solved.overall(rows),
        "trials": rows,
        "apart": rows_apart,
        "held_out": held_out,
        "held_out_overall": means if held_out else None,
        "exact_rungs_v_average_mm_per_s": checks,
        "bands": [
            row
            for trial, one in zip(trials, best.own, strict=True)
            for row in solved.bands(trial, best.rig, one)
        ],
        "converged": converged,
        "effective_samples": effective,
        "laws": [solved.told_of_law(trials, law) for law in laws],
        "force": solved.told_of_force(meant),
        "ensemble": [solved.told_of_rig(rig, best) for rig in meant],
        "folds": [solved.told_of_rig(rig) for rig in fold_rigs],
    }
    return Identification(trials, best, apart, apart_own, meant, verdicts, numbers)


def _steady(trial: Measured) -> bool:
    found = solved.repeatability(trial)["floor_late"]
    return found is None or found <= UNSTEADY


def _asked(space: Space, trials: Sequence[Measured], effort: object) -> list[Any]:
    """All inputs, beside seed and program, on which stages depend; the store checks them."""
    entries = [repr(entry) for entry in (*space.entries.values(), *space.trial.values())]
    signals = [
        [one.label, *(crc32(x.tobytes()) for x in one.target.signals.values())] for one in trials
    ]
    return [entries, space.laws, space.measured, signals, repr((effort, WEIGHTS))]


def _apart(plan: Plan, best: Found, apart: list[Measured]) -> tuple[Array, list[Row]]:
    """The trials apart on the best rig: their own parameters, fitted (trials × parameters), and
    their errors."""
    if not apart:
        return np.empty((0, 0)), []
    unseen = replace(plan.fine, targets=[trial.fine for trial in apart])
    owns = plan.drives("trials apart", best.point, unseen).own
    return owns, [
        solved.errors(trial, best.rig, own) | solved.repeatability(trial) | own_parameters(own)
        for trial, own in zip(apart, owns, strict=True)
    ]


def _folds(plan: Plan, trials: Sequence[Measured]) -> tuple[list[Found], list[Row]]:
    """Cross-validation: the rig of each fold, found without the fold's trials, and each trial's
    errors on the rig of its fold, its own parameters fitted to each of ``solved.KINDS``."""
    rigs, held_out = [], {}
    for number, left in enumerate(folds(len(trials)), 1):
        name, rows = f"fold {number}", [k for k in range(len(trials)) if k not in left]
        found = plan.ensemble(name, rows, plan.effort.fold_rounds)[0]
        rigs.append(rig := plan.finished(name, rows, found))
        surface = replace(plan.fine, targets=[trials[k].surface for k in left])
        alone = plan.drives(f"{name}: surface", rig.point, surface)
        both = plan.drives(f"{name}: surface and part", rig.point, plan.fine.part(left))
        for k, *owns in zip(left, alone.own, both.own, strict=True):
            held_out[k] = {"trial": trials[k].label, "fold": number} | {
                kind: solved.errors(trials[k], rig.rig, own) | own_parameters(own)
                for kind, own in zip(solved.KINDS, owns, strict=True)
            }
    return rigs, [held_out[k] for k in sorted(held_out)]
