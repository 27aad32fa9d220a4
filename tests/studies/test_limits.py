"""What is achievable: against the firmware, a grid, closed forms, an independent solver, itself."""

import csv
import json
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import cosim
from cosim.arrays import Array
from cosim.cli.main import main
from cosim.drive.command import command
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import inputs
from cosim.evaluate.store import Store
from cosim.files.picture import Picture
from cosim.scene import Scene, changed, load
from cosim.search.turns import TURN, turned
from cosim.studies.limits import figures, judge, report, runs, search, study
from cosim.studies.limits.answer import BY_NAME, differences, gain_on, gains, noise, sentences
from cosim.studies.limits.changes import AS_IT_IS, CHANGES, FREE, STEPS, Machine
from cosim.studies.limits.judge import Key, Point
from cosim.studies.limits.report import STORE
from cosim.studies.limits.runs import GOALS, NEEDED, Bench
from cosim.studies.limits.search import KINDS, Effort, searched
from cosim.studies.limits.study import Efforts, Rig, Study
from tests.studies.test_figures import assert_legible

NAMED = {change.name: change for change in CHANGES}
FEW = Effort(16, 6, 3)


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short runs."""
    for module, settle, span in ((runs, 0.05, 0.1), (judge, 0.1, 0.2)):
        monkeypatch.setattr(module, "SETTLE", settle)
        monkeypatch.setattr(module, "SPAN", span)
    monkeypatch.setattr(judge, "SHORT", 0.05)


def bench(scene: str = "reference", /, **rig: Any) -> Bench:
    base = Bench.base(load(scene), rig, "test")
    return Bench(base, Evaluator(base, kept=NEEDED, workers=2))


def test_the_cube_is_what_the_potentiometers_set() -> None:
    """Each is read in 1024 steps, 0 to 1023."""
    for steps in ([0, 0, 0], [1023, 1023, 1023], [307, 716, 921]):
        pots = dict(zip(("pot_max", "pot_frequency", "pot_offset"), steps, strict=True))
        drive = load("reference", {f"drive.{name}": n / 1024 for name, n in pots.items()}).drive
        there = Machine().at(np.array(steps) / 1023, 0.1, 0.1)
        for key in ("amplitude", "frequency", "offset"):
            assert there[f"drive.{key}"] == pytest.approx(getattr(drive, key), abs=1e-6)


def test_every_setting_of_the_knobs_can_be_quantised() -> None:
    """Volts with six digits put no knob that is at its end outside what the DAC gives."""
    base = changed(load("reference"), FREE, "test")
    for step in range(0, STEPS + 1, 3):
        for end in (0.0, 1.0):
            volts = Machine().at(np.array([step / STEPS, 0.5, end]), 0.1, 0.1)
            assert changed(base, {**volts, "drive.quantised": True}, "test").drive.quantised


def test_whole_periods_are_run() -> None:
    for change in CHANGES:
        machine = change.machine(load("paper"))
        scene = changed(
            load("paper"), FREE | machine.at(np.full(machine.keys, 0.37), 0.3, 0.4), "test"
        )
        periods = (scene.run.duration - scene.run.settle) / scene.period
        assert periods == pytest.approx(round(periods), abs=1e-6), change.name
        assert scene.run.settle >= 0.3 and scene.run.duration - scene.run.settle >= 0.3
        # Motion of several periods is not broken.
        assert round(periods) < 5 or round(periods) % 6 == 0, change.name


def test_turns() -> None:
    """One knob by 2 % of its turn either way, and all three together; levels stay."""
    every = turned(np.array([0.5, 0.5, 0.99, 0.2]), 3)
    assert every.shape == (1 + 6 + 8, 4) and (every[:, 3] == 0.2).all()
    off = np.abs(every[:, :2] - 0.5)
    assert set(np.round(off.ravel(), 9)) == {0.0, TURN} and every[:, 2].max() == 1.0


def test_a_sense_resistor_leaves_the_current() -> None:
    point = np.array([0.6, 0.8, 0.2])
    made = bench()
    with made.evaluator:
        machines = Machine(), NAMED["sense resistor 2 Ω"].machine(made.scene)
        every = [replace(one, rung="ideal").at(point, 0.1, 0.1) for one in machines]
        own, less = made.evaluator.outcomes(every)
    for name in ("v_average", "current_max"):
        assert less.numbers[name] == pytest.approx(own.numbers[name], rel=1e-5)


def test_a_coil_of_more_turns_has_the_same_force_of_the_same_heat() -> None:
    """Bl²/R and the time constant stay as they are; the output has to give more volts."""
    scene = load("paper")
    coil = changed(scene, NAMED["coil of 1.4 times the turns"].machine(scene).settings, "it").coil
    assert coil.force_factor == pytest.approx(1.4 * scene.coil.force_factor)
    ratios = [one.force_factor**2 / one.resistance for one in (coil, scene.coil)]
    assert ratios[0] == pytest.approx(ratios[1])
    assert coil.inductance / coil.resistance == pytest.approx(
        scene.coil.inductance / scene.coil.resistance
    )


def test_exchanged_wires_are_the_other_command() -> None:
    """A symmetric circuit cannot tell the coil's wires from the command's sign."""
    made = bench()
    with made.evaluator:
        mirrored, falling = made.evaluator.outcomes(
            [
                {**common, "drive.offset": sign * -0.7, **own}
                for sign, own in (
                    (1.0, {"coil.polarity": -1}),
                    (-1.0, {"drive.waveform": "falling-sawtooth", "drive.start_phase": 0.0}),
                )
                for common in [{"drive.amplitude": 5.0, "drive.frequency": 40.0}]
            ]
        )
    assert mirrored.numbers["v_average"] == pytest.approx(falling.numbers["v_average"], rel=1e-6)
    for polarity in (1, -1):
        device = load("reference", {"coil.polarity": polarity})
        exchanged = NAMED["coil's wires exchanged"].machine(device).settings
        assert changed(device, exchanged, "a test").coil.polarity == -polarity


def test_a_square_is_three_of_six_levels_up_and_a_sine_nearly_its_six() -> None:
    scene, point = made_base(), np.array([0.5, 0.4, 0.6])
    for name, apart in (("square wave", 1e-6), ("sine", 0.5)):
        shown = NAMED[name].machine(scene)
        levels = NAMED["six levels, held"].machine(scene)
        more = shown.sampled(scene, levels.levels)
        both = [
            command(changed(scene, machine.at(at, 0.1, 0.1), "a test"))
            for machine, at in ((shown, point), (levels, np.concatenate([point, more])))
        ]
        times = (np.arange(1200) + 0.5) / 1200 * both[0].period
        first, second = (one.values(times) for one in both)
        assert np.abs(first - second).max() <= apart * float(np.ptp(first))


def made_base() -> Scene:
    return Bench.base(load("reference"), {}, "test")


@pytest.mark.slow
@pytest.mark.usefixtures("brief")
def test_search_finds_what_an_exhaustive_grid_finds() -> None:
    grid = np.stack(np.meshgrid(*[np.linspace(0.04, 0.96, 7)] * 3), axis=-1).reshape(-1, 3)
    grid, made, machine = np.round(grid * STEPS) / STEPS, bench(), Machine()
    with made.evaluator:
        found = searched(made, machine, Effort(256, 150, 60), [0])
        assert searched(made, machine, Effort(256, 150, 60), [0]) == found
        for kind, scores in (("best", made.once(machine)), ("robust", made.over_turns(machine))):
            heights, feasible = scores(grid)
            best = np.where(feasible[:, None], heights, -np.inf).max(axis=0)
            for n, goal in enumerate(GOALS):
                mine, allowed = scores(np.array(found[kind][n][:1]))
                assert allowed.all() and mine[0, n] >= 0.95 * best[n], (kind, goal.name)
        points = judge.judged(made, {"": machine}, {"": found}, ("robust",))
    up = points[Key("", "v_up", "robust")]
    assert 0.0 < up.worst <= up.median and up.heat <= machine.heat
    monolithic = pytest.importorskip("tests.reference.monolithic")
    values = {key.split(".")[1]: value for key, value in up.settings.items()}
    duration, settle = values.pop("duration"), values.pop("settle")
    true = monolithic.simulate(
        values, duration, settle, contact="compliant", circuit=values.pop("model")
    )
    assert up.value == pytest.approx(true.v_average, rel=2e-3)


class Hills:
    """Runs of a made machine: a sharp hill, and a broad lower one; above 0.9 nothing is allowed."""

    scene = load("reference")

    def once(self, machine: Machine) -> Any:
        def evaluate(points: Array) -> tuple[Array, Any]:
            sharp, broad = (((points[:, :3] - middle) ** 2).sum(axis=1) for middle in (0.3, 0.7))
            heights = 2.0 * np.exp(-sharp / 2e-4) + np.exp(-broad / 0.1)
            return np.stack([heights] * len(GOALS), axis=1), points[:, 0] < 0.9

        return evaluate

    def over_turns(self, machine: Machine) -> Any:
        once = self.once(machine)

        def evaluate(points: Array) -> tuple[Array, Any]:
            heights = [np.median(once(turned(point, 3))[0], axis=0) for point in points]
            return np.array(heights), points[:, 0] < 0.9

        return evaluate


def test_the_best_and_the_robust_are_told_apart() -> None:
    made: Any = Hills()
    hint = {kind: [[[0.305, 0.3, 0.3]]] * len(GOALS) for kind in ("best", "robust")}
    for seed in range(3):
        found = searched(made, Machine(), Effort(128, 60, 60), [seed], hint)
        for n in range(len(GOALS)):
            np.testing.assert_allclose(found["best"][n][0], 0.3, atol=0.01)
            np.testing.assert_allclose(found["robust"][n][0], 0.7, atol=0.03)


def test_what_helps_another_machine_is_tried() -> None:
    """A hint leads to the sharp hill that few points do not find."""
    made: Any = Hills()
    alone = searched(made, Machine(), FEW, [0])
    hint = {kind: [[[0.305, 0.3, 0.3]]] * len(GOALS) for kind in ("best", "robust")}
    helped = searched(made, Machine(), FEW, [0], None, [hint])
    assert np.abs(np.array(alone["best"][0][0]) - 0.3).max() > 0.1
    np.testing.assert_allclose(helped["best"][0][0], 0.3, atol=0.01)


def test_where_nothing_is_feasible_there_is_no_point() -> None:
    class Nothing(Hills):
        def once(self, machine: Machine) -> Any:
            return lambda points: (
                np.full((len(points), len(GOALS)), -np.inf), np.zeros(len(points), bool),
            )  # fmt: skip

        over_turns = once

    made: Any = Nothing()
    found = searched(made, Machine(), FEW, [0])
    assert found == {kind: [[]] * len(GOALS) for kind in ("best", "robust")}


def test_what_is_not_settled_does_not_stand() -> None:
    """The part creeps in for longer than the run: its last quarter is another one."""
    made, heavy = bench(), {"mechanics.flexure_damping": 0.004, "friction.normal_force": 0.02}
    slow = bench("reference", **heavy)
    place = [[0.5, 0.75, 0.3]]
    candidates = {"": {kind: [place] * len(GOALS) for kind in ("best", "robust")}}
    with made.evaluator, slow.evaluator:
        for one in (made, slow):
            points = judge.judged(one, {"": Machine()}, candidates, ("robust",))
            whole, late = one.evaluator.outcomes(
                [Machine().at(np.array(place[0]), *times) for times in ((1.5, 1.5), (2.25, 0.75))]
            )
            for key, point in points.items():
                values = [runs.scored(x)[judge.NUMBER[key.goal]] for x in (whole, late)]
                assert abs(values[1] / values[0] - 1.0) <= 0.01 and point.value == values[0]


def made_study(
    own: float, changed_: float, other: tuple[float, float], again: dict[int, tuple[float, float]]
) -> Study:
    """What the device as it is and a sine reach on the scene's own rig and on another, and what
    they reached ``again`` on a rig."""

    def points(as_it_is: float, sine: float) -> dict[Key, Point]:
        return {
            Key(name, "v_up", "robust"): Point(value, value, value, 1.0, value, 50.0, [], {})
            for name, value in (("as it is", as_it_is), ("sine", sine))
        }

    rigs = [Rig({}, points(own, changed_)), Rig({}, points(*other))]
    changes = [AS_IT_IS, NAMED["sine"]]
    return Study(load("paper"), changes, rigs, [(k, points(*one)) for k, one in again.items()])


def test_gains_are_paired_on_each_rig() -> None:
    found = made_study(0.02, 0.04, (0.03, 0.033), {0: (0.021, 0.04)})
    (gain,) = gains(found, BY_NAME["v_up"])
    assert gain.every == pytest.approx((1.0, 0.1))
    assert (gain.own, gain.middle) == pytest.approx((1.0, 0.55))
    assert noise(found, BY_NAME["v_up"]) == pytest.approx(0.05) and gain.counts
    more = made_study(0.02, 0.0206, (0.03, 0.03), {0: (0.02, 0.0206), 1: (0.033, 0.03)})
    assert differences(more, BY_NAME["v_up"]) == pytest.approx([0.0, 0.0, 0.1, 0.0])
    assert not gains(more, BY_NAME["v_up"])[0].counts
    assert noise(made_study(0.02, 0.04, (0.03, 0.033), {}), BY_NAME["v_up"]) == 0.0
    assert np.isnan(gain_on(found.rigs[0], AS_IT_IS, BY_NAME["v_down"]))


def words_of(found: Study) -> tuple[str, str]:
    """All words of a study's figures, and of its sentences."""
    goal = BY_NAME["v_up"]
    drawn = [figures.changes(found, goal), figures.settings(found)]
    shown = (text.get_text() for one in drawn for text in one.findobj(Text))  # pyright: ignore
    return " ".join(" ".join(shown).split()), " ".join(sentences(found))


