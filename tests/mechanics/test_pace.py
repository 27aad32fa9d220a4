"""Mechanics too fast to be solved are refused, and not by a run that never ends."""

import contextlib
import re
import subprocess
import sys
from ctypes import c_double, c_void_p

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

import cosim
from cosim.coupling.loop.recorder import Recorder
from cosim.errors import BadInput, SimulationFailed
from cosim.mechanics.fmi import borrow, give_back
from cosim.mechanics.pace import BEGINNING, BUDGET, Pace
from cosim.mechanics.stickslip import Mechanics
from cosim.scene.model import FASTEST

pytestmark = pytest.mark.reliability

ENDLESS = {"mechanics.contact_damping": 1e6, "drive.offset": 6.0}
"""The ram comes to rest against a wall, whose damper is then stiff."""


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cosim", "run", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("model", ["amplifier", "limited", "none"])
def test_a_stiff_damper_is_refused_at_once(model: str, tmp_path) -> None:
    own = f"--set=circuit.model={model}"
    done = run(
        "reference", own, "--set", "mechanics.flexure_damping=1e9", "--out", str(tmp_path / "out")
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "cosim: --set: mechanics.flexure_damping = 1e+09 N.s/m must be at most 1.45e+04 N.s/m with "
        "mechanics.surface_mass = 0.0145 kg, or the bodies move too fast to be solved.\n"
    )
    assert not list(tmp_path.iterdir())


def fastest(rig: dict[str, float], direct: bool) -> float:
    """Largest modulus of the eigenvalues (1/s) of surface and ram, free of walls and part."""
    surface, ram = rig["surface_mass"], 0.004
    k, c = rig["flexure_stiffness"], rig["flexure_damping"]
    k1, c1 = rig["suspension_k1"], rig["suspension_damping"]
    if direct:
        rates = np.array([[0.0, 1.0], [-(k + k1) / surface, -(c + c1) / surface]])
    else:
        rates = np.zeros((4, 4))
        rates[:2, 2:] = np.eye(2)
        rates[2] = np.array([-(k + k1), k1, -(c + c1), c1]) / surface
        rates[3] = np.array([k1, -k1, c1, -c1]) / ram
    return float(np.abs(np.linalg.eigvals(rates)).max())


@pytest.mark.physics
@pytest.mark.parametrize("direct", [False, True], ids=["ram", "direct"])
@pytest.mark.parametrize(
    "key", ["flexure_damping", "flexure_stiffness", "suspension_damping", "suspension_k1"]
)
def test_the_limit_is_the_fastest_motion(key: str, direct: bool) -> None:
    """The values allowed are those that move the bodies no faster than in FASTEST."""
    full = f"mechanics.{key}"
    others = {
        "circuit.model": "ideal",
        "mechanics.flexure_damping": 0.0,
        "mechanics.flexure_stiffness": 560.0,
        "mechanics.suspension_damping": 0.0,
        "mechanics.suspension_k1": 0.0,
        "mechanics.actuator": "direct" if direct else "ram",
        "mechanics.surface_mass": 1e-3,
    }
    with pytest.raises(BadInput, match=rf"{full} = .* must be at most (\S+) ") as refused:
        cosim.load("reference", others | {full: 1e9 if "damping" in key else 1e12})
    most = float(str(refused.value).partition("at most ")[2].split()[0])
    allowed = cosim.load("reference", others | {full: 0.99 * most}).mechanics.model_dump()
    assert fastest(allowed, direct) == pytest.approx(1.0 / FASTEST, rel=0.02)
    with pytest.raises(BadInput):
        cosim.load("reference", others | {full: 1.01 * most})


def test_the_fastest_that_is_allowed_is_solved() -> None:
    values = {
        "circuit.model": "ideal",
        "mechanics.flexure_damping": 1.449e4,
        "mechanics.flexure_stiffness": 1.449e10,
    }
    scene = cosim.load("reference", values | {"run.duration": 0.2, "run.settle": 0.1})
    result = cosim.run(scene)
    assert abs(result.waveforms.z_surface).max() < 1e-8
    assert abs(result.summary["energy_residual"]) < 1e-6


