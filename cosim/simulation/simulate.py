"""Runs a scene: picks the participants that its rung has, couples them, and gathers the result."""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop import coupling
from cosim.coupling.loop.compiled import CompiledRecorder
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import Command, command, commands
from cosim.files.spill import Tape, blocks
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import WITHOUT_NGSPICE, Scene, changed
from cosim.scene.tables import LED
from cosim.simulation import electrics
from cosim.simulation.summary import summarise
from cosim.toolchain.isolation import isolated

if TYPE_CHECKING:
    from cosim.coupling.loop.run import CircuitRun

Array = npt.NDArray[np.float64]

_INTERVALS = 4096
"""How many intervals of a command are prepared at a time."""

UNITS = {
    "time": "s",
    "command": "V",
    "current": "A",
    "coil_voltage": "V",
    "back_emf": "V",
    "z_surface": "m",
    "v_surface": "m/s",
    "a_surface": "m/s2",
    "z_ram": "m",
    "v_ram": "m/s",
    "z_part": "m",
    "v_part": "m/s",
    "friction_force": "N",
    "sticking": "1",
    "normal_force": "N",
    "command_2": "V",
    "current_2": "A",
    "coil_voltage_2": "V",
    "back_emf_2": "V",
    "z_surface_2": "m",
    "v_surface_2": "m/s",
    "a_surface_2": "m/s2",
    "z_ram_2": "m",
    "v_ram_2": "m/s",
    "friction_force_2": "N",
    "sticking_2": "1",
}
"""The columns of the waveforms, in order, and their units. Absent participants have none."""


@dataclass(frozen=True)
class Result:
    """A finished run: the scene, its waveforms (arrays of equal length, SI) and its summary.

    The arrays of a long run are mapped from a file that goes with them.
    """

    scene: Scene
    waveforms: dict[str, Array]
    summary: dict[str, object]


def simulate(
    scene: Scene,
    progress: Callable[[float], None] = lambda _: None,
    fmi_version: int = 3,
    compiled: bool = True,
) -> Result:
    """Run a scene. ``progress`` is told the simulated time (s) now and then.

    Not ``compiled``, every step goes through Python, as on a machine without a C compiler; the
    numbers are the same.

    A netlist of the user's own runs in a process of its own, as does every circuit after ngspice
    has given up in this one. Raises BadInput for a netlist that cannot be used, SimulationFailed
    with where, when, and what to try.
    """
    if scene.circuit.model == "auto":
        return _by_itself(scene, progress, fmi_version, compiled)
    if scene.surface_is_given:
        from cosim.simulation.given_surface import simulate_part

        waveforms, summary = simulate_part(scene, progress)
        return Result(scene, waveforms, summary | {"versions": versions()})
    if scene.coupling.method == "auto" and scene.circuit.model in LED:
        from cosim.simulation.choose_steps import simulate_within_tolerance

        return simulate_within_tolerance(
            scene, lambda chosen: simulate(chosen, progress, fmi_version, compiled)
        )
    if _needs_own_process(scene):
        return isolated(_simulate, scene, progress, fmi_version=fmi_version, compiled=compiled)
    return _simulate(scene, progress, fmi_version, compiled)


def _by_itself(
    scene: Scene, progress: Callable[[float], None], fmi_version: int, compiled: bool
) -> Result:
    """The run of the cheapest rung that suffices; what it took to find it is part of its time."""
    from cosim.simulation.choose_rung import choose

    began = time.perf_counter()
    choice = choose(scene)
    taken = changed(scene, {"circuit.model": choice.model}, "auto")
    result = simulate(taken, progress, fmi_version, compiled)
    found = {
        "circuit_model": choice.model,
        "circuit_model_why": choice.why,
        "circuit_model_errors": choice.errors,
        "wall_time": time.perf_counter() - began,
    }
    return Result(taken, result.waveforms, result.summary | found)


def _needs_own_process(scene: Scene) -> bool:
    model = scene.circuit.model
    if model == "file" or model in WITHOUT_NGSPICE:
        return model == "file"
    # PySpice and ngspice are loaded only for those who run a circuit.
    from cosim.circuit.ngspice import spoilt

    return spoilt()


def _simulate(
    scene: Scene, progress: Callable[[float], None], fmi_version: int, compiled: bool
) -> Result:
    began = time.perf_counter()
    drive, *second_drive = commands(scene)
    mechanics = Mechanics(scene, fmi_version)
    try:
        recorder = _recorder(scene, mechanics, progress, compiled)
        electric, circuit = None, None
        second: dict[str, Array] = {}
        if scene.circuit.model == "none":
            recorder.advance(scene.run.duration, 0.0, 0.0)
        elif scene.circuit.model == "ideal":
            share = 1.0 / (scene.circuit.sense_resistance * scene.coil.count)
            logs = _prescribe(scene, [drive, *second_drive], recorder, share)
            motion = mechanics.totals()["energy_in"]
            electric = electrics.from_command(
                scene, drive, logs[0], recorder.time, recorder.column("back_emf"), motion
            )
            for command_2 in second_drive:
                other = electrics.from_command(
                    scene, command_2, logs[1], recorder.time, recorder.column("back_emf_2"), 0.0
                )
                electric = electrics.both(electric, other)
                second = {"current_2": other.current, "coil_voltage_2": other.coil_voltage}
        elif scene.circuit.model == "limited":
            _prescribe(scene, [drive, *second_drive], recorder, 1.0)
            electric = electrics.from_source(scene, drive, recorder)
            if second_drive:
                second = {
                    "current_2": recorder.column("coil_current_2"),
                    "coil_voltage_2": recorder.column("coil_voltage_2"),
                }
        else:
            from cosim.circuit.false_cycles import refuse_false
            from cosim.circuit.netlist import limits_at_work

            circuit = _circuit_run(scene, drive, recorder)
            circuit.run()
            log = circuit.log()
            refuse_false(scene, log, lambda finer: _circuit_log(finer, fmi_version, compiled))
            if scene.circuit.netlist is not None:
                electrics.refuse_foreign_coil(scene, log)
            electric = electrics.from_circuit(scene, drive, log, recorder.time, limits_at_work)
        for command_2 in second_drive:
            second["command_2"] = electrics.commanded(command_2, recorder.time)
        totals = mechanics.totals()
        steps = mechanics.steps
    finally:
        mechanics.close()
    summary = summarise(scene, recorder, totals, electric)
    summary |= {
        "circuit_steps": circuit.steps if circuit else 0,
        "circuit_rejected": circuit.attempts - circuit.steps if circuit else 0,
        "fmu_steps": steps,
        "wall_time": time.perf_counter() - began,
        "method": _method(scene),
        "versions": versions() | ({"ngspice": circuit.ngspice} if circuit else {}),
    }
    return Result(scene, _waveforms(scene, recorder, electric, second), summary)


