"""Runs a scene in this process: its rung drives the mechanics, and the result is gathered."""

import time
from contextlib import closing
from dataclasses import replace

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.errors import StepTooSmall
from cosim.files.spill import Tape, blocks
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.guards import remarks
from cosim.simulation.rungs.given_surface import move_part
from cosim.simulation.rungs.rung import Driven, drive
from cosim.simulation.summary import motion, numbers
from cosim.toolchain.threads import Progress
from cosim.waveforms.columns import COLUMNS, UNITS
from cosim.waveforms.result import Result

_MORE = 100.0
"""Factor on ``circuit.reltol`` for a netlist that ngspice cannot run with the scene's own."""


def simulate_here(scene: Scene, progress: Progress, alone: bool = False) -> Result:
    """The run of a scene without "auto" in circuit or coupling; with ``alone`` only its summary,
    without waveforms and notes. Raises as :func:`cosim.simulation.simulate.simulate` does."""
    try:
        return _simulated(scene, progress, alone)
    except StepTooSmall:
        if not scene.rung.own_netlist:
            raise
    from cosim.circuit.ngspice import LOOSER
    from cosim.coupling.loop.lead import engine

    own = scene.circuit.reltol
    looser = min(_MORE * own, 1e-2)
    with engine().looser():
        try:
            result, reltol = _simulated(scene, progress, alone), own
        except StepTooSmall:
            loose = scene.having(circuit={"reltol": looser})
            result, reltol = _simulated(loose, progress, alone), looser
    if not alone:
        result.summary["notes"].append(
            "no step was small enough for the circuit's tolerances; the run is with .options "
            f"{LOOSER} reltol={reltol:g}."
        )
    return replace(result, scene=scene)


def _simulated(scene: Scene, progress: Progress, alone: bool) -> Result:
    began = time.perf_counter()
    if scene.has_ports:
        from cosim.coupling.ports.results import joined

        return Result(scene, *joined(few_rows(scene) if alone else scene, progress))
    if scene.surface_is_given:
        (waveforms, moved), driven, force = move_part(scene), Driven(None, "exact"), None
        summary = numbers(scene, moved, driven, 0, began)
        progress(scene.run.duration)
    else:
        with closing(Mechanics(scene)) as mechanics:
            recorder = Recorder(scene, mechanics, progress)
            driven = drive(scene, recorder)
            summary = numbers(scene, motion(scene, recorder), driven, recorder.steps, began)
        summary |= driven.measured
        waveforms = {} if alone else _waveforms(scene, recorder, driven)
        force = mechanics.normal_force
    if alone:
        return Result(scene, {}, summary)
    told = remarks(scene, waveforms, summary, force)
    told["notes"] = [*driven.notes, *told["notes"]]
    units = dict(UNITS)
    if scene.circuit.save:
        from cosim.circuit.joined import unit

        units |= {name: unit(name) for name in scene.circuit.save}
    return Result(scene, waveforms, summary | told, units)


def few_rows(scene: Scene) -> Scene:
    """The scene with only as many rows as its summary needs."""
    return scene.having(run={"output_step": scene.run.duration / 2.0})


def _waveforms(scene: Scene, recorder: Recorder, driven: Driven) -> dict[str, Array]:
    known = {"time": recorder.time, **driven.waves()}
    columns = recorder.mechanics.columns
    known |= {name: recorder.rows[:, k] for k, name in enumerate(columns) if name in COLUMNS}
    if driven.electric is None:
        del known["back_emf"]
    if not scene.mechanics.free_ram:
        del known["z_ram"], known["v_ram"]
    if (force := recorder.mechanics.normal_force) is not None:
        forces = Tape(1)
        for part in blocks(len(known["time"])):
            forces.append([force.before(t) for t in known["time"][part].tolist()])
        known["normal_force"] = forces.column()
    return {name: known[name] for name in (*COLUMNS, *(scene.circuit.save or ())) if name in known}
