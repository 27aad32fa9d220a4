"""The fast solver against the FMU, which finds each event: one table of numbers, one law."""

import ctypes
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import build_c
import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Settings
from cosim.scene import load
from cosim.simulation import fast
from cosim.simulation.simulate import summary
from cosim.stepper.stepper import OWN, RIG, VARIABLES
from cosim.toolchain.libraries import library, structures
from tests.reference.monolithic import simulate as monolithic
from tests.reference.parameters import reference_parameters

FAST = {"run.solver": "fast", "run.average": "ends"}
STILL = {"circuit.model": "limited"}
KNEE = {"mechanics.suspension": "knee", "mechanics.suspension_hardening": 9e5}
KNEE |= {"mechanics.suspension_k1": 120.0}
SCENES: list[tuple[str, dict[str, Any]]] = [
    ("paper-limited", {}),
    ("ideal-current", {}),
    ("trial-05", STILL),  # switched on within the run, lifted
    ("gripper", STILL | {"drive.frequency": 20.0}),  # two surfaces alike
    ("paper-limited", {"drive.waveform": "sine", "drive.frequency": 60.0}),
    ("paper-limited", {"drive.waveform": "falling-sawtooth", "coil.polarity": -1}),
    (
        "paper-limited",
        {"drive.reset_time": 0.03, "drive.start_phase": 0.3, "drive.start_time": 0.01},
    ),
    (
        "paper-limited",
        {
            "drive.waveform": "steps",
            "drive.frequency": 40.0,
            "drive.table": [[0.1, 0.5], [0.35, -0.5], [0.6, 0.1]],
        },
    ),
    ("paper-limited", KNEE),
    (
        "paper-limited",
        {"mechanics.suspension": "repulsion", "mechanics.suspension_distance": 3.5e-3},
    ),
    ("paper-limited", {"coil.count": 2, "circuit.current_limit": 0.9}),
    ("paper-limited", {"mechanics.gravity": 0.0, "friction.mu_plate": 0.0, "run.shutter": 0.5}),
]
PERIODS = {"run.settle": 0.5, "run.duration": 1.5}


def both(name: str, changes: dict[str, Any], step: float) -> tuple[dict[str, Any], dict[str, Any]]:
    own = {} if name.startswith("trial") else PERIODS
    known = summary(load(name, own | changes | {"run.average": "ends"}))
    return known, summary(load(name, own | changes | FAST | {"run.step": step}))


def test_structures_and_names_agree_with_the_compiled_code() -> None:
    kinds = structures("stepper")
    there = [library("stepper").stepper_sizes(k) for k in range(2)]
    assert [ctypes.sizeof(kinds[name]) for name in ("Kept", "Stretch")] == there
    assert (len(RIG), len(OWN)) == (33, 7)
    known = load("paper-limited")
    assert set(VARIABLES.values()) <= set(fast.known_numbers(known))


@pytest.mark.physics
@pytest.mark.parametrize(("name", "changes"), SCENES)
def test_agrees_with_the_fmu(name: str, changes: dict[str, Any]) -> None:
    """All numbers that both give, in steps that are short for the friction and the walls."""
    exact, found = both(name, changes, 1e-5)
    assert abs(found["v_average"] - exact["v_average"]) < 0.01 * max(abs(exact["v_average"]), 1e-3)
    for key, within in (
        *((f"energy_{of}", 0.01) for of in ("in", "copper", "friction", "impact", "damping")),
        *((f"v_surface_{end}", 0.005) for end in ("max", "min")),
        *((f"current_{end}", 0.002) for end in ("max", "min")),
        *((f"a_camera_{end}", 0.02) for end in ("max", "min")),
        *(("z_surface_pp", 0.005), ("stick_fraction", 0.02)),
    ):
        assert found[key] == pytest.approx(exact[key], rel=within, abs=1e-6), key
    for key in ("saturated_fraction", "current_limit_fraction", "swing_low_fraction"):
        if key in exact:
            assert found[key] == pytest.approx(exact[key], abs=2e-3), key
    assert not {"a_surface_max", "impacts", "stick_slip_events"} & set(found), "not known"