def test_what_is_said_of_the_papers_trials_is_said_of_their_rig_alone() -> None:
    """Another machine was not identified, nor tracked; alone it has no range over rigs."""
    of_paper = made_study(0.02, 0.04, (0.03, 0.033), {})
    shown, said = words_of(of_paper)
    assert "on the identified rig" in shown and "All trials that were measured" in shown
    assert "their range" in shown and "The paper's trials have a rising sawtooth" in said
    scene = load("paper", {"mechanics.surface_mass": 5.0})
    shown, said = words_of(replace(of_paper, scene=scene, rigs=of_paper.rigs[:1]))
    assert not any(word in shown for word in ("identified", "trials", "their range", "cross"))
    assert "paper's trials" not in said


def test_a_title_is_what_the_marks_show() -> None:
    def titled(*marks: tuple[float, float]) -> str:
        points = {
            Key("as it is", "v_up", kind): Point(1.0, 1.0, 1.0, 1.0, *mark, [], {})
            for kind, mark in zip(("best", "robust"), marks, strict=False)
        }
        found = Study(load("paper"), [AS_IT_IS], [Rig({}, points)], [])
        assert "no robust gain" in words_of(found)[0]
        nothing = "With the device unchanged no setting was found for a robust mean velocity"
        assert (nothing in words_of(found)[1]) == (not marks)
        return figures.settings(found).get_suptitle()

    assert "does not carry the part fastest" in titled((0.01, 90.0), (-0.02, 50.0))
    assert "carries the part fastest" in titled((0.01, 50.0), (-0.02, 90.0))
    assert titled() == "No setting was found"


