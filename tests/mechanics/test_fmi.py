"""Both FMU files through an importer that is not ours: FMPy."""

import ctypes
import math
import re
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from hypothesis import given
from hypothesis import strategies as st

from cosim.files.resources import fmu_sources
from cosim.mechanics import package as fmu

H = 1e-4


class Rig:
    """One instance of either version, with names for variables and a list of its messages."""

    def __init__(
        self,
        version: int,
        token: str | None = None,
        logging: bool = False,
        messages: list[str] | None = None,
    ):
        folder = str(fmu.unpacked(version))
        description = fmpy.read_model_description(folder)
        self.version = version
        self.variables = {v.name: v for v in description.modelVariables}
        self.messages: list[str] = [] if messages is None else messages
        kind = FMU2Slave if version == 2 else FMU3Slave
        self.fmu: Any = kind(
            instanceName="rig",
            guid=token or fmu.token(),
            modelIdentifier="stickslip",
            unzipDirectory=folder,
        )
        if version == 2:
            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(
                lambda _, name, status, category, text: self.messages.append(text.decode())
            )
            self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
            self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
            self.fmu.instantiate(callbacks=self.callbacks, loggingOn=logging)
        else:
            self.fmu.instantiate(
                loggingOn=logging,
                logMessage=lambda _, status, category, text: self.messages.append(text.decode()),
            )
        self.time = 0.0

    def begin(self, parameters: Mapping[str, float] | None = None, **experiment: Any) -> "Rig":
        self.set(**(parameters or {}))
        self.enter(**experiment)
        self.fmu.exitInitializationMode()
        return self

    def enter(self, **experiment: Any) -> None:
        if self.version == 2:
            self.fmu.setupExperiment(**experiment)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(**experiment)
        self.time = experiment.get("startTime", 0.0)

    def set(self, **values: float) -> None:
        for integer in (False, True):
            of_type = {n: v for n, v in values.items() if self._is_integer(n) == integer}
            if of_type:
                references = [self.variables[n].valueReference for n in of_type]
                self._setter(integer)(references, list(of_type.values()))

    def get(self, *names: str) -> Any:
        values = [self._getter(self._is_integer(n))([self._reference(n)])[0] for n in names]
        return values[0] if len(values) == 1 else values

    def step(self, h: float = H) -> None:
        self.fmu.doStep(self.time, h)
        self.time += h

    def outputs(self) -> dict[str, float]:
        return {n: self.get(n) for n, v in self.variables.items() if v.causality == "output"}

    def derivative(self, unknowns: list[str], knowns: list[str], seed: list[float]) -> list[float]:
        return self.fmu.getDirectionalDerivative(
            [self._reference(n) for n in unknowns], [self._reference(n) for n in knowns], seed
        )

    def save(self) -> bytes:
        state = self.fmu.getFMUState()
        data = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return bytes(data)

    def load(self, data: bytes) -> None:
        state = self.fmu.deserializeFMUState(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)
        self.time = self.get("time")

    def _reference(self, name: str) -> int:
        return self.variables[name].valueReference

    def _is_integer(self, name: str) -> bool:
        return self.variables[name].type in ("Integer", "Int32")

    def _setter(self, integer: bool) -> Callable[..., None]:
        if self.version == 2:
            return self.fmu.setInteger if integer else self.fmu.setReal
        return self.fmu.setInt32 if integer else self.fmu.setFloat64

    def _getter(self, integer: bool) -> Callable[..., list[float]]:
        if self.version == 2:
            return self.fmu.getInteger if integer else self.fmu.getReal
        return self.fmu.getInt32 if integer else self.fmu.getFloat64


@contextmanager
def rig(version: int, **options: Any) -> Iterator[Rig]:
    it = Rig(version, **options)
    try:
        yield it
    finally:
        it.fmu.freeInstance()


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> int:
    return request.param


def command(t: float) -> float:
    """A sawtooth that makes the part slip and the ram strike its walls."""
    return 2.0 * (t * 20.0 % 1.0) - 1.3


def trajectory(it: Rig, steps: int) -> list[dict[str, float]]:
    rows = []
    for _ in range(steps):
        it.set(
            current=command(it.time), current_slope=(command(it.time + H) - command(it.time)) / H
        )
        it.step()
        rows.append(it.outputs())
    return rows


