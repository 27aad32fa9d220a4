"""What to measure next: gauges and weights against closed forms, the choice on made rigs."""

from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.store import Store
from cosim.files.picture import Picture
from cosim.mechanics.stickslip import numbers_of
from cosim.scene import changed, load
from cosim.simulation.simulate import simulate
from cosim.studies.identify.problem.gauges import AT_WALL, GAUGES
from cosim.studies.identify.problem.space import Space, read_space
from cosim.studies.identify.problem.targets import read_trials
from cosim.studies.identify.search.search import SAMPLES, Found, Search, finish, totals
from cosim.studies.limits.study import ensemble
from cosim.studies.measure import measure as study
from cosim.studies.measure import sample as sampling
from cosim.studies.measure.measure import report, worths
from cosim.studies.measure.sample import (
    CANDIDATES,
    KEPT,
    SPREAD,
    TARGETS,
    Sample,
    drawn,
    gauged_on,
    held_currents,
    whole,
)
from cosim.studies.measure.worth import FEWEST, chance, interval, likely, worth
from tests.studies.test_figures import assert_legible
from tests.studies.test_identify import OWN, folder, point

__all__ = ["folder"]

ROOT = Path(__file__).parents[2]
RIGS = ROOT / "results" / "identify.json"
SCENE = load("paper")


def shown(name: str, **settings: Any) -> float:
    """What a gauge shows on scene `paper` with settings of its mechanics."""
    given = {f"mechanics.{key}": value for key, value in settings.items()}
    return GAUGES[name].of(numbers_of(changed(SCENE, given, "test")))


@pytest.mark.parametrize(("name", "sign"), [("click up", 1.0), ("click down", -1.0)])
def test_click_currents_of_a_cubic(name: str, sign: float) -> None:
    rig = {"suspension_k1": 240.0, "suspension_k2": -3e5, "suspension_k3": 7e7, "travel": 2e-3}
    q = sign * 2e-3
    force = 240.0 * q - 3e5 * q**2 + 7e7 * q**3 + SCENE.mechanics.ram_mass * 9.81
    assert shown(name, **rig) == pytest.approx(force / SCENE.coil.force_factor, rel=1e-9)


def test_click_current_is_that_at_which_the_ram_leaves_the_wall() -> None:
    """The current of scene `paper` goes slowly down from half an ampere above it."""
    rig = {"suspension_k1": 200.0, "suspension_k2": 0.0, "suspension_k3": 2e7, "travel": 1e-3}
    given = {f"mechanics.{key}": value for key, value in rig.items()}
    current = shown("click up", **rig)
    for more, at_wall in ((0.05, True), (-0.05, False)):
        still = {"drive.amplitude": 0.0, "drive.offset": 4.0 * (current + more)}
        run = {"circuit.model": "ideal", "run.duration": 2.0, "mechanics.suspension_damping": 1.0}
        waves = simulate(changed(SCENE, given | still | run, "test")).waveforms
        q = float((waves.z_ram - waves.z_surface)[-1])
        assert (q >= 1e-3) == at_wall


def test_a_current_that_the_source_does_not_hold_is_seen_as_its_most() -> None:
    """Its output is 2 V from the rails of 18 V, and 4 of 11 Ohm are the sense resistor's."""
    limits = {f"circuit.swing_loss_{end}": 2.0 for end in ("high", "low")}
    given = limits | {"coil.resistance": 7.0, "circuit.sense_resistance": 4.0}
    stiff = {"mechanics.suspension_k3": 1e9, "mechanics.travel": 3e-3}
    scene = changed(SCENE, given | stiff, "test")
    assert held_currents(scene) == pytest.approx((-16.0 / 11.0, 16.0 / 11.0))
    numbers = dict(zip((one.name for one in CANDIDATES), gauged_on(scene), strict=False))
    assert numbers["click up"] == [pytest.approx(16.0 / 11.0)]
    assert numbers["click down"] == [pytest.approx(-16.0 / 11.0)]
    assert numbers["the coil's impedance"][0] == scene.coil.force_factor
    weak = changed(scene, {"circuit.current_limit": 0.5, "coil.count": 2}, "test")
    assert held_currents(weak) == pytest.approx((-0.25, 0.25))