def test_what_a_device_has_already_is_no_change() -> None:
    """Else a search by chance would be told as its gain."""
    base = Bench.base(load("paper", {"circuit.supply": 30.0, "coil.polarity": -1}), {}, "test")
    names = [change.name for change in CHANGES if not change.acts(base)]
    assert names == ["as it is", "supply ±30 V"]


@pytest.mark.parametrize(
    "own", ["[drive]\nquantised = true\npot_max = 0.6\npot_offset = 0.3", '[run]\nsolver = "fast"']
)
def test_a_command_repeats_a_run_of_any_scene(own: str, tmp_path: Path) -> None:
    """In a folder with a blank, and with what the study sets aside: the firmware's steps, the
    knobs, the fast solver."""
    file = tmp_path / "my rig" / "a b.toml"
    file.parent.mkdir()
    file.write_text(f'base = "paper-limited"\n{own}\n')
    scene, settings = load(file), Machine().at(np.array([0.5, 0.6, 0.4]), 0.2, 0.2)
    base = Bench.base(scene, {}, "test")
    with Evaluator(base, kept=NEEDED, workers=1) as evaluator:
        (outcome,) = evaluator.outcomes([settings])
    value = outcome.numbers["v_average"]
    smooth = cosim.run("paper-limited", settings | {"run.output_step": 0.01}).summary
    assert value == pytest.approx(smooth["v_average"], rel=1e-9)
    line = runs.command([str(file), *runs.sets({"friction.mu_k": 0.65021})], scene, settings)
    repeats({"command": line, "goal": "v_up", "value": str(value * 1e3)}, tmp_path)