def test_integers_may_be_read_as_reals(version: int) -> None:
    """Some importers ask for all outputs in one call; what they may not, they still may not."""
    with rig(version) as it:
        it.begin()
        trajectory(it, 300)
        names = [n for n, v in it.variables.items() if v.causality == "output"]
        together = it._getter(False)([it._reference(name) for name in names])
        assert together == [it.get(name) for name in names]
        assert it.get("impacts") > 3 and it.get("stick_slip_events") > 3
        last = max(it._reference(name) for name in it.variables)
        for no_real in (last + 1, 1000):
            with pytest.raises(FMICallException):
                it._getter(False)([no_real])
        with pytest.raises(FMICallException):
            it._setter(False)([it._reference("contact")], [0.0])


# ---- the files ----


def test_the_files_are_valid(version: int, tmp_path: Path) -> None:
    assert validate_fmu(str(fmu.pack(tmp_path)[version])) == []


def test_check_finds_no_problem(capsys: pytest.CaptureFixture[str]) -> None:
    assert fmu.check() == []
    assert capsys.readouterr().out.count("valid") == 2


def test_every_function_of_both_standards_is_exported(version: int) -> None:
    text = (fmu_sources() / "include" / f"fmi{version}Functions.h").read_text()
    names = set(re.findall(rf"FMI{version}_Export\s+\w+TYPE\s+(\w+);", text))
    assert len(names) > 40
    library = ctypes.CDLL(str(next(fmu.unpacked(version).glob("binaries/*/stickslip*"))))
    assert {name for name in names if not hasattr(library, name)} == set()


def test_another_importer_loop_runs_it(version: int, tmp_path: Path) -> None:
    signal = np.array([(0.0, 0.0), (0.05, 0.1)], dtype=[("time", float), ("current", float)])
    result = fmpy.simulate_fmu(
        str(fmu.pack(tmp_path)[version]),
        start_values={"part_mass": 0.018, "n_surfaces": 2},
        input=signal,
        stop_time=0.05,
        output_interval=1e-4,
        output=["z_surface", "sticking", "current"],
    )
    assert result["time"][-1] == pytest.approx(0.05, rel=1e-9)
    assert np.isfinite(result["z_surface"]).all()
    assert result["current"][-2:] == pytest.approx(0.1, rel=0.01)


# ---- values ----


def test_it_starts_in_static_equilibrium(version: int) -> None:
    with rig(version) as it:
        it.begin()
        assert it.get("z_surface") == pytest.approx(-(0.004 + 0.0145 + 0.009) * 9.81 / 560.0)
        assert it.get("friction_force") == pytest.approx(0.009 * 9.81)
        for _ in range(100):
            it.step()
        assert abs(it.get("v_surface")) < 1e-9
        assert it.get("slip") == 0.0


def test_both_versions_agree() -> None:
    with rig(2) as two, rig(3) as three:
        a = trajectory(two.begin(), 1500)
        b = trajectory(three.begin(), 1500)
        impacts, changes = two.get("impacts", "stick_slip_events")
    assert impacts > 0 and changes > 0
    for row_a, row_b in zip(a, b, strict=True):
        assert row_a == pytest.approx(row_b, rel=1e-12, abs=1e-12)


def test_two_instances_do_not_interfere(version: int) -> None:
    with rig(version) as alone:
        expected = trajectory(alone.begin(), 400)
    with rig(version) as one, rig(version) as other:
        one.begin()
        other.begin({"ram_mass": 0.002, "contact": 2})
        rows = []
        for _ in range(400):
            rows += trajectory(one, 1)
            other.set(current=-command(other.time))
            other.step(0.7 * H)
    assert rows == expected


def test_reset_is_as_good_as_new(version: int) -> None:
    with rig(version) as it:
        first = trajectory(it.begin(), 300)
        it.fmu.reset()
        assert it.get("mu_s", "current") == [0.72, 0.0]
        it.set(ram_mass=0.002)
        it.fmu.reset()
        assert trajectory(it.begin(), 300) == first


def test_inputs_run_on_with_their_slopes(version: int) -> None:
    with rig(version) as it:
        it.begin()
        it.set(current=0.1, current_slope=20.0, normal_force=0.5, normal_force_slope=-100.0)
        it.step(1e-3)
        assert it.get("current", "normal_force") == pytest.approx([0.12, 0.4], rel=1e-12)