@pytest.mark.parametrize("current", [0.0, -1.0])
def test_resonance_of_a_cubic(current: float) -> None:
    """About the root of the cubic at which it rests, and where a wall holds it none."""
    rig = {"suspension_k1": 240.0, "suspension_k2": -3e5, "suspension_k3": 7e7, "travel": 3e-3}
    force = SCENE.coil.force_factor * current - SCENE.mechanics.ram_mass * 9.81
    roots = np.roots([7e7, -3e5, 240.0, -force])
    q = min(roots[np.isreal(roots)].real, key=abs)
    stiffness = 240.0 - 6e5 * q + 21e7 * q**2
    name = "resonance" if current == 0.0 else "resonance down"
    hertz = sqrt(stiffness / SCENE.mechanics.ram_mass) / (2.0 * pi)
    assert shown(name, **rig) == pytest.approx(hertz, rel=1e-5)
    assert shown("resonance down", **rig | {"travel": 1e-3}) == AT_WALL


def test_ring_down() -> None:
    """Of the exact solution of a damped oscillator, and the edge at which it only creeps."""
    ram = SCENE.mechanics.ram_mass
    rig: dict[str, Any] = {"surface_mass": 0.02, "flexure_stiffness": 300.0}
    rig["flexure_damping"] = 0.5
    mass = 0.02 + ram
    roots = np.roots([mass, 0.5, 300.0])
    assert shown("ring-down", **rig) == pytest.approx(abs(roots[0].imag) / (2.0 * pi))
    assert shown("decay", **rig) == pytest.approx(-roots[0].real)
    rig["flexure_damping"] = 2.1 * sqrt(300.0 * mass)
    assert shown("ring-down", **rig) == 0.0


def test_other_gauges() -> None:
    rig = {"surface_mass": 0.02, "travel": 2e-3, "flexure_stiffness": 490.5}
    assert shown("weight", **rig) == pytest.approx(0.02 + SCENE.mechanics.ram_mass)
    assert shown("travel", **rig) == pytest.approx(4e-3)
    assert shown("deflection", **rig) == pytest.approx(1e-3)
    assert shown("force factor") == SCENE.coil.force_factor


def space_with(folder: Path, text: str) -> Space:
    path = folder / "bounds.toml"
    path.write_text(text)
    return read_space(path)


