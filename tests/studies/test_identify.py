"""The identification of a rig: its steps against the bench's exact rung, its search against a rig
that is known, since the bench made its records."""

import csv
import ctypes
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.arrays import Array
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.evaluate.store import Store
from cosim.stepper import stepper
from cosim.studies.identify import run
from cosim.studies.identify.chain import chain
from cosim.studies.identify.problem.space import Space, read_space
from cosim.studies.identify.problem.targets import (
    FINE_STEP,
    SEARCH_STEP,
    Measured,
    read_trials,
)
from cosim.studies.identify.report.figures import FIGURES
from cosim.studies.identify.report.scenes import Settings, scene, trial_settings
from cosim.studies.identify.report.solved import (
    bands,
    errors,
    nrmse,
    samples,
    shown,
    told_of_trials,
)
from cosim.studies.identify.report.verdicts import judge, rigs_meant
from cosim.studies.identify.run import identify
from cosim.studies.identify.search import plan
from cosim.studies.identify.search.plan import QUICK, Effort, Searched
from cosim.studies.identify.search.search import Found, Search, deviations, finish
from cosim.toolchain.libraries import library, structures
from cosim.trials.camera import FRAME_RATE, hermite
from cosim.trials.recording import Recording

RIG = {
    "coil.force_factor": 1.35,
    "mechanics.surface_mass": 0.0165,
    "mechanics.flexure_stiffness": 310.0,
    "mechanics.flexure_damping": 0.2,
    "mechanics.suspension_k1": 130.0,
    "mechanics.suspension_k2": -4.2e5,
    "mechanics.suspension_k3": 2.0e8,
    "mechanics.suspension_damping": 0.04,
    "mechanics.travel": 2.05e-3,
    "mechanics.contact_stiffness": 3e6,
    "mechanics.contact_damping": 5.0,
    "friction.mu_plate": 0.18,
    "friction.mu_k": 0.62,
}
OWN = {  # amplitude, offset, phase, start, lift, normal force, frequency
    "1": (7.4, -0.5, 0.37, -0.02, 0.2, 1.0, 9.8),
    "4": (8.1, -0.7, 0.45, 0.03, -0.4, 1.2, 20.2),
    "5": (7.6, -0.9, 0.71, -0.04, 0.5, 0.9, 50.8),
}
NOISE = 2e-6  # m
COLOURED = 2e-5  # m, of a noise with the correlation 0.8 from frame to frame
HELD = 0.6
"""Of the ranges, that hold the truth; ranges of 90 % that two short searches tell."""


def point() -> Array:
    space = read_space()
    return space.point(np.array([RIG[key] for key in space.names]))


def record(label: str, frames: int, seed: int | None = 0) -> dict[str, Array]:
    """Heights of a trial as the bench's exact rung makes them, at the camera's frames."""
    time = np.arange(frames) / FRAME_RATE
    own = np.array(OWN[label])
    trial = _trial(time)
    rig = read_space().settings(point())
    settings, first = trial_settings(rig, trial, own)
    settings = rig | settings
    settings |= {"run.duration": first + float(time[-1]) + 1e-3, "run.output_step": 1e-4}
    waves = cosim.run(scene(settings, "limited")).waveforms
    found = {"time": time}
    noise = np.random.default_rng(seed)
    for body in ("surface", "part"):
        knots = (waves[name].values for name in ("time", f"z_{body}", f"v_{body}"))
        found[f"z_{body}"] = hermite(time + first, *knots)
        if seed is not None:
            found[f"z_{body}"] = found[f"z_{body}"] + NOISE * noise.standard_normal(frames)
    return found


def _trial(time: Array) -> Any:
    from cosim.studies.identify.problem.targets import measured

    motion = np.sin(2 * np.pi * 20.0 * time) * 1e-3
    signals = {"z_surface": motion, "v_surface": np.gradient(motion, time)}
    return measured(Recording("any", time, signals, ()), Path("any.csv"), read_space())