def test_input_derivatives_are_the_slopes() -> None:
    with rig(2) as a, rig(2) as b:
        a.begin().set(current=0.1, current_slope=20.0)
        b.begin().set(current=0.1)
        b.fmu.setRealInputDerivatives([b._reference("current")], [1], [20.0])
        a.step()
        b.step()
        assert a.outputs() == b.outputs()
        with pytest.raises(FMICallException):
            b.fmu.setRealInputDerivatives([b._reference("current")], [2], [20.0])


def test_outputs_follow_inputs_at_once(version: int) -> None:
    with rig(version) as it:
        it.begin()
        before = it.get("a_ram")
        it.set(current=0.01)
        # Newton: the ram is free, so the force acts on its mass alone.
        assert it.get("a_ram") - before == pytest.approx(0.6 * 0.01 / 0.004, rel=1e-9)


def test_parameters_may_be_set_in_the_initialization_mode(version: int) -> None:
    with rig(version) as early, rig(version) as late:
        early.begin({"part_mass": 0.02, "contact": 2})
        late.enter()
        late.get("z_surface")
        late.set(part_mass=0.02, contact=2)
        assert late.get("z_surface") == early.get("z_surface")
        late.fmu.exitInitializationMode()
        assert trajectory(late, 100) == trajectory(early, 100)


def test_the_experiments_tolerance_gives_way_to_the_parameter(version: int) -> None:
    with rig(version) as it:
        assert it.begin(tolerance=1e-6).get("tolerance") == 1e-6
    with rig(version) as it:
        assert it.begin({"tolerance": 1e-8}, tolerance=1e-6).get("tolerance") == 1e-8


def test_start_time_is_the_importers(version: int) -> None:
    with rig(version) as it:
        it.begin(startTime=1e6)
        for _ in range(50):
            it.step(1e-6)
        assert it.get("time") == pytest.approx(1e6 + 50e-6, abs=1e-8)


def test_events_are_logged_on_request(version: int) -> None:
    with rig(version) as quiet, rig(version, logging=True) as talking:
        trajectory(quiet.begin(), 600)
        trajectory(talking.begin(), 600)
        assert quiet.messages == []
        assert any("impacts" in message for message in talking.messages)


# ---- derivatives ----

FOLLOWING = [
    "a_surface",
    "a_ram",
    "a_part",
    "back_emf_slope",
    "friction_force",
    "plate_force",
    "wall_force",
]
"""In lines: time_to_impact, too, but in a curve."""
OF_SECOND = ["a_surface_2", "friction_force_2"]
TWO = {"independent": 1, "n_surfaces": 2}


@pytest.mark.parametrize("parameters", [{}, {"mu_plate": 0.1, "b1": 40.0}, {"contact": 2}, TWO])
def test_directional_derivatives_are_the_differences(
    version: int, parameters: dict[str, float]
) -> None:
    modes = set()
    with rig(version) as it:
        it.begin(parameters)
        for _ in range(1200):
            trajectory(it, 1)
            mode = (it.get("sticking"), it.get("wall_contact"))
            if mode in modes:
                continue
            modes.add(mode)
            following = FOLLOWING + OF_SECOND
            for known, distance in (
                ("current", 0.25),
                ("current_2", 0.25),
                ("normal_force", 0.125),
            ):
                here = it.get(known)
                sides = []
                for value in (here + distance, here - distance):
                    it.set(**{known: value})
                    sides.append(np.array(it.get(*following)))
                it.set(**{known: here})
                differences = (sides[0] - sides[1]) / (2.0 * distance)
                found = it.derivative(following, [known], [1.0])
                scale = np.abs(sides).max(axis=0) + 1.0
                assert found == pytest.approx(differences, rel=1e-9, abs=1e-11 * scale.max())
    assert {sticking for sticking, _ in modes} == {0, 1}
    assert len({wall for _, wall in modes}) > 1


@pytest.mark.parametrize(("normal", "slope"), [(0.05, 0.5), (0.25, 0.0)])
def test_derivatives_of_a_part_at_rest_on_surface_and_plate(
    version: int, normal: float, slope: float
) -> None:
    """The surface carries what it can of the weight, 0.5 F_n, and the plate the rest."""
    weight = {"part_mass": 0.009, "gravity": 10.0}
    with rig(version) as it:
        friction = {"mu_s": 0.5, "mu_k": 0.5, "mu_plate": 2.0}
        it.begin({**weight, **friction, "prescribed": 1, "normal_force": normal})
        forces, surfaces = ["friction_force", "plate_force"], min(0.5 * normal, 0.09)
        assert it.get(*forces) == pytest.approx([surfaces, 0.09 - surfaces])
        found = it.derivative(forces, ["normal_force"], [1.0])
        assert found == pytest.approx([slope, -slope], abs=1e-12)


