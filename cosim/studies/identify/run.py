"""Identifies one rig for several measured trials, as a user asks for it."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import workers_asked
from cosim.evaluate.store import Store
from cosim.files.picture import Picture
from cosim.scene import keys
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import Space, read_space
from cosim.studies.identify.problem.targets import (
    TRANSPORT,
    WEIGHTS,
    Measured,
    read_trials,
)
from cosim.studies.identify.report.measures import Row, bands, errors, own_numbers, repeatability
from cosim.studies.identify.report.scenes import exact, trial_settings
from cosim.studies.identify.report.solved import HeldOut, Solved
from cosim.studies.identify.report.verdicts import Profile, ensemble_of, judge
from cosim.studies.identify.search.plan import FULL, QUICK, Plan, folds
from cosim.studies.identify.search.search import Found, Progress, Search
from cosim.toolchain.libraries import digest

UNSTEADY = 0.5
"""Repeatability of a velocity (NRMSE of its cycles) beyond which no steady drive explains it."""

FIRSTS = 3
"""Solutions of the ensemble, the best first, that are finished."""

PROFILE_STEPS = (0.04, 0.12, 0.25)
"""Distances from the best value of a key at which it is held, of its bounds' range."""

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
        plan = Plan(
            Search(space, [trial.target for trial in steady], count),
            Search(space, [trial.fine for trial in steady], count),
            effort,
            store.once,
            seed,
            progress or (lambda what, best: None),
        )
        made = _identified(plan, steady, others)
        made = replace(made, numbers=_numbers(made, seed, quick))
        if out is not None:
            made.save(out)
            store.remove()
    return made


def _identified(plan: Plan, steady: list[Measured], others: list[Measured]) -> Identification:
    space, effort, rows = plan.coarse.space, plan.effort, [*range(len(steady))]
    found = plan.ensemble("all trials", rows, effort.rounds)
    ensemble = ensemble_of(found)
    # The step of the search does not order solutions that are as good: the finish does.
    ends = [plan.finished(f"all trials {k}", rows, one) for k, one in enumerate(found[:FIRSTS], 1)]
    first = found[min(range(len(ends)), key=lambda k: ends[k].total)]
    profiles, beside = _profiles(plan, first, ensemble)
    lower = min(beside, key=lambda one: one.total)
    if lower.total < first.total:
        ends.append(plan.finished("all trials, from a profile", rows, lower))
    best = min(ends, key=lambda one: one.total)
    fold_rigs, held_out = _folds(plan, steady) if len(steady) >= 3 else ([], [])
    verdicts = judge(space, best, ensemble, fold_rigs, profiles)
    aside = replace(plan.fine, targets=[trial.fine for trial in others])
    apart_own = plan.drives("trials apart", best.place, aside).own if others else np.empty((0, 0))
    made_up = _made_up(plan)
    return Identification(
        *(space, steady, others, best, apart_own, ensemble, fold_rigs, held_out),
        *(verdicts, profiles, made_up, {}),
    )


def _steady(trial: Measured) -> bool:
    found = repeatability(trial)["floor_late"]
    return found is None or found <= UNSTEADY


def _asked(space: Space, trials: Sequence[Measured], effort: object) -> Any:
    """All that decides what a stage finds, beside the seed; this build of the programs, too."""
    entries = [
        repr(entry) for entry in (*space.rig_entries.values(), *space.trial_entries.values())
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
    return [entries, sums, repr((effort, WEIGHTS, TRANSPORT)), digest("stepper")]


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


def _profiles(
    plan: Plan, best: Found, ensemble: Sequence[Found]
) -> tuple[dict[str, Profile], list[Found]]:
    """The profile of each key about a solution, and the solutions that make it."""
    found: dict[str, Profile] = {}
    solutions: list[Found] = []
    for key, name in enumerate(plan.coarse.space.names):
        points = [(best.place[key], best.total)]
        for side in (-1.0, 1.0):
            start = best
            for distance in PROFILE_STEPS[: plan.effort.profile_points]:
                place = float(best.place[key] + side * distance)
                if 0.0 <= place <= 1.0:
                    start = plan.profile(key, place, start, ensemble)
                    points.append((place, start.total))
                    solutions.append(start)
        places = np.repeat(best.place[None], len(points), axis=0)
        places[:, key] = [place for place, _ in points]
        values = plan.coarse.space.values(places)[:, key]
        found[name] = sorted(zip(values.tolist(), (total for _, total in points), strict=True))
    return found, solutions


def _made_up(plan: Plan) -> Found:
    """The rig of the scene keys' defaults, as far as the bounds reach it."""
    space: Space = plan.fine.space
    defaults: dict[str, Any] = {key.full: key.default for key in keys()}
    values = [np.clip(defaults[entry.key], entry.low, entry.high) for entry in space.free]
    return plan.drives("made-up rig", space.place(np.array(values)), plan.fine)


def _mean(rows: Sequence[Row], name: str, how: Callable[[Any], Any] = np.mean) -> float | None:
    values = [row[name] for row in rows if row.get(name) is not None]
    return float(how(values)) if values else None


def overall(rows: Sequence[Row]) -> Row:
    """Means over trials of what ``errors`` says of each, and the worst velocity."""
    every = dict.fromkeys(name for row in rows for name in row if name not in ("trial", *OWN))
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
            errors(trial, rig, own) | repeatability(trial) | {"cost": cost} | own_numbers(own)
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
    there = space.rigs(found.made_up.place[None])[0]
    made_up = [
        errors(t, there, own) for t, own in zip(found.trials, found.made_up.own, strict=True)
    ]
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
        "ensemble": [
            {"cost": one.total}
            | dict(zip(space.names, space.values(one.place).tolist(), strict=True))
            for one in found.ensemble
        ],
        "folds": [
            {"cost": one.total}
            | dict(zip(space.names, space.values(one.place).tolist(), strict=True))
            for one in found.fold_rigs
        ],
        "profiles": {
            name: [list(point) for point in points] for name, points in found.profiles.items()
        },
    }
