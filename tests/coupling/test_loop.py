"""The compiled twins of the recorder, the coupling and the circuit's run give the same bits."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from cosim.coupling.loop import compiled, compiled_run, run
from cosim.coupling.loop.compiled import Fmu, State
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import Sawtooth
from cosim.errors import SimulationFailed
from cosim.files.resources import circuits
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, load
from cosim.simulation.simulate import Result, simulate

LAST = ["run.duration=0.06", "run.settle=0.021"]
BRIEF = ["run.duration=0.02", "run.settle=0.0049", "run.output_step=3.1e-5"]
AMPLIFIER = (circuits() / "amplifier.cir").read_text(encoding="utf-8")

CASES = {
    "paper": ("paper", LAST),
    "rigid": ("paper", [*LAST, "mechanics.contact=rigid"]),
    "gripper": ("gripper", LAST),
    "no row but the ends": ("paper", [*LAST, "run.output_step=0.05"]),
    "slow reset": ("paper", [*LAST, "drive.reset_time=0.005"]),
    "held for long": ("paper", [*LAST, "friction.mu_s=5", "friction.mu_k=4", "drive.amplitude=1"]),
    "sine": ("paper", [*LAST, "drive.waveform=sine", "drive.frequency=50"]),
    "square": ("paper", [*LAST, "drive.waveform=square", "drive.frequency=50"]),
    "fast square": ("paper", [*LAST, "drive.waveform=square", "drive.frequency=137.3"]),
    "staircase": ("paper", [*BRIEF, "drive.quantised=true"]),
    "eddy currents": ("paper", [*BRIEF, "coil.eddy_inductance=1e-3", "coil.eddy_resistance=4"]),
    "full": ("paper-full", BRIEF),
    "full with the pin's ripple": ("paper-full", [*BRIEF, "drive.pwm_ripple=true"]),
    "full, ramp": ("paper-full", [*BRIEF, "drive.quantised=false"]),
    "ideal": ("ideal-current", LAST),
    "ideal sine": ("ideal-current", [*LAST, "drive.waveform=sine"]),
    "undriven": ("held", LAST),
}


def both(scene: Scene, fmi_version: int = 3) -> tuple[Result, Result]:
    fast = simulate(scene, fmi_version=fmi_version)
    return fast, simulate(scene, fmi_version=fmi_version, compiled=False)


def assert_same(fast: Result, plain: Result) -> None:
    assert list(fast.waveforms) == list(plain.waveforms)
    for name, values in plain.waveforms.items():
        assert np.isfinite(values).all(), name
        assert values.tobytes() == fast.waveforms[name].tobytes(), name
    numbers = [{**result.summary, "wall_time": 0} for result in (fast, plain)]
    assert numbers[0] == numbers[1]


@pytest.mark.parametrize("name", CASES)
def test_same_bits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load(*CASES[name])
    # Blocks as small as can be, so that a short run goes over many of their ends.
    monkeypatch.setattr(compiled, "BLOCK", 7)
    monkeypatch.setattr(compiled_run, "BLOCK", 7)
    monkeypatch.setattr(compiled_run, "_PIECES", 2)
    assert_same(*both(scene))


def test_same_bits_through_fmi_2() -> None:
    assert_same(*both(load("paper", BRIEF), fmi_version=2))


def test_same_bits_with_a_netlist_of_ones_own(tmp_path: Path) -> None:
    netlist = tmp_path / "own.cir"
    netlist.write_text(AMPLIFIER.replace("Rsense sense 0", "Csnub out 0 10n\nRsense sense 0"))
    assert netlist.read_text() != AMPLIFIER
    scene = load("paper", [*BRIEF, "circuit.model=file", f"circuit.netlist={netlist}"])
    assert_same(*both(scene))


def test_no_step_goes_through_python(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("a step in Python")

    monkeypatch.setattr(Mechanics, "step_to", refuse)
    monkeypatch.setattr(Mechanics, "sample", refuse)
    monkeypatch.setattr(Recorder, "advance", refuse)
    for scene in ("paper", "paper-full", "ideal-current"):
        simulate(load(scene, BRIEF))


def test_structures_have_the_size_of_their_twins() -> None:
    size = compiled.library().coupled_size
    found = [ctypes.sizeof(kind) for kind in (Fmu, State, compiled_run.Circuit)]
    assert [*found, compiled_run.PIECE.itemsize] == [size(k) for k in range(4)]


def test_mechanics_fail_with_the_same_words() -> None:
    scene = load("ideal-current", ["coil.force_factor=1000", "mechanics.ram_mass=1e-9"])
    said = []
    for fast in (True, False):
        with pytest.raises(SimulationFailed, match="internal steps") as caught:
            simulate(scene, compiled=fast)
        said.append(str(caught.value))
    assert said[0] == said[1]


DO_STEP = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.c_double,
    ctypes.c_double,
    ctypes.c_bool,
    *[ctypes.c_void_p] * 4,
)


@pytest.mark.parametrize("name", ["paper", "ideal-current"])
def test_a_call_of_the_mechanics_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load(name, BRIEF)
    before, original, calls = simulate(scene), Mechanics.shared, iter(range(300))
    kept = []

    def shared(self: Mechanics) -> dict:
        fields = original(self)
        true = DO_STEP(fields["do_step"])

        def failing(instance: int, time: float, step: float, *rest: object) -> int:
            return 3 if next(calls, None) is None else true(instance, time, step, *rest)

        kept.append(DO_STEP(failing))
        return fields | {"do_step": ctypes.cast(kept[0], ctypes.c_void_p).value}

    with monkeypatch.context() as patch:
        patch.setattr(Mechanics, "shared", shared)
        with pytest.raises(SimulationFailed, match=r"at t = 0\.\d+ s: do_step failed with"):
            simulate(scene)
    assert_same(simulate(scene), before)


@pytest.mark.parametrize("failure", [ValueError("a fault"), KeyboardInterrupt()])
@pytest.mark.parametrize(
    ("owner", "name"),
    [(compiled_run.CompiledRun, "_attend"), (Sawtooth, "piece")],
    ids=["taking the log", "preparing the command"],
)
def test_python_fails_below_ngspice(
    owner: type, name: str, failure: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load("paper", BRIEF)
    before, original, calls = simulate(scene), getattr(owner, name), iter(range(4))

    def failing(*arguments: object) -> object:
        if next(calls, None) is None:
            raise failure
        return original(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(compiled_run, "BLOCK", 100)
        patch.setattr(compiled_run, "_PIECES", 1)
        patch.setattr(owner, name, failing)
        with pytest.raises(type(failure)):
            simulate(load("paper", [*BRIEF, "run.duration=10"]))
    assert_same(simulate(scene), before)


def test_a_source_that_nothing_feeds(monkeypatch: pytest.MonkeyPatch) -> None:
    original = run.prepare

    def strange(scene: Scene) -> tuple[str, tuple[str, ...]]:
        deck, saved = original(scene)
        return deck.replace("\n.tran", "\nVodd odd 0 external\nRodd odd 0 1\n.tran"), saved

    monkeypatch.setattr(run, "prepare", strange)
    for fast in (True, False):
        with pytest.raises(SimulationFailed, match="external source vodd that nothing feeds"):
            simulate(load("paper", BRIEF), compiled=fast)


def test_values_out_of_range(monkeypatch: pytest.MonkeyPatch) -> None:
    original = Mechanics.shared

    def poisoned(self: Mechanics) -> dict:
        self.step_outputs[0] = np.nan
        return original(self)

    monkeypatch.setattr(Mechanics, "shared", poisoned)
    with pytest.raises(SimulationFailed, match=r"range of numbers|ngspice stopped at t = 0 s"):
        simulate(load("paper", BRIEF))


def test_progress_goes_on_within_long_steps_of_the_command() -> None:
    told: list[float] = []
    simulate(load("paper", ["run.duration=0.5"]), told.append)
    assert told == sorted(told) and told[0] == 0.0 and told[-1] == 0.5
    assert len(told) > 3
