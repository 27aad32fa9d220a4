"""Identifies one rig for several measured trials, as a user asks for it."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import workers_asked
from cosim.evaluate.store import Store
from cosim.files.picture import Picture
from cosim.mechanics.stickslip import rests_of
from cosim.scene import keys
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import SUSPENSION, Space, read_space
from cosim.studies.identify.problem.targets import (
    TRANSPORT,
    WEIGHTS,
    Measured,
    read_trials,
)
from cosim.studies.identify.report.measures import (
    Row,
    bands,
    errors,
    own_numbers,
    repeatability,
    samples,
)
from cosim.studies.identify.report.scenes import exact, trial_settings
from cosim.studies.identify.report.solved import HeldOut, Solved
from cosim.studies.identify.report.verdicts import Rig, at_bounds, forces, judge, rigs_meant
from cosim.studies.identify.search.plan import FULL, QUICK, Plan, Searched, folds, searched
from cosim.studies.identify.search.search import Found, Progress, Search
from cosim.toolchain.libraries import digest

UNSTEADY = 0.5
"""Repeatability of a velocity (NRMSE of its cycles) beyond which no steady drive explains it."""

PLACES = np.linspace(-2e-3, 2e-3, 9)
"""Of the ram in the actuator (q, m), at which the suspension's force is told."""

STORE = "identify.sqlite"


class Identification(Solved):
    """A finished identification."""

    def plot(self) -> Picture:
        """Every trial: surface and part, measured and simulated."""
        from cosim.studies.identify.report import figures

        return figures.overlays(self)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``identify.json``, ``.csv``, ``.md``, the figures ``identify-*.png``, the rig's
        scene ``rig.toml`` and one for each trial."""
        from cosim.studies.identify.report import files

        files.write(Path(folder), self)

    def __repr__(self) -> str:
        from cosim.studies.identify.report import files

        return files.summary(self)


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

    The method: :mod:`cosim.studies.identify.search.plan`. Raises BadInput.
    """
    if seed < 0:
        raise BadInput(f"seed = {seed} must be 0 or more.")
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
        raise BadInput(f"{trials}: no trial is left to be fitted: none repeats itself.")
    effort, count = QUICK if quick else FULL, workers_asked(workers)
    path = None if out is None else Path(out) / STORE
    with Store(path, seed, *_asked(space, steady, effort)) as store:

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
        made = _identified(plans, steady, others)
        made = replace(made, numbers=_numbers(made, seed, quick))
        if out is not None:
            made.save(out)
            store.remove()
    return made


def _identified(
    plans: list[list[Plan]], steady: list[Measured], others: list[Measured]
) -> Identification:
    laws = [searched(several) for several in plans]
    first = min(range(len(laws)), key=lambda k: laws[k].best.total)
    plan, space, best = plans[first][0], laws[first].space, laws[first].best
    meant = rigs_meant(laws, samples(steady, space, best))
    verdicts = judge((space, best), meant, any(one.converged for one in laws))
    fold_rigs, held_out = _folds(plan, steady) if len(steady) >= 3 else ([], [])
    aside = replace(plan.fine, targets=[trial.fine for trial in others])
    apart_own = plan.drives("trials apart", best.place, aside).own if others else np.empty((0, 0))
    return Identification(
        *(space, steady, others, best, apart_own, laws, meant, fold_rigs, held_out),
        *(verdicts, _made_up(plans[0][0]), {}),
    )


def _steady(trial: Measured) -> bool:
    found = repeatability(trial)["floor_late"]
    return found is None or found <= UNSTEADY


def _asked(space: Space, trials: Sequence[Measured], effort: object) -> Any:
    """All that decides what a stage finds, beside the seed; this build of the programs, too."""
    entries = [
        repr(entry) for entry in (*space.all_entries.values(), *space.trial_entries.values())
    ]
    sums = [
        [
            trial.label,
            *(
                float(np.nansum(v * np.arange(1, len(v) + 1)))
                for v in trial.target.signals.values()
            ),
        ]
        for trial in trials
    ]
    return [
        entries,
        space.laws,
        space.measured,
        sums,
        repr((effort, WEIGHTS, TRANSPORT)),
        digest("stepper"),
    ]


def _folds(plan: Plan, trials: Sequence[Measured]) -> tuple[list[Found], list[HeldOut]]:
    rigs, held_out = [], []
    for number, left in enumerate(folds(len(trials)), 1):
        name, rows = f"fold {number}", [k for k in range(len(trials)) if k not in left]
        found = plan.ensemble(name, rows, plan.effort.fold_rounds)[0]
        rig = plan.finished(name, rows, found)
        surface = replace(plan.fine, targets=[trials[k].surface for k in left])
        alone = plan.drives(f"{name}: surface", rig.place, surface)
        transport = replace(plan.fine, targets=[trials[k].transport for k in left])
        both = plan.drives(f"{name}: surface and part", rig.place, transport)
        rigs.append(rig)
        for k, one, two in zip(left, alone.own, both.own, strict=True):
            held_out.append(HeldOut(trials[k], number, rig.place, one, two))
    return rigs, sorted(held_out, key=lambda one: trials.index(one.trial))


