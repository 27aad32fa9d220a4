"""Whether the ranges of an identification hold the truth as often as they say, on made rigs.

Each is the identified one with every key moved. The FMU makes its trials with what the search does
not know: rigid walls, or a normal force that changes with the period as the moving plate's does;
and what the identified rig leaves of the real trials is added to their heights. The priors are the
made rig's own, as far off it as they say: what a wrong prior does to a range is not tried.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.arrays import Array
from cosim.simulation.simulate import simulate
from cosim.stepper.stepper import OWN, RIG
from cosim.studies.identify.problem.space import Space, read_space
from cosim.studies.identify.problem.targets import Measured, read_trials
from cosim.studies.identify.report.scenes import scene, trial_settings
from cosim.studies.identify.report.solved import samples, shown
from cosim.studies.identify.report.verdicts import Verdict, judge, rigs_meant
from cosim.studies.identify.search.plan import Effort, Plan, searched
from cosim.studies.identify.search.search import Search, deviations
from cosim.trials.camera import hermite
from tests.studies.test_identify import write

FOUND = json.loads((Path(__file__).parents[2] / "results" / "identify.json").read_text())
LAW = "knee"
KINDS = ("rigid walls", "changing force")
COUNTS = (3, 6, 9)
RIGS = 2
"""Of each kind with each count of trials."""
EFFORT = Effort(3, 50, ((12, 80, 0.07), (5, 160, 0.06), (2, 330, 0.04)), (), 1, 2)
"""Less than the program's, for one law."""
MOVED = 0.1
"""Standard deviation of the moves, of the bounds' ranges."""


def _own(row: dict[str, float]) -> Array:
    return np.array([row[name] for name in OWN])


def _truth(space: Space, rng: np.random.Generator) -> tuple[dict[str, Any], Array, Array]:
    """Identified rig, as the row of its law has it, its point, and that of a made one."""
    (law,) = [one for one in FOUND["laws"] if one["law"] == LAW]
    point = space.point(np.array([law["rig"][key] for key in space.names]))
    return law, point, np.clip(point + MOVED * rng.standard_normal(len(point)), 0.05, 0.95)


def _known(space: Space, truth: Array, rng: np.random.Generator) -> Space:
    """The space with priors of the made rig: what is known of it beforehand is off by as much as
    the priors say, as what was known of the real one is."""
    true = dict(zip(space.names, space.values(truth).tolist(), strict=True))
    entries = dict(space.entries)
    for key, entry in entries.items():
        if entry.prior is not None and entry.sigma is not None:
            assert entry.log
            off = np.exp(entry.sigma * rng.standard_normal())
            entries[key] = replace(entry, prior=true[key] * off)
    return replace(space, entries=entries)


def _made(real: Measured, own: Array, rigs: tuple[Array, Any], kind: str, folder: Path) -> None:
    """A trial on a made rig, with the drive and what is left of the real one."""
    identified, settings = rigs
    left = shown(real, identified, own)
    force = OWN.index("normal_force")
    scale = identified[RIG.index("force_factor")] / settings["coil.force_factor"]
    drives = [OWN.index(name) for name in ("amplitude", "offset")]
    driven = own.copy()
    driven[drives] *= scale
    driven = np.clip(driven, real.fine.low, real.fine.high)
    given, first = trial_settings(settings, real, driven)
    every = settings | given
    if kind == "rigid walls":
        walls = {"mechanics.contact": "rigid", "mechanics.restitution": 0.2}
        every = {k: v for k, v in every.items() if not k.startswith("mechanics.contact_")} | walls
    else:
        path, time = folder.parent / f"{folder.name}-{real.label}.csv", np.arange(0.0, 3.0, 2e-3)
        cycle = np.sin(2.0 * np.pi * driven[OWN.index("frequency")] * time)
        forces = driven[force] + min(0.1, 0.2 * driven[force]) * cycle
        rows = zip(time.tolist(), forces.tolist(), strict=True)
        path.write_text("time [s],normal_force [N]\n" + "".join(f"{t},{f}\n" for t, f in rows))
        every.pop("friction.normal_force")
        every["friction.normal_force_file"] = str(path)
    time = real.fine.time
    every |= {"run.duration": first + float(time[-1]) + 2e-3, "run.output_step": 1e-4}
    waves = simulate(scene(every, "limited")).waveforms
    columns = {"time": time}
    for body in ("surface", "part"):
        knots = (waves[name].values for name in ("time", f"z_{body}", f"v_{body}"))
        off = real.fine.signals[f"z_{body}"] - left[f"z_{body}"]
        columns[f"z_{body}"] = hermite(time + first, *knots) + np.where(np.isfinite(off), off, 0.0)
    write(folder, real.label, columns)


def told(
    kind: str, count: int, seed: int, trials: Path, folder: Path
) -> list[tuple[Verdict, float]]:
    """What is said of each key whose truth is known, and that; nothing where no searches agree."""
    space, rng = read_space().of_law(LAW), np.random.default_rng([seed, count, KINDS.index(kind)])
    law, identified, truth = _truth(space, rng)
    folder.mkdir()
    rigs = space.rigs(identified[None])[0], space.settings(truth)
    owns = {row["trial"]: _own(row) for row in law["trials"]}
    real = {one.label: one for one in read_trials(trials, space)}
    for label in rng.choice([*owns], count, replace=False).tolist():
        _made(real[label], owns[label], rigs, kind, folder)
    made = read_trials(folder, space)
    space = _known(space, truth, rng)
    coarse = Search(space, [one.target for one in made], 2)
    plan = Plan(
        coarse,
        replace(coarse, targets=[one.fine for one in made]),
        EFFORT,
        lambda name, work: work(),
        seed,
        lambda what, best: None,
        "1",
    )
    law = searched([plan, replace(plan, name="2")])
    if not law.converged:
        return []
    effective = samples(made, law.best)
    meant = rigs_meant([law], effective)
    found = judge(law.best, meant, [deviations(plan.fine, one, effective) for one in meant])
    true = dict(zip(space.names, space.values(truth).tolist(), strict=True))
    unknown = "contact_" if kind == "rigid walls" else "nothing"
    return [(one, true[one.key]) for one in found if one.low is not None and unknown not in one.key]


@pytest.mark.slow
@pytest.mark.physics
@pytest.mark.timeout(4 * 3600)
def test_ranges_hold_the_truth_as_often_as_they_say(trials: Path, tmp_path: Path) -> None:
    cases = [(kind, n, seed) for kind in KINDS for n in COUNTS for seed in range(RIGS)]
    every = {
        (kind, n, seed): told(kind, n, seed, trials, tmp_path / f"{KINDS.index(kind)} {n} {seed}")
        for kind, n, seed in cases
    }
    held = [
        one.low <= true <= one.high
        for found in every.values()
        for one, true in found
        if one.low is not None and one.high is not None
    ]
    assert held, "nothing was told"
    assert 0.8 <= np.mean(held) <= 0.97, every
    whole = [bool(found) for (_, count, _), found in every.items() if count == max(COUNTS)]
    assert np.mean(whole) >= 0.5
