"""`cosim run --spread`: what a small turn of each knob makes of the answer."""

import json
from math import ceil
from pathlib import Path

import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.scene import firmware, load
from cosim.studies.tune.spread import Spread, Turned, turns

SHORT = {"run.duration": 0.3, "run.settle": 0.15}


def alone(name: str, keys: dict[str, float]) -> float:
    """v_average by a run of its own, which settles and lasts for whole periods, 0.15 s at least."""
    count = ceil(0.15 * keys["drive.frequency"])
    times = {"run.settle": count, "run.duration": 2 * count}
    lasting = {key: n / keys["drive.frequency"] for key, n in times.items()}
    return cosim.run(name, {**keys, **lasting, "run.output_step": 1e-3}).summary["v_average"]


def named(settings: dict[str, float]) -> str:
    return ", ".join(f"{key} = {value:.6g}" for key, value in settings.items())


def test_the_ends_are_those_of_runs_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """At 20.6 Hz the rig changes its motion within a turn of the frequency."""
    keys = SHORT | {"drive.frequency": 20.6}
    sets = [f"--set={key}={value}" for key, value in keys.items()]
    assert main(["run", "reference", *sets, "--spread", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["spread"]

    own = {"drive.amplitude": 8.0, "drive.frequency": 20.6, "drive.offset": -1.2}
    expected = {"": alone("reference", own)}
    for key, value in own.items():
        for place in (0.98 * value, 1.02 * value):
            expected[f"{key} = {place:.6g}"] = alone("reference", own | {key: place})
    found = {named(run["settings"]): run for run in told["runs"]}
    assert found.keys() == expected.keys()
    for place, run in found.items():
        # The ends are of the scene's own circuit, the others within run.tolerance of it.
        close = 1e-4 if run["circuit_model"] == "amplifier" else 1e-2
        assert run["v_average"] == pytest.approx(expected[place], rel=close), run["failure"]
    for end, pick in (("min", min), ("max", max)):
        place = pick(expected, key=expected.__getitem__)
        assert told[f"v_average_{end}"] == pytest.approx(expected[place], rel=1e-4)
        assert named(told[f"at_{end}"]) == place and f"{place} Hz\n" in printed
        assert f"{told[f'v_average_{end}'] * 1e3:+.3f}" in printed
    assert told["v_average_max"] > 1.3 * told["v_average_min"]


def test_turns_are_what_cosim_run_has_there() -> None:
    """Of motion that has not settled, over the same time: half a period later it is another."""
    keys = {"drive.frequency": 20.78, "run.duration": 0.6, "friction.mu_plate": 0.0}
    found = cosim.spread("paper-limited", keys | {"mechanics.n_surfaces": 2})
    for turned in found.runs:
        own = cosim.run("paper-limited", keys | {"mechanics.n_surfaces": 2} | turned.settings)
        assert turned.v_average == pytest.approx(own.summary["v_average"], rel=1e-6)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (1e-3, 2e-3, ("slowest at", "fastest at")),
        (-2e-3, -1e-3, ("fastest at", "slowest at")),
        (-2e-3, 1e-3, ("fastest down at", "fastest up at")),
    ],
)
def test_what_is_fast_is_so_either_way(low: float, high: float, words: tuple[str, str]) -> None:
    runs = [Turned({"drive.offset": value}, "limited", value) for value in (high, low)]
    printed = repr(Spread(runs)).splitlines()[1:]
    for line, word, value in zip(printed, words, (low, high), strict=True):
        assert line.split("drive.offset")[0].strip() == word and f" = {value:g} V" in line


def test_where_the_cheap_circuit_is_wrong_all_is_run_on_the_scenes_own():
    """The rung "limited" has no slew rate, which here takes a millisecond from each reset."""
    keys = {"circuit.slew_rate": 1e4, "run.duration": 0.2, "run.settle": 0.1}
    found = cosim.spread("reference", keys)
    assert {run.circuit_model for run in found.runs} == {"amplifier"}
    own = cosim.run("reference", keys).summary["v_average"]
    assert found.runs[0].v_average == pytest.approx(own, rel=1e-4)
    simple = cosim.run("reference", {**SHORT, "circuit.model": "limited"}).summary["v_average"]
    assert simple != pytest.approx(own, rel=0.05)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        # Of the values, as the scene gives them; an offset of 0 has no share.
        (
            {"drive.amplitude": 6.0, "drive.frequency": 50.0, "drive.offset": 0.0},
            [("amplitude", 5.88), ("amplitude", 6.12), ("frequency", 49.0), ("frequency", 51.0),
             ("offset", -0.12), ("offset", 0.12)],
        ),
        # Of the whole turn, and no farther than the knob goes.
        (
            {"drive.pot_max": 1.0, "drive.pot_frequency": 0.0, "drive.pot_offset": 0.995},
            [("pot_max", 0.98), ("pot_frequency", 0.02), ("pot_offset", 0.975)],
        ),
        (
            {"drive.amplitude": 0.0, "drive.offset": 0.0, "drive.pot_frequency": 0.5},
            [("pot_frequency", 0.48), ("pot_frequency", 0.52)],
        ),
    ],
)  # fmt: skip
def test_turns(keys: dict[str, float], expected: list[tuple[str, float]]):
    found = turns(load("reference", keys))
    assert found == [{f"drive.{name}": value} for name, value in expected]


def test_a_setting_that_cannot_be_is_told_and_costs_only_itself():
    reach = firmware.GAIN * firmware.V_REFERENCE
    keys = {"drive.quantised": True, "drive.amplitude": 10.4, "drive.offset": 0.0}
    found = cosim.spread("reference", keys | {"circuit.model": "ideal", "run.duration": 0.1})
    (failed,) = (run for run in found.runs if run.failure)
    assert failed.settings == {"drive.amplitude": 10.608} and failed.v_average is None
    assert f"10.608 V must be a number from 0 to {reach:.4g} V" in failed.failure
    assert failed.failure in repr(found) and len(found.runs) == 7


@pytest.mark.reliability
@pytest.mark.parametrize("name", ["held", "optimal"])
def test_a_scene_without_knobs_is_refused_before_it_is_run(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["run", name, "--spread", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == (
        f'cosim: scene {name}: circuit.model = "none" has no knobs that --spread could turn.\n'
    )
    assert not list(tmp_path.iterdir())
    with pytest.raises(BadInput):
        cosim.spread(name)