@pytest.mark.physics
def test_shorter_steps_err_less() -> None:
    """And so it is told."""
    exact = summary(load("paper-limited", PERIODS))["v_average"]
    errors = []
    for step in (2e-4, 5e-5, 1e-5):
        result = cosim.run("paper-limited", PERIODS | FAST | {"run.step": step})
        errors.append(abs(result.summary["v_average"] - exact))
        told = result.summary["v_average_error"]
        assert 0.1 * errors[-1] < told + 1e-6 and told < 3.0 * errors[-1] + 1e-4
    assert errors[2] < errors[1] < errors[0]


@pytest.mark.physics
def test_the_told_error_is_that_against_the_monolithic_reference() -> None:
    """Half the step comes to the same wrong motion: it told 2 of 115 um/s."""
    drive = {"frequency": 20.282786282665093, "amplitude": 10.124929511702188}
    drive |= {"offset": -1.9758761285733644}
    scene = load(
        "reference",
        {f"drive.{name}": value for name, value in drive.items()}
        | {"circuit.model": "ideal", "run.settle": 6 / drive["frequency"]}
        | {"run.duration": 12 / drive["frequency"]}
        | FAST,
    )
    times = reference_parameters(scene), scene.run.duration, scene.run.settle
    true = monolithic(*times, circuit="ideal").v_average
    told = cosim.run(scene).summary
    off = abs(told["v_average"] - true)
    assert told["v_average_error"] == pytest.approx(off, abs=1e-6 * abs(true))


@pytest.mark.physics
def test_errors_are_of_second_order() -> None:
    """Over settings of the knobs, with impacts and friction on both sides of the part: half the
    step makes a third of the median error, where first order makes half of it."""
    knobs = np.random.default_rng(3).uniform((0.4, 0.1, 0.0), (1.0, 0.95, 0.7), (80, 3))
    names = ("drive.pot_max", "drive.pot_frequency", "drive.pot_offset")
    scenes = [
        load("paper-limited", FAST | dict(zip(names, map(float, places), strict=True)))
        for places in knobs
    ]
    mean = []
    for share in (1.0, 0.5, 0.25):
        stepped = [scene.having(run={"step": share * scene.run.step}) for scene in scenes]
        mean.append(np.array([each["v_average"] for each in fast.summaries(stepped)]))
    exact = np.array(
        [summary(scene.having(run={"solver": "fmu"}))["v_average"] for scene in scenes]
    )
    moved = np.abs(exact) > 1e-3
    errors = [float(np.median(np.abs(v / exact - 1.0)[moved])) for v in mean]
    assert errors[0] < 0.01
    assert errors[1] < errors[0] / 2.5
    assert errors[2] < errors[1] / 2.5


def test_waveforms_are_those_of_the_fmu() -> None:
    """Every column, until the two motions part: here the first period."""
    changes = {"run.duration": 0.04, "run.settle": 0.0}
    exact = cosim.run("paper-limited", changes).waveforms
    found = cosim.run("paper-limited", changes | FAST | {"run.step": 1e-5}).waveforms
    assert list(found) == list(exact)
    for name in exact:
        apart = np.abs(found[name].values - exact[name].values)
        scale = np.ptp(exact[name].values)
        assert np.quantile(apart, 0.97) <= 0.01 * scale, name


def test_rows_beside_a_jump_are_those_of_the_step_that_they_lie_in() -> None:
    """A step that the jump moves past its edge, or before it: the current stays in its range."""
    changes = {"run.duration": 0.5, "run.settle": 0.0, "run.output_step": 1e-5}
    result = cosim.run("paper-limited", changes | FAST)
    current, told = result.columns["current"], result.summary
    assert told["current_min"] - 1e-9 <= current.min()
    assert current.max() <= told["current_max"] + 1e-9


def test_lanes_do_not_know_each_other() -> None:
    """A point has the same numbers alone, and among others of other durations."""
    scene = load("paper-limited", {"run.duration": 1.0, "run.settle": 0.1} | FAST)
    knobs = np.random.default_rng(0).random((11, 3)).tolist()
    names = ("drive.pot_max", "drive.pot_frequency", "drive.pot_offset")
    points: list[Settings] = [dict(zip(names, knob, strict=True)) for knob in knobs]
    with Evaluator(scene, whole_periods=True, workers=2) as bench:
        together = dict(bench.run(enumerate(points)))
    for number, point in enumerate(points):
        with Evaluator(scene, whole_periods=True) as bench:
            ((_, alone),) = bench.run([(number, point)])
        assert alone == together[number]


