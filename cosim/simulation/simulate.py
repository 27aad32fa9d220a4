"""Runs a scene: gives the mechanics to its rung and gathers the result."""

import time
from collections.abc import Callable
from functools import partial

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.files.spill import Tape, blocks
from cosim.mechanics.part import Accounting
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, changed
from cosim.simulation.choose_rung import choose
from cosim.simulation.choose_steps import simulate_within_tolerance
from cosim.simulation.guards import notes
from cosim.simulation.numbers import motion, numbers
from cosim.simulation.rungs.given_surface import lead_part
from cosim.simulation.rungs.rung import Driven, ended, rungs
from cosim.toolchain.processes import isolated
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.result import Result

Progress = Callable[[float], None]


def simulate(scene: Scene, progress: Progress = lambda _: None, fmi_version: int = 3) -> Result:
    """Run a scene. ``progress`` is told the simulated time (s) now and then.

    A netlist of the user's own runs in a process of its own, as does every circuit after ngspice
    has given up in this one. Raises BadInput for a netlist that cannot be used, SimulationFailed
    with where, when, and what to try.
    """
    again = partial(simulate, progress=progress, fmi_version=fmi_version)
    if scene.rung.automatic:
        return _cheapest(scene, again)
    if scene.surface_is_given:
        return _follow_surface(scene, progress)
    if scene.coupling.method == "auto" and scene.rung.ngspice:
        return simulate_within_tolerance(scene, again)
    if _needs_own_process(scene):
        return isolated(_simulate, scene, progress, fmi_version=fmi_version)
    return _simulate(scene, progress, fmi_version)


def _cheapest(scene: Scene, run: Callable[[Scene], Result]) -> Result:
    """The run of the cheapest rung that suffices; what it took to find it is part of its time."""
    began = time.perf_counter()
    choice = choose(scene, simulate)
    result = run(changed(scene, {"circuit.model": choice.model}, "auto"))
    found = {
        "circuit_model": choice.model,
        "circuit_model_why": choice.why,
        "circuit_model_errors": choice.errors,
        "wall_time": time.perf_counter() - began,
    }
    return Result(result.scene, result.columns, result.summary | found)


def _needs_own_process(scene: Scene) -> bool:
    if scene.rung.own_netlist or not scene.rung.ngspice:
        return scene.rung.own_netlist
    # PySpice and ngspice are loaded only for those who run a circuit.
    from cosim.circuit.ngspice import spoilt

    return spoilt()


def _follow_surface(scene: Scene, progress: Progress) -> Result:
    began = time.perf_counter()
    waveforms, moved = ended(lead_part(scene), Accounting.make)
    progress(scene.run.duration)
    summary = numbers(scene, moved, Driven(None, "exact"), 0, began)
    return Result(scene, waveforms, summary | {"notes": notes(scene, waveforms, summary)})


def _simulate(scene: Scene, progress: Progress, fmi_version: int) -> Result:
    began = time.perf_counter()
    mechanics = Mechanics(scene, fmi_version)
    try:
        recorder = Recorder(scene, mechanics, progress)
        driven = rungs()[scene.circuit.model].drive(scene, recorder)
        moved = motion(scene, recorder)
    finally:
        mechanics.close()
    summary = numbers(scene, moved, driven, recorder.steps, began)
    waveforms = _waveforms(scene, recorder, driven)
    told = {"notes": notes(scene, waveforms, summary, mechanics.normal_force)}
    return Result(scene, waveforms, summary | told)


def _waveforms(scene: Scene, recorder: Recorder, driven: Driven) -> dict[str, Array]:
    known = {"time": recorder.time, **driven.waves()}
    columns = recorder.mechanics.columns
    known |= {name: recorder.rows[:, k] for k, name in enumerate(columns) if name in COLUMNS}
    if driven.electric is None:
        del known["back_emf"]
    if scene.mechanics.actuator == "direct":
        del known["z_ram"], known["v_ram"]
    if (force := recorder.mechanics.normal_force) is not None:
        forces = Tape(1)
        for part in blocks(len(known["time"])):
            forces.append([force.before(t) for t in known["time"][part].tolist()])
        known["normal_force"] = forces.column()
    return {name: known[name] for name in COLUMNS if name in known}