@pytest.mark.slow
def test_a_run_without_an_end_is_told_at_its_beginning(tmp_path) -> None:
    values = [f"{key}={value}" for key, value in ENDLESS.items()]
    values += ["run.duration=1000", "run.output_step=1e-3"]
    options = [part for value in values for part in ("--set", value)]
    done = run("reference", *options, "--out", str(tmp_path / "out"))
    assert (done.returncode, done.stdout) == (3, "")
    assert "too fast to be solved" in done.stderr and "run.duration = 1000 s" in done.stderr
    assert "mechanics.contact_damping = 1e+06 s/m" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_short_run_of_it_is_done() -> None:
    result = cosim.run("reference", ENDLESS | {"run.duration": 0.1, "run.settle": 0.05})
    assert np.isfinite(result.summary["v_average"])


class Counted(Mechanics):
    """Counts what it is told to, without an FMU."""

    def __init__(self) -> None:
        self.spent = 0.0

    def internal_steps(self) -> int:
        return int(self.spent)


def test_a_long_run_goes_on() -> None:
    """Ten hours at a hundred times the built-in scenes' pace, and one that slows down late."""
    scene = cosim.load(
        "reference", {"circuit.model": "ideal", "run.duration": 36000.0, "run.output_step": 0.1}
    )
    mechanics = Counted()
    pace = Pace(scene, mechanics)
    for time in np.arange(0.1, 36000.0, 10.0):
        mechanics.spent = 9e5 * time
        pace.judge(time, 0)
    assert mechanics.spent > 100 * BUDGET
    late = Pace(scene, mechanics)
    mechanics.spent = 1.1 * BEGINNING
    late.judge(3600.0, 0)
    mechanics.spent = 1e14
    late.judge(3601.0, 0)
    with pytest.raises(SimulationFailed, match=r"would take about 3\.6e\+11"):
        mechanics.spent = 1e7
        Pace(scene, mechanics).judge(1.0, 0)


def test_slow_steps_come_back_to_be_interrupted() -> None:
    """Compiled code goes on for 4096 steps without Python: an hour where each takes a second."""
    scene = cosim.load("reference", ENDLESS | {"circuit.model": "ideal", "run.output_step": 5e-3})
    with contextlib.closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda time: None)
        edges = np.linspace(5e-3, 2.5, 500)
        current = np.full_like(edges, 1.5)
        places = [values.ctypes.data for values in (edges, current, current)]
        done = recorder._library.recorder_follow(recorder._state, 500, *places, 4096)
        assert 0 < done < 500
        recorder.follow(edges[done : done + 1], current[:1], current[:1])
        assert recorder.steps == done + 1


@pytest.mark.parametrize("version", [2, 3])
def test_one_step_of_the_fmu_is_bounded_and_says_what_to_do(version: int) -> None:
    """Far above what a step that is asked for takes; before, a step went on for 52 s."""
    fmu = borrow(version)
    fmu.set_reals(fmu.places(["contact_damping"]), (c_double * 1)(1e6))
    fmu.initialise()
    fmu.set_reals(fmu.places(["current"]), (c_double * 1)(1.5))
    state = c_void_p()
    fmu.get_state(state)
    with pytest.raises(FMICallException):
        fmu.do_step(0.0, 10.0)
    found = re.search(r"after (\d+) internal steps, (\S+) s into a step of 10 s", fmu.messages[-1])
    assert found and int(found[1]) < 1e6
    assert "take shorter steps" in fmu.messages[-1]
    reached = float(found[2])
    fmu.set_state(state)
    fmu.do_step(0.0, 0.5 * reached)  # as the sentence advises
    fmu.do_step(0.5 * reached, 0.5 * reached)
    fmu.free_state(state)
    give_back(fmu)
