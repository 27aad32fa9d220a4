"""The compiled loop: blocks change nothing, faults are told, and it sees what it is to see."""

import ctypes
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.circuit.joined import Deck
from cosim.coupling.loop import lead, recorder
from cosim.coupling.loop.structures import (
    Fmu,
    LeadState,
    RecorderState,
    Schedule,
    loop,
)
from cosim.coupling.methods import methods
from cosim.coupling.rewind.joint import Joint
from cosim.drive import pieces
from cosim.drive.periodic import Lines
from cosim.drive.pieces import Piece
from cosim.errors import SimulationFailed
from cosim.files.resources import circuits
from cosim.mechanics import fmi, stickslip
from cosim.mechanics.fmi import Interface
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.cases import participants
from cosim.toolchain.processes import in_place
from cosim.waveforms.result import Result

pytestmark = pytest.mark.usefixtures("in_place")

LAST = ["run.duration=0.06", "run.settle=0.021"]
BRIEF = ["run.duration=0.02", "run.settle=0.0049", "run.output_step=3.1e-5"]
AMPLIFIER = (circuits() / "amplifier.cir").read_text(encoding="utf-8")

CASES = {
    "reference": ("reference", LAST),
    "rigid": ("reference", [*LAST, "mechanics.contact=rigid"]),
    "gripper": ("gripper", LAST),
    "no row but the ends": ("reference", [*LAST, "run.output_step=0.05"]),
    "slow reset": ("reference", [*LAST, "drive.reset_time=0.005"]),
    "held for long": (
        "reference",
        [*LAST, "friction.mu_s=5", "friction.mu_k=4", "drive.amplitude=1"],
    ),
    "sine": ("reference", [*LAST, "drive.waveform=sine", "drive.frequency=50"]),
    "square": ("reference", [*LAST, "drive.waveform=square", "drive.frequency=50"]),
    "fast square": ("reference", [*LAST, "drive.waveform=square", "drive.frequency=137.3"]),
    "staircase": ("reference", [*BRIEF, "drive.quantised=true"]),
    "eddy currents": ("reference", [*BRIEF, "coil.eddy_inductance=1e-3", "coil.eddy_resistance=4"]),
    "full": ("reference", [*BRIEF, "circuit.model=full"]),
    "full with the pin's ripple": (
        "reference",
        ["circuit.model=full", *BRIEF, "drive.pwm_ripple=true"],
    ),
    "full, ramp": ("reference", ["circuit.model=full", *BRIEF, "drive.quantised=false"]),
    "ideal": ("reference", [*LAST, "circuit.model=ideal"]),
    "ideal sine": ("reference", ["circuit.model=ideal", *LAST, "drive.waveform=sine"]),
    "undriven": ("held", LAST),
}


METHODS = ["jacobi", "gauss-seidel", "mean-current", "companion"]


def assert_same(one: Result, other: Result) -> None:
    assert list(one.columns) == list(other.columns)
    for name, values in other.columns.items():
        assert np.isfinite(values).all(), name
        assert values.tobytes() == one.columns[name].tobytes(), name
    numbers = [{**result.summary, "wall_time": 0} for result in (one, other)]
    assert numbers[0] == numbers[1]


@pytest.mark.parametrize("name", CASES)
def test_blocks_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load(*CASES[name])
    whole = simulate(scene)
    # Blocks as small as can be, so that a short run goes over many of their ends.
    monkeypatch.setattr(recorder, "STEPS", 7)
    monkeypatch.setattr(lead, "_POINTS", 7)
    monkeypatch.setattr(pieces, "PREPARED", 2)
    assert_same(whole, simulate(scene))