@pytest.mark.parametrize("hold", [0.0, 1.0])
def test_a_normal_force_comes_to_zero_and_not_below(version: int, hold: float) -> None:
    """Whether its steps are those of the integration or lie within one; 1000 of them sum up to 0
    within rounding."""
    with rig(version) as it:
        it.begin({"mu_s": 0.0, "mu_k": 0.0, "normal_force": 0.3})
        it.set(normal_force_slope=-30.0, inputs_hold_for=hold)
        for _ in range(1000):
            it.step(1e-5)
        assert it.get("normal_force") == pytest.approx(0.0, abs=1e-9)
        with pytest.raises(FMICallException):
            it.step(1e-5)


def test_the_derivative_of_the_time_to_an_impact(version: int) -> None:
    """Against small differences, where the ram flies towards a wall."""
    seen = 0
    with rig(version) as it:
        it.begin({})
        for _ in range(1200):
            trajectory(it, 1)
            if not 1e-4 < it.get("time_to_impact") < 1e-2:
                continue
            here, h = it.get("current"), 1e-5
            sides = []
            for value in (here + h, here - h):
                it.set(current=value)
                sides.append(it.get("time_to_impact"))
            it.set(current=here)
            (found,) = it.derivative(["time_to_impact"], ["current"], [1.0])
            assert found == pytest.approx((sides[0] - sides[1]) / (2.0 * h), rel=1e-3, abs=1e-9)
            seen += 1
    assert seen > 10


def test_only_the_declared_outputs_follow_inputs_at_once(version: int) -> None:
    description = fmpy.read_model_description(str(fmu.unpacked(version)))
    declared = {u.variable.name for u in description.outputs if u.variable and u.dependencies}
    of_second = {*OF_SECOND, "coil_voltage_2"}
    assert declared == {*FOLLOWING, "time_to_impact", "coil_voltage", *of_second}
    with rig(version) as it:
        it.begin({"mu_plate": 0.1})
        followed = set()
        for _ in range(1200):
            trajectory(it, 1)
            before = it.outputs()
            current, force = it.get("current", "normal_force")
            it.set(current=current + 0.1, normal_force=force + 0.1)
            followed |= {name for name, value in it.outputs().items() if value != before[name]}
            it.set(current=current, normal_force=force)
    assert followed <= declared
    # These follow in a rigid contact at rest, and with a source.
    assert followed >= declared - {"wall_force", "coil_voltage", *of_second}


def test_with_a_source_only_the_voltage_follows_the_command_at_once(version: int) -> None:
    with rig(version) as it:
        it.begin({"source": 1, "eddy_inductance": 1e-3, "eddy_resistance": 4.0})
        modes = set()
        for k in range(500):
            command, slope = -5.0 + 0.08 * (k % 100), 800.0
            it.set(command=command, command_slope=slope)
            it.step()
            before = it.outputs()
            it.set(command_slope=slope + 100.0, current=1.0)
            after = it.outputs()
            found = it.derivative(["coil_voltage"], ["command_slope"], [1.0])[0]
            moved = {name for name in after if after[name] != before[name]}
            modes.add(before["output_clamped"])
            if before["output_clamped"]:
                assert (moved, found) == (set(), 0.0)
            else:
                assert moved == {"coil_voltage"}
                change = after["coil_voltage"] - before["coil_voltage"]
                assert found == pytest.approx(change / 100.0, rel=1e-9)
                assert found == pytest.approx(1.2e-3 / 4.0)
            it.set(command=command, current=0.0)
    assert modes == {0, -1}


def test_seeds_add_up(version: int) -> None:
    with rig(version) as it:
        it.begin()
        trajectory(it, 200)
        one = np.array(it.derivative(FOLLOWING, ["current"], [1.0]))
        other = np.array(it.derivative(FOLLOWING, ["normal_force"], [1.0]))
        both = it.derivative(FOLLOWING, ["current", "normal_force"], [2.0, -3.0])
        assert both == pytest.approx(2.0 * one - 3.0 * other)
        assert it.derivative(["z_part"], ["current"], [1.0]) == [0.0]


# ---- the source ----

SOURCE = {"source": 1, "eddy_inductance": 1e-3, "eddy_resistance": 4.0, "mu_plate": 0.1}