@pytest.mark.reliability
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[measured."click"]\nvalue = 1.0\nsd = 0.1\n', 'click"]: this measurement is none of'),
        ("[measured.travel]\nvalue = 1.0\n", "it needs a value and a standard deviation sd"),
        ("[measured.travel]\nvalue = true\nsd = 0.1\n", "value = true must be a number"),
        ("[measured.travel]\nvalue = 4e-3\nsd = 0\n", "sd = 0 must be at least 1e-12"),
        ("measured = 1\n", "there are the tables rig, trial and measured only"),
    ],
)
def test_measured_is_refused_in_a_sentence(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as error:
        space_with(tmp_path, text)
    assert told in str(error.value)


def test_the_bounds_tell_every_gauge() -> None:
    text = (ROOT / "cosim/studies/identify/problem/bounds.toml").read_text(encoding="utf-8")
    assert all(f'"{name}" (' in text or f'"{name}" and' in text for name in GAUGES)


def test_a_measurement_weighs_as_in_a_likelihood(tmp_path: Path) -> None:
    """-2 ln L = (effective samples) ln cost + miss², so a miss by one standard deviation is worth
    as much as the cost's growth by a share of one in the effective samples; of all laws."""
    text = '[measured.travel]\nvalue = 4e-3\nsd = 1e-4\n[measured."force factor"]\n'
    space = space_with(tmp_path, text + "value = 1.5\nsd = 0.1\n").of_law("knee")
    points = np.repeat(np.full((1, len(space.free)), 0.4), 2, axis=0)
    values = space.values(points)
    values[:, space.names.index("mechanics.travel")] = 2e-3
    values[0, space.names.index("coil.force_factor")] = 1.3
    values[1, space.names.index("coil.force_factor")] = 1.5
    points = space.point(values)
    off = space.residuals(points)
    assert np.abs(off[:, :2]) == pytest.approx(np.array([[0.0, 2.0], [0.0, 0.0]]), abs=1e-6)
    entry = space.entries["coil.force_factor"]
    assert entry.prior is not None and entry.sigma is not None
    priors = [np.log(value / entry.prior) / entry.sigma for value in (1.3, 1.5)]
    assert off[:, 2] == pytest.approx(priors)
    costs = np.full((2, 9), 0.1)
    assert 9.0 * SAMPLES * (totals(space, costs, points) / 0.1 - 1.0) == pytest.approx(
        (off**2).sum(axis=1)
    )


@pytest.mark.usefixtures("folder")
def test_the_finish_goes_to_what_was_measured(folder: Path, tmp_path: Path) -> None:
    """Trials of a known rig from beside it, with the travel measured far from the truth: the finer
    that is, the nearer the finish comes to it."""
    true = read_space().settings(point())["mechanics.travel"]
    found = []
    for sd in (1e-2, 1e-6):
        text = f"[measured.travel]\nvalue = {2.06 * true}\nsd = {sd}\n"
        space = space_with(tmp_path, text)
        search = Search(space, [trial.fine for trial in read_trials(folder, space)], 2)
        own = np.array([OWN[label] for label in OWN])
        start: Found = search.refined(point(), own, 2)
        found.append(space.settings(finish(search, start, 8).point)["mechanics.travel"] / true)
    assert found[0] == pytest.approx(1.0, abs=0.01)
    assert found[1] == pytest.approx(1.03, abs=0.002)


def test_weights_of_a_line() -> None:
    """Normal posteriors: y measured to sd on a wide, dense sample leaves sd/slope of the target."""
    y = np.linspace(-50.0, 50.0, 100_001)[:, None]
    low, high = interval(0.5 * y, likely(y, np.array([1.0]), np.array([2.0])))
    assert np.concatenate([low, high]) == pytest.approx([0.5 - 1.645, 0.5 + 1.645], abs=2e-3)


def test_an_interval_stands_on_enough_rigs() -> None:
    y = np.arange(40.0)[:, None]
    weights = likely(y, np.array([20.0]), np.array([1e-6]))
    assert weights.sum() ** 2 / (weights**2).sum() >= FEWEST


@pytest.mark.slow
def test_worth() -> None:
    """A measurement of the target itself against one of something else, and nothing; 90 % of the
    intervals hold the truth."""
    rng, n = np.random.default_rng(0), 800  # fewer stand for wider intervals
    targets = rng.standard_normal((n, 1))
    other, none = rng.standard_normal((n, 1)), np.empty((n, 0))
    own, useless, now = (
        worth(v, np.full(v.shape, sd), targets, rng)
        for v, sd in ((targets, 0.2), (other, 1e-3), (none, 1.0))
    )
    assert now.width == pytest.approx(2.0 * 1.645, rel=0.1)
    assert own.width == pytest.approx(now.width * 0.2 / sqrt(1.04), rel=0.2)
    assert useless.width == pytest.approx(chance(targets, rng).width, rel=0.05)
    assert now.width < useless.width < 1.25 * now.width  # of fewer rigs: wider
    assert all(0.85 <= one.held <= 0.95 for one in (own, useless, now))


def test_drawn_rigs_keep_what_given_ones_agree_in() -> None:
    """Mean, spread and a product; keys of their own law; nothing that a scene cannot have."""
    rng = np.random.default_rng(1)
    given: list[dict[str, Any]] = []
    for factor in np.exp(0.2 * rng.standard_normal(60)).tolist():
        given.append({"coil.force_factor": factor, "mechanics.surface_mass": 0.02 / factor})
        given[-1]["friction.mu_k"] = 0.6
    other = {**given[0], "mechanics.suspension": "knee"}
    assert drawn(SCENE, [other], 2, rng) == [pytest.approx(other)] * 2
    found = drawn(SCENE, given, 400, rng)
    logs = [np.log([rig["coil.force_factor"] for rig in some]) for some in (given, found)]
    assert logs[1].mean() == pytest.approx(logs[0].mean(), abs=0.03)
    assert logs[1].std() == pytest.approx(logs[0].std(), rel=0.15)
    products = [rig["coil.force_factor"] * rig["mechanics.surface_mass"] for rig in found]
    assert products == pytest.approx([0.02] * 400)
    assert len({rig["coil.force_factor"] for rig in found}) == 400 and 0.0 < SPREAD < 1.0
    near = [{"friction.mu_k": mu} for mu in (0.70, 0.71, 0.715, 0.719)]
    assert max(rig["friction.mu_k"] for rig in drawn(SCENE, near, 100, rng)) <= 0.72


def test_all_keys_of_any_rig() -> None:
    found = whole(SCENE, [{"coil.force_factor": 1.0}, {"mechanics.travel": 2e-3}])
    own = {"coil.force_factor": SCENE.coil.force_factor}
    own["mechanics.travel"] = SCENE.mechanics.travel
    assert found == [own, own | {"coil.force_factor": 1.0}, own | {"mechanics.travel": 2e-3}]


def test_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A small one: what it leaves, the order of its rows, and a legible figure."""
    drawings: list[Any] = []
    monkeypatch.setattr(Picture, "write", lambda figure, path: drawings.append(figure))
    few = sampling.Effort(24, 6, 2)
    monkeypatch.setattr(sampling, "OWN", few)
    monkeypatch.setattr(sampling, "OTHERS", sampling.Effort(0, 0, 0))
    monkeypatch.setattr(study, "RIGS", 6)
    steps: list[tuple[int, int]] = []
    rigs = tmp_path / "rigs.json"
    masses = ", ".join(f'{{"mechanics.surface_mass": {m}}}' for m in (0.016, 0.018, 0.02, 0.035))
    rigs.write_text(f'{{"ensemble": [{masses}]}}')
    found = study.measure(
        rigs=rigs, out=tmp_path, progress=lambda done, total, what: steps.append((done, total))
    )
    assert steps == [(k, 7) for k in range(1, 8)]
    assert "Measure next: " in repr(found) and not (tmp_path / "measure.sqlite").exists()
    assert {row["measurement"] for row in found.rows[2:]} == {one.name for one in CANDIDATES}
    widths = [row[f"{TARGETS[0]}: width [mm/s]"] for row in found.rows[2:]]
    assert widths == sorted(widths)
    assert (tmp_path / "measure.csv").exists() and (tmp_path / "measure.md").exists()
    assert_legible(drawings[0])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rigs", "none.json"], "none.json: cannot be read"),
        (["--rigs", "rigs.json"], "rigs.json: 2 rigs are too few"),
        (["--rigs", "rigs.json", "--seed", "-1"], "--seed -1: must be a whole number from 0"),
    ],
)
def test_bad_input(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rigs.json").write_text('{"ensemble": [{}, {"mechanics.surface_mass": 0.02}]}')
    assert main(["chart", "measure", *arguments, "--out", "out"]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not (tmp_path / "out").exists()


MADE, DRAWS = 32, 8
"""Rigs, and draws of a measurement's noise on each: of eight rigs drawn once, one more or less is
chance."""


@pytest.mark.slow
def test_the_recommended_measurement_narrows_more_than_others() -> None:
    """Rigs that are made about the published ones, each the truth and not in the sample: what is
    recommended narrows the interval more than the median of the others does, and it holds the
    truth, in five of six; the intervals of all measurements hold it in nine of ten."""
    given = whole(SCENE, ensemble(RIGS, SCENE))
    more = drawn(SCENE, given, study.RIGS - len(given), np.random.default_rng(0))
    made = drawn(SCENE, given, MADE, np.random.default_rng(2))
    rigs, many = [*given, *more, *made], len(given) + len(more)
    with Store(None) as store:
        found = sampling.sample(
            *(SCENE, rigs, store, lambda rig: Evaluator(rig, kept=KEPT, workers=2), 0),
            lambda what: None,
        )
    assert len(found.targets) == len(rigs)
    known = Sample([values[:many] for values in found.values], found.targets[:many])
    first = worths(known, 0)[1][0][0]
    rng = np.random.default_rng(3)
    widths, held = (np.empty((len(CANDIDATES), MADE, DRAWS)) for _ in range(2))
    for k, (one, values) in enumerate(zip(CANDIDATES, found.values, strict=True)):
        for made_rig, truth in enumerate(range(many, len(rigs))):
            sd, target = one.accuracy(values[truth]), found.targets[truth, 0]
            for draw in range(DRAWS):
                seen = values[truth] + sd * rng.standard_normal(len(sd))
                low, high = interval(known.targets, likely(values[:many], seen, sd))[:, 0]
                widths[k, made_rig, draw] = high - low
                held[k, made_rig, draw] = low <= target <= high
    best = CANDIDATES.index(first)
    others = np.median(np.delete(widths, best, axis=0), axis=0)
    assert ((widths[best] < others) & (held[best] > 0.0)).mean() >= 5 / 6
    # Draws and measurements of one rig hold its truth or miss it together.
    deviation = sqrt(0.9 * 0.1 / MADE)
    assert held.mean() == pytest.approx(0.9, abs=2.0 * deviation)
    assert first.name in repr(report(known, len(given), 0, held_currents(SCENE)))