def write(folder: Path, label: str, columns: dict[str, Array]) -> None:
    with (folder / f"Trial {label}.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        units = {"time": "s", "z_surface": "m", "z_part": "m", "current": "A"}
        writer.writerow([f"{name} [{units[name]}]" for name in columns])
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records of three trials of a known rig."""
    made = tmp_path_factory.mktemp("trials")
    for label in OWN:
        write(made, label, record(label, 200))
    return made


@pytest.fixture(scope="module")
def search(folder: Path) -> Search:
    space = read_space()
    return Search(space, [trial.target for trial in read_trials(folder, space)], 2)


def quiet(what: str, best: float) -> None:
    pass


def test_structures_agree_with_the_compiled_code() -> None:
    kinds = [structures("stepper")[name] for name in ("Trial", "Job")]
    there = [library("stepper").chain_sizes(k) for k in range(2)]
    assert [ctypes.sizeof(kind) for kind in kinds] == there


@pytest.mark.physics
@pytest.mark.parametrize("label", OWN)
def test_steps_agree_with_the_exact_rung(label: str) -> None:
    """Start from rest off equilibrium, switch-on, stick, slip, walls, limits of the source."""
    exact = record(label, 300, None)
    space, own = read_space(), np.array(OWN[label])
    apart = {}
    for step in (SEARCH_STEP, FINE_STEP, FINE_STEP / 2.0):
        zeros = np.zeros(len(stepper.OWN))
        target = chain.Target(exact["time"], {}, {}, frozenset(), zeros, zeros, zeros, step)
        found = chain.simulate(target, space.rigs(point()[None]), own[None])[0]
        apart[step] = [
            nrmse(found[f"z_{body}"][0] - found[f"z_{body}"][0][0], z - z[0])
            for body in ("surface", "part")
            for z in [exact[f"z_{body}"]]
        ]
        assert found["z_surface"][0][0] == pytest.approx(exact["z_surface"][0], abs=1e-5)
    assert max(apart[FINE_STEP]) < 0.004
    assert max(apart[SEARCH_STEP]) < 0.01
    assert sum(apart[FINE_STEP / 2.0]) < 0.6 * sum(apart[FINE_STEP])


@pytest.mark.parametrize("measured", [False, True])
def test_each_lane_has_its_own_machine(measured: bool) -> None:
    """Whatever stands in the other lanes, and in whichever lane."""
    rng = np.random.default_rng(1)
    space, time = read_space(), np.arange(60) / FRAME_RATE
    zeros = np.zeros(len(stepper.OWN))
    current = rng.standard_normal(len(time)) if measured else None
    target = chain.Target(time, {}, {}, frozenset(), zeros, zeros, zeros, SEARCH_STEP, current)
    rigs = space.rigs(rng.random((11, len(space.free))))
    own = np.array(
        [OWN[label] for label in ["1", "4", "5", "4", "1", "5", "5", "4", "1", "4", "5"]]
    )
    own[:, 3] = 0.0  # the steps before the record are counted from the earliest start in a batch
    together = chain.simulate(target, rigs, own)[0]["z_part"]
    alone = [chain.simulate(target, rigs[[k]], own[[k]])[0]["z_part"][0] for k in range(11)]
    assert np.array_equal(together, alone)


@pytest.mark.physics
def test_a_measured_current_replaces_the_drive(tmp_path: Path) -> None:
    """The current of a run, told to the chain, moves it as the run did."""
    settings: Settings = {**read_space().settings(point()), "drive.frequency": 20.0}
    settings["run.duration"] = 0.2
    waves = cosim.run(scene(settings | {"run.output_step": 2.5e-4}, "limited")).waveforms
    columns = {name: waves[name].values for name in ("time", "current", "z_surface", "z_part")}
    write(tmp_path, "1", columns)
    space = read_space()
    (trial,) = read_trials(tmp_path, space)
    assert not trial.target.scale[[0, 1, 2, 3, 6]].any()
    own = np.array([0, 0, 0, 0, 0, 0.5, 1.0])
    found = chain.simulate(trial.fine, space.rigs(point()[None]), own[None])[0]
    assert nrmse(found["z_surface"][0], columns["z_surface"]) < 0.05


@pytest.mark.physics
@pytest.mark.slow
def test_own_numbers_are_found_on_the_true_rig(search: Search) -> None:
    """Half of the draws end in another minimum, in one trial at least."""
    rng = np.random.default_rng(2)
    found = search.screen(point()[None], rng, 512, 16, 6)[0]
    for _ in range(4):
        found = search.rescreened(found, rng, 512, 16, 6)
    assert found.costs.max() < 0.01
    assert found.costs.mean() < 5e-3
    truth = np.array([OWN[label] for label in OWN])
    for name, tolerance in (("offset", 0.2), ("phase", 0.02), ("normal_force", 0.1)):
        k = stepper.OWN.index(name)
        assert np.abs(found.own[:, k] - truth[:, k]).max() < tolerance


@pytest.mark.physics
def test_a_rig_is_recovered_from_a_start_nearby(search: Search) -> None:
    """By far less than the full search, so that it only must come closer."""
    rng = np.random.default_rng(3)
    beside = np.clip(point() + 0.03 * rng.choice([-1.0, 1.0], len(point())), 0.0, 1.0)
    start = search.screen(beside[None], rng, 96, 6, 4)[0]
    found = search.nested(start, rng, 60, 0.03, quiet)
    assert found.total < 0.5 * start.total
    assert finish(search, found, 5).total <= found.total


KNOWN = json.loads((Path(__file__).parents[1] / "reference/known_rig.json").read_text())
"""A rig and nine drives whose records look like the published trials."""


@pytest.fixture(scope="module")
def nine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trials as a known rig makes them, with a camera's noise."""
    made, noise = tmp_path_factory.mktemp("nine"), np.random.default_rng(0)
    for number, drive in KNOWN["trials"].items():
        settings = {"circuit.model": "limited", "run.output_step": 1e-4}
        run = cosim.run("paper", KNOWN["rig"] | drive | settings)
        first, last = run.scene.run.settle, run.scene.run.duration
        time = np.arange(int((last - first) * FRAME_RATE) - 1) / FRAME_RATE
        columns = {"time": time}
        for body in ("surface", "part"):
            knots = (run.waveforms[name].values for name in ("time", f"z_{body}", f"v_{body}"))
            exact = hermite(time + first, *knots)
            columns[f"z_{body}"] = exact + NOISE * noise.standard_normal(len(time))
        write(made, number, columns)
    return made


@pytest.mark.slow
@pytest.mark.physics
def test_nine_trials_and_the_travel_give_the_rig_back(nine: Path, tmp_path: Path) -> None:
    """The best of three starts, each 6 % of the bounds away in every key, is within 10 %, and the
    suspension's force within 5 % of its greatest; k1 and k3 share it in more than one way. The
    force factor is within 20 %: the drives make good for its force, and the flexures' damping for
    its back-EMF's, and the search ends beside the best (at 0.00065 and 14 % off on one processor,
    where the true rig costs 0.00037; 5 % off on another, which rounds otherwise). Without the
    travel none need be: a ram that goes farther, in a heavier surface on stiffer flexures, moves
    that nearly alike, and such ends had the mass 11 % and the force factor 37 % off."""
    bounds = tmp_path / "bounds.toml"
    bounds.write_text(f'[rig."mechanics.travel"]\nvalue = {KNOWN["rig"]["mechanics.travel"]}\n')
    space = read_space(bounds)
    trials = read_trials(nine, space)
    true = np.array([KNOWN["rig"][key] for key in space.names])
    found = _from_beside(trials, space, space.point(true))
    assert found.costs.mean() <= 0.001
    values = dict(zip(space.names, space.values(found.point), strict=True))
    for key, within in {
        **dict.fromkeys(("mechanics.surface_mass", "mechanics.flexure_stiffness"), 0.1),
        **dict.fromkeys(("mechanics.suspension_k2", "friction.mu_plate"), 0.1),
        "coil.force_factor": 0.2,
    }.items():
        assert values[key] == pytest.approx(KNOWN["rig"][key], rel=within), key
    forces = [
        sum(rig[f"mechanics.suspension_k{n}"] * Q**n for n in (1, 2, 3))
        for rig in (values, KNOWN["rig"])
    ]
    assert forces[0] == pytest.approx(forces[1], abs=0.05 * np.abs(forces[1]).max())


Q = np.linspace(-2e-3, 2e-3, 9)
"""m; ways of the ram at which the suspension's forces are compared."""


def _from_beside(trials: list[Measured], space: Space, true: Array) -> Found:
    """What the search makes of three starts beside the true point: all go some way, the best one
    all the way, as in the search itself."""
    coarse = Search(space, [trial.target for trial in trials], 2)
    fine = Search(space, [trial.fine for trial in trials], 2)

    def further(found: Found, rng: np.random.Generator, count: int, sigma: float) -> Found:
        return coarse.nested(coarse.rescreened(found, rng, 256, 16, 4), rng, count, sigma, quiet)

    ends = []
    for rng in map(np.random.default_rng, (1, 2, 3)):
        beside = true + 0.06 * rng.choice([-1.0, 1.0], len(true))
        found = coarse.screen(np.clip(beside, 0.0, 1.0)[None], rng, 256, 16, 4)[0]
        ends.append(further(found, rng, 160, 0.05))
    found, rng = min(ends, key=lambda one: one.total), np.random.default_rng(9)
    found = further(further(found, rng, 330, 0.04), rng, 400, 0.02)
    found = fine.rescreened(fine.refined(found.point, found.own, 5), rng, 256, 16, 4)
    return finish(fine, found, 60)


def test_the_same_seed_gives_the_same_and_an_interrupted_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On one thread and on two; with a store of the first stages, and a trial whose part was not
    measured."""
    write(tmp_path, "4", record("4", 100))
    write(tmp_path, "5", {k: z for k, z in record("5", 100).items() if k != "z_part"})
    free = {"coil.force_factor", "mechanics.surface_mass"}
    given = (f'[rig."{key}"]\nvalue = {value}\n' for key, value in RIG.items() if key not in free)
    bounds = tmp_path / "bounds.toml"
    bounds.write_text("".join(given))
    brief = Effort(1, 6, ((2, 6, 0.12), (1, 12, 0.06)), ((1, 6, 0.1),), 1, 1)
    monkeypatch.setattr(run, "QUICK", brief)
    monkeypatch.setattr(plan, "SCREENED", 16)
    monkeypatch.setattr(plan, "AGAIN", (32, 6, 3))
    monkeypatch.setattr(plan, "CAREFUL", (64, 6, 3))
    monkeypatch.setattr(plan, "DRIVES", (64, 6, 3))
    monkeypatch.setattr(plan, "LAST", 10)
    more: dict[str, Any] = {"bounds": bounds, "quick": True, "seed": 4}
    whole = identify(tmp_path, workers=2, out=tmp_path / "out", **more)
    plain, done = Store.add, [0]

    def counted(store: Store, key: str, found: Any) -> None:
        plain(store, key, found)
        done[0] += 1
        if done[0] == 5:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Store, "add", counted)
        identify(tmp_path, workers=2, out=tmp_path / "wild", **more)
    assert {path.name for path in (tmp_path / "wild").iterdir()} == {"identify.sqlite"}
    with pytest.raises(BadInput, match="belongs to other work"):
        identify(tmp_path, workers=1, out=tmp_path / "wild", **{**more, "seed": 5})
    heard = Store.once
    monkeypatch.setattr(Store, "once", lambda *given: done.append(1) or heard(*given))
    monkeypatch.setattr(Store, "add", lambda *given: done.append(-1) or plain(*given))
    again = identify(tmp_path, workers=1, out=tmp_path / "wild", **more)
    assert sum(done[1:]) == 5, "stages that were not done again"
    assert again.numbers == whole.numbers
    assert whole.numbers["cost"] < 0.1
    assert {one["kind"] for one in whole.numbers["verdicts"]} == {"not converged"}, "a quick search"
    page = (tmp_path / "out" / "identify.md").read_text()
    assert "one search tells no range" in page and "The spring-loaded plate stands still" in page
    assert [len(one["rests_mm"]) for one in whole.numbers["laws"]] == [2]
    assert "rests at more than one place: cubic at q =" in page
    titles = " ".join(axis.get_title("left") for axis in FIGURES["trials"](whole).axes)
    for words in ("velocity of the surface [m/s], NRMSE", "height of the part [mm], mean error"):
        assert f": {words}" in titles
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"identify.json", "identify.csv", "identify.md", "rig.toml", "trial-04.toml"} <= names
    assert "amplitude [V],offset [V],phase," in (tmp_path / "out" / "identify.csv").read_text()
    loaded = cosim.load(tmp_path / "out" / "trial-04.toml")
    mass = whole.rig["mechanics.surface_mass"]
    assert loaded.mechanics.surface_mass == pytest.approx(mass, rel=1e-5)


def test_a_store_of_another_build_is_not_taken(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its stages would stand among those of this one."""
    asked = run._asked(read_space(), [], QUICK)
    with Store(tmp_path / "of.sqlite", *asked) as store:
        store.add("a stage", 1)
    monkeypatch.setattr("cosim.evaluate.store.digest", lambda name: f"another {name}")
    with pytest.raises(BadInput, match="belongs to other work"):
        Store(tmp_path / "of.sqlite", *run._asked(read_space(), [], QUICK))


def made_up(space: Space, place: Array, cost: float, amplitude: float = 7.0) -> Found:
    own = np.tile(np.array(OWN["1"]), (2, 1))
    own[:, 0] = amplitude
    alike = Found(space, place, own, np.ones(2))
    return replace(alike, costs=alike.costs * cost / alike.total)  # whatever the priors say


def test_verdicts() -> None:
    """Without two searches that agree there is no range; then it holds all that is as likely, of
    every law whose searches agree, and what is reported."""
    cubic, knee = read_space(), read_space().of_law("knee")
    middle, other = np.full(len(cubic.free), 0.5), np.full(len(knee.free), 0.52)
    best = made_up(cubic, middle, 0.1)
    turned = []
    for turn in np.linspace(-0.35, 0.35, 6):
        moved = middle.copy()
        moved[0] += turn  # the force factor, and the amplitude against it
        ratio = float(cubic.values(middle)[0] / cubic.values(moved)[0])
        turned.append(made_up(cubic, moved, 0.1002, 7.0 * ratio))
    far = middle.copy()
    far[:] = 0.9
    ends = [best, made_up(cubic, middle + 0.01, 0.1015)]
    told = Searched(ends, [best, *turned, made_up(cubic, far, 0.12)])
    split = Searched(
        [made_up(knee, other, 0.11), made_up(knee, other, 0.15)], [made_up(knee, other, 0.11)]
    )
    agreed = Searched(
        [made_up(knee, other, 0.11), made_up(knee, other, 0.111)], [made_up(knee, other, 0.11)]
    )

    unknown = Searched([best], [best, *turned, made_up(cubic, far, 0.16)])
    for several in ([unknown], [Searched([best, made_up(cubic, far, 0.12)], [best]), split]):
        meant = rigs_meant(several, 400.0)
        kinds = {one.kind for one in judge(best, meant)}
        assert kinds == {"not converged", "law"}
    assert len(rigs_meant([unknown], 400.0)) == 8, "of a single search: far is left out"

    for several, apart in (([told, split], 0.0), ([told, agreed], 0.0), ([told, split], 0.01)):
        meant = rigs_meant(several, 400.0)
        found = {v.key: v for v in judge(best, meant, [one.point * 0.0 + apart for one in meant])}
        mass = found["mechanics.surface_mass"]
        k = cubic.names.index(mass.key)
        least, most = 0.5 - 2 * 1.645 * apart, 0.52 + 2 * 1.645 * apart
        ends_of = [cubic.values(np.full(len(middle), x))[k] for x in (least, most)]
        assert (mass.low, mass.high) == pytest.approx(ends_of)
        assert mass.kind == "identified"
        assert found["mechanics.suspension_k2"].kind == "law"
        force = found["coil.force_factor"]
        assert force.kind == "product" and "amplitudes" in force.words
        assert all(v.low <= v.value <= v.high for v in found.values() if v.low and v.high)


@pytest.mark.physics
@pytest.mark.slow
def test_deviations_are_of_the_size_of_the_scatter_of_fits(folder: Path) -> None:
    """Fits from beside the truth to records whose noise alone differs, where that is white."""
    space, rig, own = read_space(), read_space().rigs(point()[None])[0], np.array([*OWN.values()])
    trials = read_trials(folder, space)
    exact = [shown(trial, rig, row) for trial, row in zip(trials, own, strict=True)]
    count = float(sum(len(trial.fine.time) * len(trial.fine.signals) for trial in trials))
    ends, told = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        targets = [
            replace(
                trial.fine,
                signals={
                    name: values + 0.3 * np.std(values) * rng.standard_normal(len(values))
                    for name, values in each.items()
                },
            )
            for trial, each in zip(trials, exact, strict=True)
        ]
        noisy = Search(space, targets, 2)
        beside = np.clip(point() + 0.01 * rng.standard_normal(len(point())), 0.0, 1.0)
        found = finish(noisy, noisy.refined(beside, own, 4), 20)
        ends.append(found.point)
        told.append(deviations(noisy, found, count))
    scatter, said = np.std(ends, axis=0, ddof=1), np.median(told, axis=0)
    for key in ("surface_mass", "flexure_stiffness", "travel"):
        k = space.names.index(f"mechanics.{key}")
        assert said[k] / 3.0 < scatter[k] < 3.0 * said[k], key


def test_effective_samples_count_what_is_new(folder: Path) -> None:
    """Of noise that is white nearly all; of noise with the correlation a from frame to frame the
    share (1 - a)/(1 + a), as theory has it."""
    space = read_space()
    (trial,) = [one for one in read_trials(folder, space) if one.label == "5"]
    rig, own = space.rigs(point()[None])[0], np.array(OWN["5"])
    exact, rng, found = shown(trial, rig, own)["v_surface"], np.random.default_rng(0), {}
    whole = Found(space, point(), own[None], np.zeros(1))
    for a in (0.0, 0.7):
        counts = []
        for _ in range(20):
            noise = rng.standard_normal(len(exact))
            for k in range(1, len(noise)):
                noise[k] = a * noise[k - 1] + (1.0 - a**2) ** 0.5 * noise[k]
            signals = {**trial.fine.signals, "v_surface": exact + 1e-3 * noise}
            noisy = replace(trial, fine=replace(trial.fine, signals=signals))
            counts.append(samples([noisy], whole))
        found[a] = float(np.median(counts)) / len(exact)
    assert 0.3 < found[0.0] <= 1.0
    assert 0.5 * 0.3 / 1.7 < found[0.7] < 1.5 * 0.3 / 1.7


@pytest.mark.slow
@pytest.mark.physics
def test_ranges_hold_the_truth_or_are_not_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trials of a known rig with coloured noise, three keys free, a small effort. This measures
    whether ranges are right where the search is easy and the model true: then they should hold the
    truth. It says nothing of all 13 keys, nor of a model that is wrong."""
    monkeypatch.setattr(plan, "CAREFUL", (64, 6, 4))
    monkeypatch.setattr(plan, "DRIVES", (64, 6, 4))
    few = ((3, 30, 0.12), (1, 60, 0.05))
    monkeypatch.setattr(run, "FULL", plan.Effort(1, 25, few, ((1, 20, 0.1),), 1, 2))
    free = {
        "coil.force_factor": 'low = 0.5\nhigh = 2.6\nscale = "log"',  # without the priors
        "mechanics.surface_mass": 'low = 0.011\nhigh = 0.035\nscale = "log"',
        "mechanics.flexure_stiffness": 'low = 150.0\nhigh = 1000.0\nscale = "log"',
    }
    entries = {key: f"value = {value}" for key, value in RIG.items()} | free
    bounds = tmp_path / "bounds.toml"
    bounds.write_text("".join(f'[rig."{key}"]\n{entry}\n' for key, entry in entries.items()))
    held, ranges = 0, 0
    for seed in range(4):
        rng, trials = np.random.default_rng(seed), tmp_path / f"{seed}"
        trials.mkdir()
        for label, frames in (("1", 330), ("4", 240), ("5", 160)):
            columns = record(label, frames, None)
            for body in ("surface", "part"):
                noise = rng.standard_normal(frames)
                for k in range(1, frames):
                    noise[k] += 0.8 * noise[k - 1]
                columns[f"z_{body}"] += COLOURED * 0.6 * noise
            write(trials, label, columns)
        found = identify(trials, bounds=bounds, seed=seed, workers=2)
        told = [one for one in found.verdicts if one.low is not None]
        assert bool(told) == bool(found.numbers["converged"])
        if not told:
            assert {one.words for one in found.verdicts} == {"not converged"}
        for one in told:
            assert one.low is not None and one.high is not None
            assert one.low <= one.value <= one.high
            held += one.low <= RIG[one.key] <= one.high
            ranges += 1
    assert held >= HELD * ranges


def test_missing_frames_have_no_residual(folder: Path, tmp_path: Path) -> None:
    """A tenth of the heights is gone: the rest are compared with the same motion, and the true rig
    fits them as well."""
    rng, space = np.random.default_rng(4), read_space()
    for label in OWN:
        columns = record(label, 200)
        for name in ("z_surface", "z_part"):
            columns[name][rng.choice(200, 20, replace=False)] = np.nan
        columns["z_surface"][:2] = np.nan
        write(tmp_path, label, columns)
    own = np.array([OWN[label] for label in OWN])
    rigs, worst = space.rigs(point()[None]), []
    for where in (folder, tmp_path):
        trials = read_trials(where, space)
        found, costs = chain.refine([t.fine for t in trials], rigs, own[None, :, None], 3, 1)
        worst.append(costs.max())
        rows = [errors(t, rigs[0], one) for t, one in zip(trials, found[0, :, 0], strict=True)]
        assert max(row["part_error_mm"] for row in rows) < 0.01
        assert all(np.isfinite(row["v_average_mm_per_s"]) for row in rows)
        assert all(bands(t, rigs[0], one) for t, one in zip(trials, found[0, :, 0], strict=True))
        assert [t.frequency for t in trials] == pytest.approx([9.8, 20.2, 50.8], rel=0.02)
    assert worst[1] < 2.0 * worst[0] + 1e-3


def test_mean_velocities_are_those_of_the_trials_scenes(folder: Path) -> None:
    """The search's own steps gave 0.743 mm/s for 0.749 in a slow trial."""
    space = read_space()
    trials, own = read_trials(folder, space), np.array([*OWN.values()])
    best = Found(space, point(), own, np.ones(len(own)))
    rows, _ = told_of_trials(trials, best)
    for trial, one, row in zip(trials, own, rows, strict=True):
        settings, _ = trial_settings(best.settings, trial, one)
        ran = cosim.run(scene(best.settings | settings, "limited")).summary["v_average"]
        assert row["v_average_mm_per_s"] == pytest.approx(ran * 1e3, rel=1e-4)


@pytest.mark.reliability
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[rig]\n", None),
        ('[rig."coil.force"]\nvalue = 1.0\n', '[rig."coil.force"]: this key is none of'),
        ('[rig."friction.mu_k"]\nlow = 0.5\n', "needs either a value, or low and high"),
        ('[rig."friction.mu_k"]\nlow = 0.5\nhigh = 0.4\n', "low = 0.5 must be below high = 0.4"),
        ('[rig."friction.mu_k"]\nlow = "a"\nhigh = 0.4\n', 'low = "a" must be a number within'),
        ('[rig."friction.mu_k"]\nlow = nan\nhigh = 0.4\n', "low = nan must be a number within"),
        (f'[rig."friction.mu_k"]\nlow = 0.5\nhigh = 1{"0" * 400}\n', "must be a number within"),
        (f'[rig."friction.mu_k"]\nlow = 0.5\nhigh = 0x{"f" * 6000}\n', "high = an endless number"),
        ('[rig."friction.mu_s"]\nvalue = 0.3\n', "low = 0.45 must be at most friction.mu_s = 0.3"),
        ('[rig."mechanics.ram_mass"]\nvalue = -1\n', "value = -1 must be a number from 1e-09"),
        ('[rig."circuit.supply"]\nvalue = 1.0\n', "must be below circuit.supply = 1 V"),
        ("[measured.travel]\nvalue = 2e-3\nsd = 1e-320\n", "must be at least 1e-12"),
        (
            '[trial."friction.normal_force"]\nlow = -5\nhigh = -1\n',
            "low = -5 must be a number from",
        ),
        (
            '[trial."drive.frequency"]\nlow = 0\nhigh = 1\n',
            "low = 0 must be a number from 0.1 to 10.",
        ),
        (
            '[trial."drive.offset"]\nlow = 0\nhigh = 1\nprior = 0.5\nsigma = 0.1\n',
            "prior, sigma is none of high, low, source, value",
        ),
        ('[rig."mechanics.travel"]\nlow = -1.0\nhigh = 1.0\n', "low = -1 must be a number from"),
        ('[rig."mechanics.travel"]\nvalue = 1e-3\nprior = 1e-3\n', "needs either a value, or"),
        ('[rig."circuit.supply"]\nlow = 12.0\nhigh = 18.0\n', "it is not searched"),
        ('[trial."drive.offset"]\nmost = 1.0\n', "most is none of"),
        ('[rig."mechanics.suspension"]\nlaws = ["square"]\n', 'a list of some of "cubic", "knee"'),
        ('[rig."mechanics.suspension"]\nlaws = ["knee"]\nlow = 3\n', "and stand alone"),
        ("[ring]\n", "ring: there are the tables rig, trial and measured only"),
        ("[rig\n", "this is not TOML"),
    ],
)
def test_bounds_are_refused_in_a_sentence(text: str, told: str | None, tmp_path: Path) -> None:
    path = tmp_path / "bounds.toml"
    path.write_text(text)
    if told is None:
        assert read_space(path).names == read_space().names
        return
    with pytest.raises(BadInput) as error:
        read_space(path)
    assert told in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.reliability