def sawtooth(it: Rig, steps: int, h: float = H) -> list[dict[str, float]]:
    """A command of 20 Hz and 8 V; every step's outputs."""
    found = []
    for _ in range(steps):
        phase = (it.time + 1e-9) * 20.0 % 1.0 - 20e-9
        it.set(command=-5.2 + 8.0 * phase, command_slope=160.0)
        it.step(h)
        found.append(it.outputs())
    return found


def test_both_versions_solve_the_source_alike() -> None:
    with rig(2) as a, rig(3) as b:
        assert sawtooth(a.begin(SOURCE), 700) == sawtooth(b.begin(SOURCE), 700)


@pytest.mark.parametrize("contact", [1, 2])
def test_the_source_does_not_mind_how_long_the_steps_are(version: int, contact: int) -> None:
    with rig(version) as short, rig(version) as long:
        for it in (short, long):
            it.begin(SOURCE | {"contact": contact})
        fine, coarse = sawtooth(short, 700), sawtooth(long, 14, 50 * H)
    for name, value in coarse[-1].items():
        if not name.endswith(("_max", "_min")) and not name.startswith("internal"):
            assert value == pytest.approx(fine[-1][name], rel=1e-6, abs=1e-9), name
    assert {found["output_clamped"] for found in fine} == {0, -1}
    assert max(found["coil_current_max"] for found in fine) == pytest.approx(0.7, rel=1e-9)
    assert min(found["coil_current_min"] for found in fine) == pytest.approx(
        min(found["coil_current_min"] for found in coarse), rel=1e-3
    )


def test_a_state_within_a_limit_brings_back_every_bit(version: int) -> None:
    with rig(version) as it:
        it.begin(SOURCE)
        assert sawtooth(it, 501)[-1]["output_clamped"] == -1
        kept, time = it.save(), it.time
        first = sawtooth(it, 50)
        it.load(kept)
        it.time = time
        assert sawtooth(it, 50) == first


def test_derivatives_of_the_command_in_fmi_2() -> None:
    with rig(2) as a, rig(2) as b:
        for it in (a, b):
            it.begin(SOURCE)
            it.set(command=0.5)
        a.set(command_slope=-300.0)
        b.fmu.setRealInputDerivatives([b._reference("command")], [1], [-300.0])
        a.step()
        b.step()
        assert a.outputs() == b.outputs()


def test_a_source_needs_a_free_surface(version: int) -> None:
    with rig(version) as it, pytest.raises(FMICallException):
        it.begin({"source": 1, "prescribed": 1})
    assert any("source must be 0" in message for message in it.messages)


# ---- states ----


def test_a_state_brings_back_every_bit(version: int) -> None:
    with rig(version) as it:
        it.begin()
        trajectory(it, 700)
        state, time = it.fmu.getFMUState(), it.time
        first = trajectory(it, 300)
        it.fmu.setFMUState(state)
        it.time = time
        assert trajectory(it, 300) == first
        it.fmu.freeFMUState(state)