@pytest.mark.usefixtures("brief")
def test_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables and figures of a small one; a row's command gives the row's value; one that is
    interrupted goes on and leaves the same."""
    drawn: list[Figure] = []
    monkeypatch.setattr(Picture, "write", lambda figure, *where: drawn.append(figure))
    names = ("as it is", "sine", "heat 7 W")
    for name, short in (("SETTLE", 0.05), ("SPAN", 0.1)):
        monkeypatch.setattr(judge, name, short)
    monkeypatch.setattr(search, "KEPT", 1)
    monkeypatch.setattr(search, "BEST", 1)
    monkeypatch.setattr(report, "CHANGES", [NAMED[name] for name in names])
    monkeypatch.setattr(
        report, "FULL", Efforts((FEW, Effort(0, 3, 2), Effort(0, 0, 0)), (FEW, FEW), 1)
    )
    scene = load("reference", {"run.duration": 0.2, "mechanics.part_mass": 0.01})
    rigs = tmp_path / "rigs.json"
    rigs.write_text('{"ensemble": [{}, {"mechanics.surface_mass": 0.02}]}')
    steps: list[tuple[int, int]] = []

    def study_in(folder: Path, most: float = np.inf) -> Any:
        def told(done: int, total: int, what: str) -> None:
            steps.append((done, total))
            if done > most:
                raise KeyboardInterrupt

        return cosim.limits(scene, rigs=rigs, out=folder, workers=2, progress=told)

    with pytest.raises(KeyboardInterrupt):
        study_in(tmp_path, 3)
    with Store(tmp_path / STORE, inputs(scene), *ASKED) as store:
        assert store.resumed == 4
    steps.clear()
    said = study_in(tmp_path)
    study_in(tmp_path / "at once")
    assert steps == [(k, len(steps) // 2) for k in range(1, len(steps) // 2 + 1)] * 2
    assert "the data sheet of the paper's actuator" in repr(said)
    assert "By an estimate the winding warms by" in repr(said)
    assert not (tmp_path / STORE).exists()
    text = (tmp_path / "limits.csv").read_text(encoding="utf-8")
    assert text == (tmp_path / "at once" / "limits.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert {row["change"] for row in rows} <= set(names) and {row["rig"] for row in rows} == {
        "0", "1",
    }  # fmt: skip
    for row in (rows[0], rows[-1]):
        repeats(row, tmp_path)
    as_it_is = [row for row in rows if row["change"] == "as it is"]
    assert all(float(row["heat of a coil [W]"]) < 3.53 for row in as_it_is)
    assert len(drawn) == 3 + 3 + 2  # and those of the two commands
    for figure in drawn[:3]:
        assert_legible(figure)


def test_the_turns_of_what_is_robust_elsewhere_are_run() -> None:
    """Though by single runs a dozen points are better here, whose medians are nothing."""

    def scored(points: Array, near: float, far: float) -> tuple[Array, Any]:
        found = np.where(points[:, :1] < 0.5, near - points[:, :1], far)
        return np.tile(found, len(GOALS)), np.ones(len(points), bool)

    made: Any = SimpleNamespace(
        once=lambda machine: lambda points: scored(points, 10.0, 5.0),
        over_turns=lambda machine: lambda points: scored(points, 1.0, 4.0),
    )
    many = [[0.03 * k, 0.5, 0.5] for k in range(14)]
    own = {kind: [many] * len(GOALS) for kind in KINDS}
    other = {kind: [[[0.8, 0.5, 0.5]]] * len(GOALS) for kind in KINDS}
    found = searched(made, Machine(), Effort(0, 0, 0), [0], own, [other])
    assert all(points[0][0] < 0.5 for points in found["best"])
    assert all(points[0][0] == pytest.approx(0.8, abs=1e-3) for points in found["robust"])


def test_what_is_not_searched_is_tried_at_the_robust_setting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Against the device as it is on the same circuit: alone each has the same median."""
    monkeypatch.setattr(judge, "SHORT", 0.02)
    monkeypatch.setattr(judge, "SPAN", 0.03)
    made, place, slow = bench(), [0.6, 0.8, 0.2], "op-amp of a hundredth the slew rate"
    own = {
        Key("as it is", "v_up", kind): Point(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, place, {})
        for kind in ("best", "robust")
    }
    machines = {name: NAMED[name].machine(made.scene) for name in ("as it is", slow)}
    with made.evaluator:
        found = judge.tried(made, machines, [slow], own)
        every = [machines[slow].at(one, 0.02, 0.03) for one in turned(np.array(place), 3)]
        alone = made.evaluator.outcomes(
            [{key: x for key, x in one.items() if key != "circuit.slew_rate"} for one in every]
        )
    (point,) = found.values()
    assert [*found] == [(slow, "v_up", "robust")] and point.median != point.against
    assert point.against == np.median([one.numbers["v_average"] for one in alone])