@pytest.mark.skipif(not Path("/proc/cpuinfo").exists(), reason="Linux tells of its processor")
def test_it_takes_as_many_lanes_as_the_processor_has() -> None:
    """In which a build by another compiler may be wrong without another number."""
    flags = {*re.findall(r"\w+", Path("/proc/cpuinfo").read_text(encoding="utf-8"))}
    wide = 8 if {"avx512f", "avx512dq"} <= flags else 4 if "avx2" in flags else 2
    assert library("stepper").stepper_width() == wide


@pytest.mark.slow
@pytest.mark.parametrize("most", [2, 4])
def test_every_processor_computes_the_same_bits(
    most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many lanes at once as a lesser processor has, against as many as this one has."""
    ours = library("stepper")
    folders, made = build_c.LIBRARIES["stepper"], tmp_path / "stepper.so"
    sources = [path for folder in folders for path in folder.glob("*.c")]
    paths = (f"-I{folder}" for folder in folders)
    build_c.link(sources, made, "-shared", *build_c.LIBRARY_FLAGS, *paths, f"-DWIDEST={most}")
    theirs = ctypes.CDLL(str(made))
    for name in ("stepper_begin", "stepper_run"):
        getattr(theirs, name).argtypes = getattr(ours, name).argtypes
    scenes = [
        load(name, ({} if name.startswith("trial") else PERIODS) | changes | FAST)
        for name, changes in SCENES
    ]
    found = fast.summaries(scenes)
    monkeypatch.setattr(fast, "library", lambda _: theirs)
    for one, other in zip(found, fast.summaries(scenes), strict=True):
        assert one | {"wall_time": 0.0} == other | {"wall_time": 0.0}


def test_a_sweep_is_judged_by_the_fmu(capsys: pytest.CaptureFixture[str]) -> None:
    scene = load("paper-limited", {"run.duration": 0.3, "run.settle": 0.1})
    over = {"drive.pot_max": [0.6, 0.7, 0.8], "drive.pot_offset": [0.2, 0.3]}
    data = cosim.sweep(scene, over, FAST)
    exact = cosim.sweep(scene, over)
    assert np.array_equal(data.v_average_fmu.values, exact.v_average.values)
    assert "v_average_fmu" not in exact
    from cosim.studies.sweep.report import table

    told = table(data)
    assert "by the FMU" in told
    assert "fast solver against the FMU at 6 points: median error" in told


def test_what_tune_reports_is_the_fmu_s() -> None:
    few = {"run.duration": 0.2, "run.settle": 0.1}
    over = {"drive.pot_max": (0.5, 0.8)}
    found = cosim.tune("paper-limited", few | FAST, maximise="v_average", over=over, budget=40)
    assert found.scene.run.solver == "fmu"
    assert found.best.value == pytest.approx(summary(found.scene)["v_average"], rel=1e-6)
    assert found.scouts > 20
    assert "by the FMU" in repr(found) or found.by_fast is None


@pytest.mark.reliability
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"circuit.model": "amplifier"}, 'must be "limited" or "ideal"'),
        ({"coil.b1": 3.0}, "coil.b1 = 3 must be 0"),
        ({"coil.eddy_inductance": 1e-3, "coil.eddy_resistance": 2.0}, "must be absent"),
        ({"mechanics.contact": "rigid"}, 'must be "compliant"'),
        ({"drive.frequency": 3000.0}, "must be at most 2325.58 Hz with run.step = 4.3e-05 s"),
        ({"mechanics.initial_lift": 1e-5, "friction.mu_plate": 0.0}, "0 without friction.mu_plate"),
    ],
)
def test_what_it_does_not_model_is_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(BadInput) as error:
        load("paper-limited", FAST | changes)
    assert told in str(error.value)


@pytest.mark.reliability
def test_a_motion_that_leaves_the_numbers_is_a_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A spring too stiff for the steps."""
    stiff = {"mechanics.flexure_stiffness": 1e9, "run.duration": 0.5}
    options = [f"--set={key}={value}" for key, value in (stiff | FAST).items()]
    assert main(["run", "paper-limited", *options]) == 3
    assert "run.step is too long" in capsys.readouterr().err
    with Evaluator(load("paper-limited", FAST | stiff)) as bench:
        ((_, outcome),) = bench.run([(0, {})])
    assert "run.step is too long" in outcome.failure