def _made_up(plan: Plan) -> Rig:
    """The rig of the scene keys' defaults, as far as the bounds reach it."""
    space = plan.fine.space
    defaults: dict[str, Any] = {key.full: key.default for key in keys()}
    values = [np.clip(defaults[entry.key], entry.low, entry.high) for entry in space.free]
    return space, plan.drives("made-up rig", space.place(np.array(values)), plan.fine)


def _mean(rows: Sequence[Row], name: str, how: Callable[[Any], Any] = np.mean) -> float | None:
    values = [row[name] for row in rows if row.get(name) is not None]
    return float(how(values)) if values else None


def overall(rows: Sequence[Row]) -> Row:
    """Means over trials of what ``errors`` says of each, and the worst velocity."""
    every = dict.fromkeys(
        name for row in rows for name in row if name not in ("trial", "at_bounds", *OWN)
    )
    names = [name for name in every if _mean(rows, name) is not None]
    found: Row = {name: _mean(rows, name) for name in names}
    found["nrmse_v_surface_worst"] = _mean(rows, "nrmse_v_surface", max)
    found["v_average_error_mm_per_s_median"] = _mean(rows, "v_average_error_mm_per_s", np.median)
    return found


def _numbers(found: Identification, seed: int, quick: bool) -> dict[str, Any]:
    space, best = found.space, found.best
    rig = space.rigs(best.place[None])[0]
    rows, checks, spectra = [], [], []
    for trial, own, cost in zip(found.trials, best.own, best.costs.tolist(), strict=True):
        rows.append(
            errors(trial, rig, own)
            | repeatability(trial)
            | {"cost": cost, "at_bounds": ", ".join(_at_bounds(trial, own))}
            | own_numbers(own)
        )
        spectra += bands(trial, rig, own)
        if trial.target.current is None and trial.has_part:
            settings, first = trial_settings(space, best.place, trial, own)
            here = rows[-1]["v_average_mm_per_s"]
            both = space.settings(best.place) | settings
            checks.append(
                {"trial": trial.label, "steps": here} | exact(both, first, trial.fine.time)
            )
    aside = [
        errors(trial, rig, own) | repeatability(trial) | own_numbers(own)
        for trial, own in zip(found.apart, found.apart_own, strict=True)
    ]
    held_out = []
    for one in found.held_out:
        there = space.rigs(one.place[None])[0]
        surface, both = (errors(one.trial, there, own) for own in (one.surface, one.both))
        held_out.append(
            {"trial": one.trial.label, "fold": one.fold}
            | {"surface": surface | own_numbers(one.surface)}
            | {"surface_and_part": both | own_numbers(one.both)}
        )
    made_up, converged = (
        _errors_on(found.trials, found.made_up),
        [one for one in found.laws if one.converged],
    )
    apart = [forces(one, PLACES) for one in found.meant]
    return {
        "seed": seed,
        "quick": quick,
        "cost": best.total,
        "rig": space.settings(best.place),
        "verdicts": [asdict(verdict) for verdict in found.verdicts],
        "overall": overall(rows),
        "trials": rows,
        "apart": aside,
        "held_out": held_out,
        "held_out_overall": {
            kind: overall([one[kind] for one in held_out])
            for kind in ("surface", "surface_and_part")
        }
        if held_out
        else None,
        "made_up_rig": {"overall": overall(made_up), "trials": made_up},
        "exact_rungs_v_average_mm_per_s": checks,
        "bands": spectra,
        "converged": [one.space.law for one in converged],
        "effective_samples": samples(found.trials, space, best),
        "laws": [_law(found.trials, one) for one in found.laws],
        "force": [
            {"q_mm": q * 1e3}
            | {f"{end}_{unit}": float(how([one[n][k] for one in apart]))
               for n, unit in enumerate("NA") for end, how in (("low", min), ("high", max))}
            for k, q in enumerate(PLACES.tolist())
        ],
        "ensemble": [_candidate(one, best) for one in found.meant],
        "folds": [_candidate((space, one), None) for one in found.fold_rigs],
    }  # fmt: skip


def _at_bounds(trial: Measured, own: Array) -> list[str]:
    return at_bounds(trial.fine.low, trial.fine.high, trial.fine.scale, own)


def _errors_on(trials: Sequence[Measured], rig: Rig) -> list[Row]:
    there = rig[0].rigs(rig[1].place[None])[0]
    return [errors(trial, there, own) for trial, own in zip(trials, rig[1].own, strict=True)]


def _law(trials: Sequence[Measured], found: Searched) -> Row:
    """What one law of the suspension comes to."""
    space, best = found.space, found.best
    whole = overall(_errors_on(trials, (space, best)))
    names = ("nrmse_v_surface", "nrmse_v_surface_worst", "v_average_error_mm_per_s")
    return {
        "law": space.law,
        "costs": [one.total for one in found.ends],
        "converged": found.converged,
        "rests_mm": [q * 1e3 for q in rests_of(space.numbers(best.place))],
        **{name: whole.get(name) for name in names},
        "rig": space.settings(best.place),
    }


def _candidate(rig: Rig, best: Found | None) -> Row:
    """A rig by the keys of a scene; how much larger than the best's its normal forces are."""
    space, one = rig
    found: Row = {"cost": one.total, SUSPENSION: space.law}
    if best is not None:
        k = OWN.index("normal_force")
        found["normal_force_ratio"] = float(np.exp(np.log(one.own[:, k] / best.own[:, k]).mean()))
    settings = space.settings(one.place)
    return found | {name: settings[name] for name in space.names}