ASKED = ([{"mechanics.surface_mass": 0.02}], 0, False, 1.0)


def repeats(row: dict[str, str], folder: Path) -> None:
    """Run a row's command and compare its summary with the row."""
    words = shlex.split(row["command"])[1:]
    assert main([*words, "--out", str(folder / "again")]) == 0
    summary = json.loads((folder / "again" / "summary.json").read_text())
    goal = BY_NAME[row["goal"]]
    assert goal.of(summary) * goal.scale == pytest.approx(float(row["value"]), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["held"], 'scene held: circuit.model = "none" has no limits to change'),
        (["square"], 'scene square: drive.waveform = "square" has no knobs'),
        (["paper", "--rigs", "rigs.json"], "rigs.json: cannot be read"),
        (["paper", "--effort", "nan"], "--effort nan: must be from 0.01 to 100"),
        (["paper", "--seed", "-1"], "--seed -1: must be a whole number from 0"),
    ],
)
def test_bad_input(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["chart", "limits", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not out.exists()


SHARES = (0.7, 1.1, 1.3, 1.01)


def test_ensemble(tmp_path: Path) -> None:
    path, scene = tmp_path / "rigs.json", load("paper")
    mass, force = scene.mechanics.surface_mass, scene.friction.normal_force
    rigs = [{"cost": n, "mechanics.surface_mass": share * mass} for n, share in enumerate(SHARES)]
    rigs[3] |= {"normal_force_ratio": 0.8, "mechanics.suspension": "knee"}
    path.write_text(json.dumps({"ensemble": rigs, "seed": 0}))
    found = study.ensemble(path, scene)
    shares = [float(rig["mechanics.surface_mass"]) / mass for rig in found]
    assert shares == pytest.approx([0.7, 1.3, 1.01]), "the second is the scene's own"
    assert [rig.get("friction.normal_force") for rig in found] == [None, None, 0.8 * force]
    for entry, told in (
        ('"mechanics.surface_mass": -1', "surface_mass = -1 must be a number from"),
        (f'"mechanics.surface_mass": 1{"0" * 400}', "must be a number from"),
        ('"mechanics": {"surface_mass": 1}', 'must have keys "table.key", in quotes'),
        ('"surface_mass": 1', 'must have keys "table.key", in quotes'),
        ('"drive.waveform": "sine"', "drive.waveform is no key of a rig"),
        ('"circuit.model": "none"', "circuit.model is no key of a rig"),
        ('"name.x": 1', "name.x is no key of a rig"),
        ('"friction.mu_k": 0.3, "normal_force_ratio": "x"', 'ratio = "x" must be a number above 0'),
        (f'"friction.mu_k": 0.3, "normal_force_ratio": 1{"0" * 400}', "and at most 1e+06"),
    ):
        path.write_text(f'{{"ensemble": [{{}}, {{{entry}}}]}}')
        with pytest.raises(BadInput) as caught:
            study.ensemble(path, scene)
        assert f"{path}, ensemble 2: " in str(caught.value) and told in str(caught.value)
    for text in ("[]", "{}", '{"ensemble": [1]}'):
        path.write_text(text)
        with pytest.raises(BadInput, match="has no list"):
            study.ensemble(path, scene)
    for name, text in (
        ("rigs.json", "{"),
        ("rigs.json", "[" * 100_000),
        ("rigs.toml", "a = " + "[" * 100_000),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(BadInput, match="neither JSON"):
            study.ensemble(tmp_path / name, scene)