def test_a_serialised_state_goes_on_in_another_process_and_version(tmp_path: Path) -> None:
    program = f"""
import importlib.util, sys
spec = importlib.util.spec_from_file_location("test_fmi", {str(Path(__file__))!r})
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
with module.rig(3) as it:
    it.load(open(sys.argv[1], "rb").read())
    for row in module.trajectory(it, 200):
        print(*(float(value).hex() for value in row.values()))
"""
    with rig(2) as it:
        it.begin()
        trajectory(it, 700)
        (tmp_path / "state").write_bytes(it.save())
        expected = trajectory(it, 200)
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "state")],
        cwd=Path(fmu.__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [[float(value).hex() for value in row.values()] for row in expected]
    assert [line.split() for line in done.stdout.splitlines()] == lines


@pytest.mark.parametrize("fault", ["magic", "token", "content", "short", "empty"])
def test_foreign_states_are_refused(version: int, fault: str) -> None:
    with rig(version) as it:
        it.begin()
        good = it.save()
        bad = bytearray(good)
        if fault == "short":
            bad = bad[:-8]
        elif fault == "empty":
            bad = bad[:0]
        else:
            bad[{"magic": 0, "token": 30, "content": 200}[fault]] ^= 1
        with pytest.raises(FMICallException):
            it.fmu.deserializeFMUState(bytes(bad))
        assert "state" in it.messages[-1]
        assert it.save() == good


NAN, MANY, FAR = (struct.pack("d", value) for value in (math.nan, 1e300, -1e9))
# The state ends with time, stop time and whether there is one, whether the tolerance was set,
# whether outputs are stale, and the phase. The parameter is found by its value.
WILD = {
    "no phase": (-4, struct.pack("i", 3)),
    "phase of another": (-4, struct.pack("i", 1)),
    "no flag": (-8, struct.pack("i", 7)),
    "time": (-32, NAN),
    "endless time": (-32, struct.pack("d", -math.inf)),
    "parameter": ("ram_mass", NAN),
    "parameter too large": ("ram_mass", MANY),
    "parameter below 0": ("ram_mass", FAR),
    "input": ("normal_force", FAR),
    "slope": ("normal_force_slope", NAN),
}


def sum_of(state: bytes) -> int:
    """FNV-1a."""
    found = 0xCBF29CE484222325
    for byte in state:
        found = (found ^ byte) * 0x100000001B3 % 2**64
    return found


@pytest.mark.parametrize("fault", WILD)
def test_a_wild_state_with_a_right_checksum_is_refused(version: int, fault: str) -> None:
    place, value = WILD[fault]
    with rig(version) as it:
        known = {"ram_mass": 0.0041234, "normal_force": 0.512345, "normal_force_slope": 0.0012345}
        it.begin({"ram_mass": known["ram_mass"]})
        it.set(**{name: known[name] for name in ("normal_force", "normal_force_slope")})
        good = it.save()
        head, state = good[:88], bytearray(good[88:])
        assert struct.unpack("Q", head[16:24])[0] == sum_of(bytes(state))
        at = len(state) + place if isinstance(place, int) else -1
        if isinstance(place, str):
            at = state.index(struct.pack("d", known[place]))
        state[at : at + len(value)] = value
        bad = head[:16] + struct.pack("Q", sum_of(bytes(state))) + head[24:] + bytes(state)
        with pytest.raises(FMICallException):
            it.fmu.deserializeFMUState(bad)
        assert "not a state of the FMU: its " in it.messages[-1]
        assert it.save() == good
        it.step()


# ---- refusals ----

BAD_VALUES = [
    ("current", math.nan),
    ("current", math.inf),
    ("current", -math.inf),
    ("current", 1e7),
    ("current_slope", math.nan),
    ("normal_force", -1e-3),
    ("normal_force_slope", -math.inf),
    ("ram_mass", 0.0),
    ("ram_mass", math.nan),
    ("restitution", 1.5),
    ("tolerance", 0.0),
    ("contact", 0),
    ("contact", 3),
    ("n_surfaces", -(2**31)),
    ("z_part", 0.0),
    ("sticking", 1),
]


@pytest.mark.parametrize(("name", "value"), BAD_VALUES)
def test_bad_values_are_refused_and_change_nothing(version: int, name: str, value: float) -> None:
    with rig(version) as it:
        before = it.save()
        with pytest.raises(FMICallException) as caught:
            it.set(**{name: value})
        assert caught.value.status == 3
        assert name in it.messages[-1]
        assert it.save() == before


@given(value=st.floats(), name=st.sampled_from(["current", "normal_force", "current_slope"]))
def test_an_input_is_taken_as_it_is_or_refused(value: float, name: str) -> None:
    with rig(2) as it:
        it.begin()
        variable = it.variables[name]
        before = it.save()
        if float(variable.min or 0) <= value <= float(variable.max or 0):
            it.set(**{name: value})
            assert it.get(name) == value
        else:
            with pytest.raises(FMICallException):
                it.set(**{name: value})
            assert it.save() == before


def test_several_values_are_set_all_or_none(version: int) -> None:
    with rig(version) as it:
        it.begin()
        before = it.save()
        with pytest.raises(FMICallException):
            it.set(current=0.5, normal_force=math.nan)
        assert it.save() == before


def test_parameters_are_fixed_after_initialisation(version: int) -> None:
    with rig(version) as it:
        it.begin()
        for name, value in (("ram_mass", 0.002), ("contact", 2)):
            with pytest.raises(FMICallException):
                it.set(**{name: value})
            assert name in it.messages[-1]


def test_contradicting_parameters_are_refused_at_initialisation(version: int) -> None:
    with rig(version) as it:
        it.set(mu_k=0.8)
        it.enter()
        with pytest.raises(FMICallException):
            it.fmu.exitInitializationMode()
        assert "mu_k" in it.messages[-1]
        it.set(mu_k=0.5)
        it.fmu.exitInitializationMode()
        it.step()


@pytest.mark.parametrize(
    ("time", "h"),
    [
        (0.01, 0.0),
        (0.01, -1e-4),
        (0.01, math.nan),
        (0.01, math.inf),
        (0.0, 1e-4),
        (0.0100001, 1e-4),
        (math.nan, 1e-4),
        (math.inf, 1e-4),
        (0.01, 0.02),
    ],
)
def test_bad_steps_are_refused_and_change_nothing(version: int, time: float, h: float) -> None:
    with rig(version) as it:
        it.begin(stopTime=0.02)
        it.step(0.01)
        before = it.save()
        with pytest.raises(FMICallException) as caught:
            it.fmu.doStep(time, h)
        assert caught.value.status == 3
        assert "DoStep" in it.messages[-1]
        assert it.save() == before
        it.step(0.01)


@pytest.mark.parametrize(
    ("parameters", "inputs", "reason"),
    [
        ({}, {"normal_force_slope": -1e6}, "normal_force falls below 0 N"),
        ({"suspension_k2": 1e15, "travel": 1e3}, {"current": 10.0}, "range of numbers"),
    ],
)
def test_a_failed_step_changes_nothing(
    version: int, parameters: dict[str, float], inputs: dict[str, float], reason: str
) -> None:
    with rig(version) as it:
        it.begin(parameters)
        it.set(**inputs)
        before = it.save()
        with pytest.raises(FMICallException):
            it.step()
        assert reason in it.messages[-1]
        assert it.save() == before


def test_unknown_references_are_refused(version: int) -> None:
    with rig(version) as it:
        it.begin()
        before = it.save()
        for integer in (False, True):
            for reference in (500, 999, 5000, 2**32 - 1):
                with pytest.raises(FMICallException):
                    it._getter(integer)([reference])
                with pytest.raises(FMICallException):
                    it._setter(integer)([reference], [0])
                assert "value reference" in it.messages[-1]
        with pytest.raises(FMICallException):
            it._setter(False)([0], [0.0])
        with pytest.raises(FMICallException):
            it.fmu.getDirectionalDerivative([1], [it._reference("current")], [1.0])
        assert it.save() == before


def test_calls_in_the_wrong_state_are_refused(version: int) -> None:
    with rig(version) as it:
        wrong: list[tuple[str, Callable[[], Any]]] = [
            ("before", it.step),
            ("before", lambda: it.get("z_part")),
            ("before", it.fmu.exitInitializationMode),
            ("before", it.fmu.terminate),
        ]
        for word, call in wrong:
            with pytest.raises(FMICallException):
                call()
            assert word in it.messages[-1]
        it.enter()
        with pytest.raises(FMICallException):
            it.step()
        with pytest.raises(FMICallException):
            it.enter()
        it.fmu.exitInitializationMode()
        it.step()
        it.fmu.terminate()
        assert it.get("time") == H
        for call in (it.step, lambda: it.set(current=0.1), it.fmu.terminate):
            with pytest.raises(FMICallException):
                call()
            assert "after termination" in it.messages[-1]


def test_a_wrong_token_is_refused(version: int) -> None:
    messages: list[str] = []
    with pytest.raises(Exception, match="nstantiate"):
        Rig(version, token="{another}", messages=messages)
    assert "another build" in messages[-1]


@pytest.mark.parametrize("tolerance", [math.nan, -1.0, 0.5])
def test_a_bad_tolerance_is_refused(version: int, tolerance: float) -> None:
    with rig(version) as it:
        with pytest.raises(FMICallException):
            it.enter(tolerance=tolerance)
        assert "tolerance" in it.messages[-1]


def test_a_stop_before_the_start_is_refused(version: int) -> None:
    with rig(version) as it, pytest.raises(FMICallException):
        it.enter(startTime=1.0, stopTime=0.5)


def test_what_is_not_provided_says_so(version: int) -> None:
    with rig(version) as it:
        it.begin()
        call = it.fmu.cancelStep if version == 2 else it.fmu.enterEventMode
        with pytest.raises(FMICallException):
            call()
        assert "does not provide" in it.messages[-1]
        setter = it.fmu.setBoolean if version == 2 else it.fmu.setFloat32
        with pytest.raises(FMICallException):
            setter([1], [1])
        assert "no variable of this type" in it.messages[-1]


# ---- tunable parameters ----


def test_a_smaller_friction_lets_the_part_go_from_there_on(version: int) -> None:
    """Of a surface at rest: with mu_k F_n < m g the part falls with g - mu_k F_n/m; what comes back
    stops it with mu_k F_n/m - g."""
    g, mass, normal = 9.81, 0.009, 0.5
    slow, brake = g - 0.1 * normal / mass, 0.59 * normal / mass - g
    with rig(version) as it:
        it.begin({"flexure_stiffness": 1e9, "flexure_damping": 1e4})
        for _ in range(10):
            it.step()
        assert it.get("sticking") == 1
        it.set(mu_s=0.12)  # mu_k is still above: no step until it is not
        with pytest.raises(FMICallException):
            it.step()
        assert "mu_k" in it.messages[-1]
        it.set(mu_k=0.1)
        height = it.get("z_part")
        for _ in range(100):
            it.step()
        assert it.get("sticking") == 0
        assert it.get("v_part") == pytest.approx(-slow * 100 * H, rel=1e-6)
        assert it.get("z_part") - height == pytest.approx(-slow * (100 * H) ** 2 / 2, rel=1e-5)
        it.set(mu_s=0.72, mu_k=0.59)
        steps = int(slow * 100 * H / brake / H)
        for _ in range(steps):
            it.step()
        left = slow * 100 * H - brake * steps * H
        assert it.get("v_part") == pytest.approx(-left, abs=1e-6)
        for _ in range(3):
            it.step()
        assert it.get("sticking") == 1


def test_a_plate_that_comes_into_touch_holds_the_part(version: int) -> None:
    """mu_plate from 0 on, and back: the part that slides down is stopped, and let go again."""
    with rig(version) as it:
        it.begin({"flexure_stiffness": 1e9, "flexure_damping": 1e4, "mu_s": 0.1, "mu_k": 0.1})
        for _ in range(100):
            it.step()
        falls = it.get("v_part")
        assert falls == pytest.approx(-(9.81 - 0.1 * 0.5 / 0.009) * 100 * H, rel=1e-5)
        it.set(mu_plate=0.3)
        for _ in range(10):
            it.step()
        upwards = (0.1 + 0.3) * 0.5 / 0.009 - 9.81
        assert it.get("v_part") == pytest.approx(falls + upwards * 10 * H, rel=1e-5)
        for _ in range(200):
            it.step()
        assert it.get("v_part") == pytest.approx(0.0, abs=1e-12)
        it.set(mu_plate=0.0)
        for _ in range(10):
            it.step()
        assert it.get("v_part") == pytest.approx(-(9.81 - 0.1 * 0.5 / 0.009) * 10 * H, rel=1e-5)


def test_limits_of_the_source_follow_their_parameters(version: int) -> None:
    """Of a held coil: R_s I at the current limit; a clamped output's current, from the closed form
    of a coil behind a resistance."""
    loop, inductance = 7.1 + 4.0, 1.2e-3
    with rig(version) as it:
        # too heavy a ram to move: no back-EMF
        it.begin({"source": 1, "ram_mass": 1e3, "suspension_k1": 1e12, "flexure_stiffness": 1e12})
        it.set(command=4.0)
        for _ in range(100):
            it.step()
        assert it.get("coil_current") == pytest.approx(1.0, rel=1e-6)
        it.set(output_high=5.55)
        for h in range(1, 8):
            it.step()
            settled = 5.55 / loop
            decay = math.exp(-loop / inductance * h * H)
            expected = settled + (1.0 - settled) * decay
            # while the output is as low as it can be, until the current meets what it can hold
            if it.get("output_clamped") == 1:
                assert it.get("coil_current") == pytest.approx(expected, rel=1e-6)
        assert it.get("output_clamped") == 1
        it.set(output_high=14.0, current_limit=0.25)
        for _ in range(100):
            it.step()
        assert it.get("coil_current") == pytest.approx(0.25, rel=1e-9)
        assert it.get("command_limited") == 1
        it.set(current_limit=2.5)
        for _ in range(100):
            it.step()
        assert it.get("coil_current") == pytest.approx(1.0, rel=1e-9)


def test_a_parameter_set_to_what_it_is_changes_no_bit(version: int) -> None:
    with rig(version) as plain, rig(version) as tuned:
        plain.begin()
        tuned.begin()
        for _ in range(300):
            row = command(plain.time)
            plain.set(current=row)
            tuned.set(current=row, mu_s=0.72, mu_k=0.59, output_high=14.0, current_limit=2.504)
            plain.step()
            tuned.step()
        assert plain.outputs() == tuned.outputs()
