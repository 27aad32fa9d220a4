"""Tuning: against the theory's optimum, a grid, and what must not matter."""

import csv
import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.errors import BadInput, Note, SimulationFailed
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Outcome, in_whole_periods
from cosim.scene import changed, load
from cosim.scene.firmware import knobs
from cosim.simulation.simulate import simulate
from cosim.studies.tune.found import Run, write_runs
from cosim.studies.tune.run import tune


def test_theory_s_optimum() -> None:
    """At A = 10, mu 0.7 and 0.6: v/(g T) = 0.3356265876 at f_n = 6.7083044169 (closed form)."""
    scene = load("optimal", ["friction.mu_s=0.7", "friction.mu_k=0.6"])
    weight = scene.mechanics.part_mass * scene.mechanics.gravity
    over = {"friction.normal_force": (0.5 * weight, 13.0 * weight)}
    found = tune(scene, maximise="v_average", over=over, budget=80, workers=2)
    assert found.best.value is not None
    reached = found.best.value * scene.drive.frequency / scene.mechanics.gravity
    assert 0.3356265876 * (1 - 2e-4) < reached < 0.3356265876 * (1 + 1e-9)
    ratio = found.best.values["friction.normal_force"] / weight
    assert ratio == pytest.approx(6.7083044169, rel=0.03)  # flat, so less sharp
    assert 0.0 < (found.lost or 0.0) < 0.05


def test_same_for_any_number_of_workers() -> None:
    scene = load("reference", ["circuit.model=ideal", "run.duration=0.2", "run.settle=0.1"])
    over = {"drive.offset": (-2.0, 0.0), "mechanics.n_surfaces": (1.0, 3.0)}
    first, second = (
        tune(scene, minimise="v_average", over=over, budget=60, seed=4, workers=n) for n in (1, 2)
    )
    assert first == second
    assert first.best.value is not None
    searched = [run.value for run in first.runs[:-4]]  # the last round turns two keys
    assert first.best.value <= min(value for value in searched if value is not None)
    assert all(isinstance(run.values["mechanics.n_surfaces"], int) for run in first.runs)
    assert first != tune(scene, minimise="v_average", over=over, budget=60, seed=5, workers=2)