@pytest.mark.parametrize("method", ["step-locked", *METHODS])
def test_same_bits_through_fmi_2(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load("reference", [*BRIEF, f"coupling.method={method}"])
    third = simulate(scene)
    monkeypatch.setattr(stickslip, "FMI", 2)
    with in_place():
        assert_same(third, simulate(scene))


def test_same_bits_with_a_netlist_of_ones_own(tmp_path: Path) -> None:
    netlist = tmp_path / "own.cir"
    netlist.write_text(AMPLIFIER)
    own = ["circuit.model=file", f"circuit.netlist={netlist}", "circuit.max_step=1.4e-4"]
    own.append("circuit.reltol=3e-5")
    found = simulate(load("reference", [*BRIEF, *own]))
    expected = simulate(load("reference", BRIEF))
    for name, values in expected.columns.items():
        if name != "command":  # which a netlist of one's own makes itself
            assert values.tobytes() == found.columns[name].tobytes(), name


def test_no_step_goes_through_python(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("a step in Python")

    monkeypatch.setattr(Interface, "do_step", refuse)
    for model in ("amplifier", "full", "ideal"):
        simulate(load("reference", [*BRIEF, f"circuit.model={model}"]))
    for scene in ("two-surfaces", "closed-loop-grasp"):
        simulate(load(scene, BRIEF))
    simulate(load("reference", [*BRIEF, "coupling.method=jacobi"]))


def test_no_step_asks_for_the_cpu_time() -> None:
    """ngspice would, to print four times a second how far it is."""
    simulate(load("reference", ["run.duration=1", "circuit.max_step=1e-5"]))
    assert not [line for line in lead.engine()._stdout if "Reference value" in line]


@pytest.mark.parametrize("name", METHODS)
def test_a_method_does_the_same_between_both_masters(name: str) -> None:
    """ngspice, finely resolved, leads as the exactly solved amplifier does: they part by less than
    a hundredth of what the method itself is off at this macro step."""
    h, steps = 1e-4, 120
    fine = ["circuit.reltol=1e-8", "circuit.max_step=1e-6", f"run.output_step={h}"]
    scene = load("reference", [*fine, f"run.duration={(steps + 0.5) * h}", "run.settle=0"])
    default = simulate(scene).columns["z_surface"][: steps + 1]
    chosen = {"method": name, "macro_step": h}
    led = scene.model_copy(update={"coupling": scene.coupling.model_copy(update=chosen)})
    found = simulate(led).columns["z_surface"][: steps + 1]
    circuit, mechanics = participants(scene)
    path = [mechanics.sample()["z_surface"]]
    try:
        joint = Joint(circuit, mechanics, methods()[name]())
        for _ in range(steps):
            joint.step(h)
            path.append(mechanics.sample()["z_surface"])
    finally:
        mechanics.close()
    off = np.abs(np.array(path) - found).max()
    assert off < 0.01 * np.abs(found - default).max()


def test_structures_have_the_size_of_their_twins() -> None:
    kinds = (Fmu, Schedule, RecorderState, LeadState, Piece)
    assert [ctypes.sizeof(kind) for kind in kinds] == [loop().loop_size(k) for k in range(5)]


def test_mechanics_fail_with_the_words_of_the_fmu() -> None:
    scene = load(
        "reference", ["circuit.model=ideal", "mechanics.suspension_k2=-1e15", "drive.offset=6"]
    )
    with pytest.raises(SimulationFailed, match=r"failed at t = .* internal steps"):
        simulate(scene)


DO_STEP = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.c_double,
    ctypes.c_double,
    ctypes.c_bool,
    *[ctypes.c_void_p] * 4,
)


@pytest.mark.parametrize("model", ["amplifier", "ideal"])
def test_a_call_of_the_mechanics_fails(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load("reference", [*BRIEF, f"circuit.model={model}"])
    before, original, calls = simulate(scene), Interface.addresses.func, iter(range(300))
    kept = []

    def addresses(self: Interface) -> dict:
        fields = original(self)
        true = DO_STEP(fields["do_step"])

        def failing(instance: int, time: float, step: float, *rest: object) -> int:
            return 3 if next(calls, None) is None else true(instance, time, step, *rest)

        kept.append(DO_STEP(failing))
        return fields | {"do_step": ctypes.cast(kept[0], ctypes.c_void_p).value}

    with monkeypatch.context() as patch:
        patch.setattr(fmi, "_idle", {3: []})  # the failing instance is no other run's
        patch.setattr(Interface, "addresses", property(addresses))
        with pytest.raises(SimulationFailed, match=r"at t = 0\.\d+ s: do_step failed with"):
            simulate(scene)
    assert_same(simulate(scene), before)


@pytest.mark.parametrize("failure", [ValueError("a fault"), KeyboardInterrupt()])
@pytest.mark.parametrize(
    ("owner", "name"),
    [(lead.Lead, "_attend"), (Lines, "piece")],
    ids=["taking the log", "preparing the command"],
)
def test_python_fails_below_ngspice(
    owner: type, name: str, failure: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load("reference", BRIEF)
    before, original, calls = simulate(scene), getattr(owner, name), iter(range(4))

    def failing(*arguments: object) -> object:
        if next(calls, None) is None:
            raise failure
        return original(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(lead, "_POINTS", 100)
        patch.setattr(pieces, "PREPARED", 1)
        patch.setattr(owner, name, failing)
        with pytest.raises(type(failure)):
            simulate(load("reference", [*BRIEF, "run.duration=10"]))
    assert_same(simulate(scene), before)


def test_a_source_that_nothing_feeds(monkeypatch: pytest.MonkeyPatch) -> None:
    original = lead.prepare

    def strange(scene: Scene) -> Deck:
        made, odd = original(scene), "\nVodd odd 0 external\nRodd odd 0 1"
        return replace(made, text=made.text.replace("\n.tran", f"{odd}\n.tran"))

    monkeypatch.setattr(lead, "prepare", strange)
    with pytest.raises(SimulationFailed, match="external source vodd that nothing feeds"):
        simulate(load("reference", BRIEF))


def test_values_out_of_range(monkeypatch: pytest.MonkeyPatch) -> None:
    original = Mechanics.__init__

    def poisoned(self: Mechanics, scene: Scene) -> None:
        original(self, scene)
        self.step_outputs[0] = np.nan

    monkeypatch.setattr(Mechanics, "__init__", poisoned)
    with pytest.raises(SimulationFailed, match=r"range of numbers|ngspice stopped at t = 0 s"):
        simulate(load("reference", BRIEF))


def test_progress_goes_on_within_long_steps_of_the_command() -> None:
    told: list[float] = []
    simulate(load("reference", ["run.duration=1"]), told.append)
    assert told == sorted(told) and told[0] == 0.0 and told[-1] == 1.0
    assert len(told) > 3


def test_a_step_of_no_length_moves_nothing() -> None:
    """Where an edge of the netlist's own is, ngspice steps by 1e-19 s, over which its error of a
    milliampere is steeper than any slope that the FMU takes."""
    scene = load("reference", {"circuit.model": "ideal", "run.duration": 4e-3, "run.settle": 0.0})

    def moved(edges: list[float], end: list[float]) -> float:
        with closing(Mechanics(scene)) as mechanics:
            log = recorder.Recorder(scene, mechanics, lambda time: None)
            log.follow(*map(np.array, (edges, [0.0, *end[:-1]], end)))
            return float(log.column("v_surface")[-1])

    usual = moved([2e-3, 4e-3], [1.0, 1.0])
    assert moved([2e-3, 2e-3 + 5e-19, 4e-3], [1.0, 1.001, 1.0]) == pytest.approx(usual, rel=1e-3)