def test_trials_are_refused_in_a_sentence(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.arange(200) / FRAME_RATE
    (tmp_path / "still").mkdir()
    write(tmp_path / "still", "1", {"time": time, "z_surface": time * 0.0})
    (tmp_path / "drift").mkdir()
    write(tmp_path / "drift", "1", {"time": time, "z_surface": time**2})
    (tmp_path / "part").mkdir()
    write(tmp_path / "part", "1", {"time": time, "z_part": np.sin(100 * time)})
    (tmp_path / "far").mkdir()
    write(tmp_path / "far", "1", {"time": time, "z_surface": 1e150 * np.sin(100 * time)})
    names = {"link": "Trial 9.csv", "escape": "Trial \x1b[31m.csv", "long": f"Trial {'x' * 91}.csv"}
    for name in (*names, "twice"):
        shutil.copytree(folder, tmp_path / name)
    for name, file in names.items():
        (tmp_path / name / file).symlink_to(tmp_path / "nowhere")
    (tmp_path / "twice" / "Trial 1.txt").touch()
    out = ["--out", str(tmp_path / "out")]
    for arguments, told in (
        ([str(tmp_path / "nothing")], "cannot be read"),
        ([str(tmp_path / "still")], "does not change"),
        ([str(tmp_path / "drift")], "does not repeat"),
        ([str(tmp_path / "far")], "row 3, column z_surface [m]: the value must be within ±1e+09"),
        ([str(tmp_path / "link")], "Trial 9.csv: cannot be read (No such file or directory)"),
        (
            [str(tmp_path / "escape")],
            "Trial \\u001b[31m.csv: the name of a trial must be printable",
        ),
        ([str(tmp_path / "long")], "must be printable and have at most 100 bytes; rename it"),
        ([str(tmp_path / "twice")], "two trials are called Trial 1; rename one of them"),
        ([str(tmp_path / "no\x1b[31m")], "no\\u001b[31m: cannot be read"),
        ([str(tmp_path / "part")], "no height or velocity of the surface"),
        ([str(folder), "--apart", "7"], "There is no trial 7"),
        ([str(folder), "--seed", "-1"], "--seed -1: must be"),
    ):
        assert main(["identify", *arguments, *out]) == 2
        assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