def test_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """best.toml makes the run that was found; every run stands in the table."""
    arguments = ["tune", "ideal-current", "--maximise", "v_average", "--budget", "40"]
    over = ["--over", "drive.pot_frequency=0.6:0.9", "--set", "run.duration=0.2"]
    assert main([*arguments, *over, "--workers", "2", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    numbers = json.loads((tmp_path / "tune.json").read_text(encoding="utf-8"))
    assert (
        "turning one key by 2 % of its range" in said or "budget ended" in said
    ) and " Hz)" in said
    best: Any = simulate(load(tmp_path / "best.toml")).summary
    assert best["v_average"] == pytest.approx(numbers["value"], rel=1e-6)
    with open(tmp_path / "tune.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == numbers["runs"] <= 40
    assert numbers["value"] in [float(row["v_average [m/s]"]) for row in rows]
    best_seen = max(float(row["v_average [m/s]"]) for row in rows)
    assert best_seen == numbers["value"]
    assert {path.name for path in tmp_path.iterdir()} == {
        "tune.json", "tune.csv", "best.toml", "figure.png",
    }  # fmt: skip


def test_all_runs_fail() -> None:
    with pytest.raises(SimulationFailed, match=r"the first one: --over: friction\.mu_k = 0\.[89]"):
        tune(
            load("held"),
            maximise="v_average",
            over={"friction.mu_k": (0.8, 0.9)},
            budget=30,
            workers=2,
        )


STILL = ["--set", "circuit.model=none"]
BAD = [
    (["--maximise", "speed"], "speed is not a number of this scene's summary"),
    (["--maximise", "v_averge"], "v_averge is not a number of this scene's summary; did you mean"),
    (["--maximise", "v_average", "--budget", "20"], "--budget 20"),
    (["--maximise", "v_average", "--waveform=sine,pieces:6", "--budget=9"], "from 38, for"),
    (["--maximise", "v_average", "--budget", "3.5"], "must be a whole number, not '3.5'"),
    (["--maxmise", "v_average"], "--maxmise v_average; did you mean --maximise? (see cosim"),
    (["--maximise", "v_average", "--robst"], "--robst; did you mean --robust? (see cosim tune"),
    (["--maximise", "v_average", "--over", "drive.offset"], "table.key=low:high"),
    (["--maximise", "v_average", "--over", "drive.offset=1:0"], "LOW below HIGH, each a number"),
    (["--maximise", "v_average", "--over", "drive.offset=0:1e9"], "from -100 to 100 V"),
    (["--maximise", "v_average", "--over", "circuit.model=0:1"], "not a number"),
    (["--maximise", "v_average", "--minimise", "v_average"], "either maximise or minimise"),
    (["--maximise", "v_average", *STILL, "--set", "drive.waveform=quaid"], '"quaid" has no knobs'),
    (["--maximise", "v_average", *STILL], 'circuit.model = "none" has no knobs'),
    ([], "either maximise or minimise"),
    (["--maximise", "v_average", "--workers", "0"], "--workers 0"),
    (["--maximise", "v_average", "--seed", "-1"], "--seed -1"),
]


def test_knobs_that_no_port_reads_are_refused() -> None:
    """They were turned 30 times, and told as the best."""
    with pytest.raises(BadInput, match=r'^scene dc-motor: .* from = "drive" it has no knobs; '):
        tune("dc-motor", maximise="gear.speed.mean", budget=30)


@pytest.mark.parametrize(("arguments", "words"), BAD)
def test_bad_input(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    quick = ["--set", "run.duration=0.02"]
    assert main(["tune", "ideal-current", *quick, *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1 and not out.exists()


def test_a_number_of_the_machine_is_refused_where_there_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Before anything runs."""
    monkeypatch.setattr(Evaluator, "_run", lambda *_: pytest.fail("it ran"))
    over = {"circuit.param.r": (1.0, 2.0)}
    with pytest.raises(BadInput, match=r"^scene relay: v_average is not .* has NAME\.mean, "):
        tune("relay", maximise="v_average", over=over)


@pytest.mark.parametrize(
    "given", [{"budget": 26.5}, {"budget": 30.0}, {"budget": "30"}, {"workers": 1.5}]
)
def test_counts_are_whole(given: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match=rf"--{next(iter(given))} .*: must be a whole number from"):
        tune("ideal-current", ["run.duration=0.02"], maximise="v_average", **given)


def test_keys_twice() -> None:
    with pytest.raises(BadInput, match="twice"):
        from cosim.studies.tune.found import ranges_of

        ranges_of(["drive.offset=0:1", "drive.offset=0:2"])


@pytest.mark.slow
def test_scouts_without_ngspice() -> None:
    """They go ahead where the scene needs ngspice, are counted apart, and lead on."""
    quick = ["run.duration=0.3", "run.settle=0.1", "circuit.max_step=5e-5"]
    ahead: list[float | None] = []
    scene = load("reference", quick)
    found = tune(
        scene,
        maximise="v_average",
        budget=40,
        workers=2,
        scouting=lambda run, best: ahead.append(run.value),
    )
    assert found.scouts == len(ahead) > 100 and len(found.runs) <= 40
    assert found.scene.circuit.model == "amplifier"
    best = max(value for value in ahead if value is not None)
    own, first = (run.value for run in found.runs[:2])
    by_itself = simulate(scene).summary["v_average"]
    assert own == pytest.approx(by_itself, rel=0.2)  # by the nearest turns of the knobs
    assert first == pytest.approx(best, rel=0.2)  # the same knobs, run with ngspice


GRID_BEST = 37.598e-3
"""m/s: the fastest of `cosim sweep reference --set circuit.max_step=5e-5` over the three knobs,
each at ten places from 0 to 1, at (8/9, 4/9, 3/9)."""


@pytest.mark.slow
def test_beats_a_grid() -> None:
    """Over the three knobs: better than the best of 1,000 points, with a fifth of the runs."""
    knobs = {"pot_max": 8 / 9, "pot_frequency": 4 / 9, "pot_offset": 3 / 9}
    scene = load("reference", ["circuit.max_step=5e-5"])
    there = changed(scene, {f"drive.{knob}": place for knob, place in knobs.items()}, "test")
    whole = in_whole_periods(there)
    summary: Any = simulate(whole).summary
    assert summary["v_average"] == pytest.approx(GRID_BEST, rel=2e-3)
    found = tune(scene, maximise="v_average", budget=200, workers=2)
    assert len(found.runs) <= 200
    assert found.best.value is not None and found.best.value > GRID_BEST


def test_a_search_that_was_interrupted_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It runs only what it has not heard, and ends with what one that was left alone finds."""
    words = ["tune", "ideal-current", "--maximise=v_average", "--budget=40", "--workers=2"]
    words += ["--over=drive.pot_frequency=0.6:0.9", "--set=run.duration=0.1"]
    calm, wild = tmp_path / "calm", tmp_path / "wild"
    assert main([*words, f"--out={calm}"]) == 0
    ran: list[object] = []
    plain = Evaluator._run

    def counted(self: Evaluator, points: Any) -> Any:
        for found in plain(self, points):
            if len(ran) == 17:
                raise KeyboardInterrupt
            ran.append(found)
            yield found

    with monkeypatch.context() as patch:
        patch.setattr(Evaluator, "_run", counted)
        assert main([*words, f"--out={wild}"]) == 130
        assert {path.name for path in wild.iterdir()} == {"tune.sqlite", "tune.csv"}
    heard: list[object] = []
    monkeypatch.setattr(
        Evaluator,
        "_run",
        lambda self, points: (heard.append(1) or one for one in plain(self, points)),
    )
    assert main([*words, f"--out={wild}"]) == 0
    with open(calm / "tune.csv", encoding="utf-8") as file:
        assert len(heard) + 17 == len(file.readlines()) - 1
    for name in ("tune.csv", "tune.json", "best.toml"):
        assert (wild / name).read_bytes() == (calm / name).read_bytes()
    assert not (wild / "tune.sqlite").exists()


FAST = {"run.solver": "fast", "run.settle": 0.2, "run.duration": 0.4}


def test_waveforms_are_searched_each_by_itself(tmp_path: Path) -> None:
    """Each with the numbers of its shape; the scenes that are left make the same runs, within the
    limit of heat, which binds here."""
    found = tune(
        *("paper-limited", FAST),
        maximise="v_average",
        waveform=["steps:3", "square"],
        polarity=True,
        heat=1.5,
        budget=60,
        seed=3,  # of 0 and 2 the best is chaotic: other rows, another mean
        workers=2,
        out=tmp_path,
    )
    other = found.others[0]
    assert {found.waveform, other.waveform} == {"steps:3", "square"}
    assert (found.best.value or 0.0) >= (other.best.value or 0.0) > 0.0
    for one, file in (
        (found, "best.toml"),
        (other, f"best-{other.waveform.replace(':', '-')}.toml"),
    ):
        shape = [f"drive.table.{k}" for k in (1, 2, 3)]
        shape = ["drive.duty"] if one.waveform == "square" else shape
        knobs = ["drive.pot_max", "drive.pot_frequency", "drive.pot_offset", "coil.polarity"]
        assert list(one.best.values) == [*knobs, *shape]
        assert one.best.values["coil.polarity"] in (-1, 1)
        played: Any = simulate(load(tmp_path / file)).summary
        assert played["v_average"] == pytest.approx(one.best.value, rel=1e-6)
        assert played["coil_heat"] < 1.5
    for run in (*found.runs, *other.runs):
        hot = run.outcome.numbers["coil_heat"] > 1.5
        assert (run.value is None) == hot == ("the heat of" in run.outcome.failure)
    told = json.loads((tmp_path / "tune.json").read_text(encoding="utf-8"))
    assert told["waveforms"][other.waveform]["value"] == other.best.value
    assert not list(tmp_path.glob("*.sqlite*"))


def test_a_number_that_no_setting_has_is_refused(tmp_path: Path) -> None:
    """A rigid wall stops the ram at once: the peak of the surface's acceleration is unbounded."""
    few = {"mechanics.contact": "rigid", "run.duration": 0.1}
    with pytest.raises(BadInput, match="a_surface_max has no value at any setting"):
        over = {"drive.amplitude": (4.0, 8.0)}
        tune("paper-limited", few, maximise="a_surface_max", over=over, budget=24, out=tmp_path)
    assert not any(tmp_path.iterdir())


def test_a_waveform_without_a_setting_costs_only_itself(tmp_path: Path) -> None:
    """Square waves of these volts make more heat than may be."""
    few = {**FAST, "run.settle": 0.05, "run.duration": 0.1}
    given: dict[str, Any] = {"heat": 3.0, "budget": 24, "workers": 1, "out": tmp_path}
    old = ("best-square.toml", "best-falling-sawtooth.toml", "best-steps-6.toml")
    for name in (*old, "best-mine.toml"):  # of an earlier search, and the user's
        (tmp_path / name).touch()
    over = {"drive.offset": (-1.0, 1.0)}
    with pytest.warns(Note, match="square: No setting could be run; .*above --heat, 3 W"):
        found = tune(
            *("paper-limited", few), maximise="v_average", over=over,
            waveform=["square", "sine"], **given,
        )  # fmt: skip
    assert found.waveform == "sine" and not found.others
    assert {path.name for path in tmp_path.glob("best*")} == {"best.toml", "best-mine.toml"}
    unturned: Any = replace(found, neighbours={}).plot().axes[1]
    assert "budget ended" in unturned.get_title("left") and unturned.get_xlim()[0] < 0.0


def test_runs_of_all_waveforms_are_written(tmp_path: Path) -> None:
    runs = [
        Run({"drive.offset": 1.0, "drive.duty": 0.3}, Outcome({}), 1.0),
        Run({"drive.offset": 2.0, "drive.table.1": 0.1}, Outcome({}, "hot"), None),
    ]
    write_runs(tmp_path / "tune.csv", runs, "v_average")
    with (tmp_path / "tune.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert (first["drive.duty [1]"], first["drive.table.1 [1]"]) == ("0.3", "")
    assert (first["v_average [m/s]"], second["v_average [m/s]"]) == ("1.0", "")
    assert (second["drive.duty [1]"], second["drive.table.1 [1]"]) == ("", "0.1")


def test_the_least_robustly_is_a_median_too() -> None:
    few = {**FAST, "run.settle": 0.1, "run.duration": 0.2}
    over = {"drive.offset": (-1.0, 1.0)}
    found = tune(
        *("paper-limited", few), minimise="coil_heat", over=over, robust=True, budget=24, workers=1
    )
    place, heats = found.best.values["drive.offset"], []
    for turn in (0.0, 0.04, -0.04):
        there = changed(found.scene, {"drive.offset": min(max(place + turn, -1.0), 1.0)}, "it")
        heats.append(simulate(there).summary["coil_heat"])
    assert found.value == pytest.approx(np.median(heats), rel=1e-3) and found.value < max(heats)


def test_robust_is_the_median_of_all_turns() -> None:
    """Of the three knobs by 2 %, one by one and together: here turned once more, by hand."""
    scene = load("paper-limited", {**FAST, "run.settle": 0.1, "run.duration": 0.2})
    found = tune(scene, maximise="v_average", robust=True, budget=30, workers=2)
    judged = changed(scene, {"run.solver": "fmu"}, "")
    place, every = list(found.best.values.values()), []
    for turn in [(0, 0, 0), *product((-1, 1), repeat=3), *(-np.eye(3)), *np.eye(3)]:
        turned = np.clip(place + 0.02 * np.array(turn), 0.0, 1.0)
        there = changed(judged, dict(zip(found.best.values, turned.tolist(), strict=True)), "")
        summary: Any = simulate(in_whole_periods(there)).summary
        every.append(summary["v_average"])
    assert min(every) > 0.0
    assert found.best.value == pytest.approx(np.median(every), rel=1e-6)


def test_the_scenes_own_setting_is_run_too() -> None:
    """By the nearest turns of the knobs, or as it is: with few runs the result was worse."""
    scene = load("paper-limited", {"run.settle": 0.1, "run.duration": 0.3})
    found = tune(scene, maximise="v_average", budget=26, workers=1)
    own = {f"drive.{knob}": turn for knob, turn in knobs(6.58, 20.78, -0.783).items()}
    assert found.runs[0].values == pytest.approx(own)
    tuned = found.runs[0].outcome.numbers["v_average"]
    alone = simulate(in_whole_periods(changed(scene, own, "it"))).summary["v_average"]
    assert found.value >= tuned == pytest.approx(alone)
    ranges = {"drive.offset": (-1.0, 1.0), "friction.mu_k": (0.1, 0.2)}
    made = tune(scene, minimise="coil_heat", over=ranges, budget=24, workers=1)
    assert made.runs[0].values["drive.offset"] != pytest.approx(-0.783)  # mu_k is beyond its range


def test_a_best_value_that_reads_the_start_is_told() -> None:
    """As a run of these settings tells it: short runs reward a start that lifts the part."""
    short = {"run.settle": 0.05, "run.duration": 0.2}
    over = {"drive.frequency": (18.0, 22.0)}
    found = tune("paper-limited", short, maximise="v_average", over=over, budget=24, workers=1)
    later = in_whole_periods(found.scene.having(run={"settle": 4.0, "duration": 6.0}))
    z = simulate(later).waveforms.z_part.sel(time=slice(later.run.settle, None))
    settled = 1e3 * float((z[-1] - z[0]) / (z.time[-1] - z.time[0]))  # mm/s
    told = repr(found).partition("reads the start; later it is ")[2]
    assert float(told.split()[0]) == pytest.approx(settled, rel=3e-3)
    assert abs(1e3 * found.value - settled) > 0.005 * settled


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--waveform", "triangle"], "must be one of sawtooth, falling-sawtooth, sine, square"),
        (["--waveform", "steps:65"], "N from 2 to 64"),
        (["--waveform", "pieces"], "pieces:N with N from 2"),
        (["--waveform", "steps:" + "9" * 5000], "N from 2 to 64"),
        (["--waveform", "sine,"], "--waveform : must be one of"),
        (["--heat", "0"], "must be a number above 0 W"),
        (
            ["--heat", "60:2"],
            "--heat 60:2: a limit of heat needs a rise above 0 K, a duty from 0 to 1",
        ),
        (["--heat", "60:0.3:1:1"], "K:DUTY:SECONDS"),
        (["--heat", "warm"], "--heat warm: must be a number above 0 W"),
    ],
)
def test_waveforms_and_heats_that_are_none(
    words: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert (
        main(["tune", "ideal-current", "--maximise", "v_average", *words, "--out", str(out)]) == 2
    )
    said = capsys.readouterr().err
    assert why in said and said.count("\n") == 1 and not out.exists()


def test_a_scene_with_ports_is_tuned() -> None:
    """By the numbers of its own waveforms, whose units the summary does not have."""
    found = tune(
        "dc-motor",
        {"run.duration": 2e-3},
        over={"circuit.param.supply": (10.0, 20.0)},
        maximise="gear.speed.greatest",
        budget=22,
    )
    assert found.best.values["circuit.param.supply"] > 19.0
    assert "gear.speed.greatest = " in repr(found)