def _method(scene: Scene) -> str:
    model = scene.circuit.model
    if model == "limited":
        return "monolithic"
    return "uncoupled" if model in WITHOUT_NGSPICE else scene.coupling.method


def _recorder(
    scene: Scene, mechanics: Mechanics, progress: Callable[[float], None], compiled: bool
) -> Recorder:
    # The compiled steps have one input, and are those of the default coupling.
    if mechanics.has_second or mechanics.normal_force is not None:
        compiled = False
    if scene.circuit.model in LED and scene.coupling.method != "step-locked":
        compiled = False
    made = CompiledRecorder if compiled else Recorder
    return made(scene, mechanics, progress)


def _circuit_run(scene: Scene, drive: Command, recorder: Recorder) -> "CircuitRun":
    if isinstance(recorder, CompiledRecorder):
        from cosim.coupling.loop.compiled_run import CompiledRun

        return CompiledRun(scene, drive, recorder)
    from cosim.coupling.loop.run import CircuitRun

    return CircuitRun(scene, drive, coupling(scene, recorder, drive))


def _circuit_log(scene: Scene, fmi_version: int, compiled: bool) -> dict[str, Array]:
    """The circuit's waveforms of a run of which nothing else is wanted."""
    mechanics = Mechanics(scene, fmi_version)
    try:
        recorder = _recorder(scene, mechanics, lambda _: None, compiled)
        circuit = _circuit_run(scene, command(scene), recorder)
        circuit.run()
        return circuit.log()
    finally:
        mechanics.close()


def _prescribe(
    scene: Scene, drives: list[Command], recorder: Recorder, share: float
) -> list[dict[str, Array]]:
    """Give the mechanics ``share`` times each surface's command, from corner to corner.

    With the rung ``ideal`` that is the coil's current, whatever voltage it takes (A/V); with
    ``limited`` the command itself.
    """
    duration = scene.run.duration
    times, logs = Tape(1), [Tape(2) for _ in drives]
    times.append(0.0)
    reached = 0.0
    while reached < duration:
        edges = [reached]
        ends: list[list[tuple[float, float]]] = [[] for _ in drives]
        while edges[-1] < duration and len(edges) <= _INTERVALS:
            begin = edges[-1]
            stop = min(
                duration,
                *(drive.next_corner(begin) for drive in drives),
                *(begin + drive.longest_straight for drive in drives),
            )
            edges.append(stop)
            for drive, values in zip(drives, ends, strict=True):
                values.append((share * drive.value(begin), share * drive.value_before(stop)))
        reached = edges[-1]
        _follow(recorder, edges, ends)
        times.append(edges[1:])
        for log, values in zip(logs, ends, strict=True):
            log.append(values)
    return [{"time": times.column(), "start": log.column(0), "end": log.column(1)} for log in logs]


def _follow(recorder: Recorder, edges: list[float], ends: list[list[tuple[float, float]]]) -> None:
    if len(ends) == 1:
        recorder.follow(np.array(edges[1:]), *np.array(ends[0]).T)
        return
    for k, stop in enumerate(edges[1:]):
        value, value_end = ends[1][k]
        recorder.mechanics.give_second(value, (value_end - value) / (stop - edges[k]))
        recorder.advance(stop, *ends[0][k])


def _waveforms(
    scene: Scene,
    recorder: Recorder,
    electric: electrics.Electrics | None,
    second: dict[str, Array],
) -> dict[str, Array]:
    known = {"time": recorder.time} | second
    if electric is not None:
        known["command"] = electric.command
        known["current"] = electric.current
        known["coil_voltage"] = electric.coil_voltage
    columns = recorder.mechanics.columns
    known |= {name: recorder.rows[:, k] for k, name in enumerate(columns) if name in UNITS}
    if electric is None:
        del known["back_emf"]
    if scene.mechanics.actuator == "direct":
        del known["z_ram"], known["v_ram"]
    if (force := recorder.mechanics.normal_force) is not None:
        forces = Tape(1)
        for part in blocks(len(known["time"])):
            forces.append([force.value(t) for t in known["time"][part].tolist()])
        known["normal_force"] = forces.column()
    return {name: known[name] for name in UNITS if name in known}


def versions() -> dict[str, str]:
    """What made the result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    # Looked up once: it takes longer than a short run of the part alone.
    found = {"python": platform.python_version()}
    for package in ("cosim", "fmpy", "PySpice", "numpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found
