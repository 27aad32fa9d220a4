"""Runs a scene in this process: gives the mechanics to its rung and gathers the result."""

import time
from contextlib import closing
from typing import Any

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.files.spill import Tape, blocks
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.guards import remarks
from cosim.simulation.rungs.given_surface import move_part
from cosim.simulation.rungs.rung import Driven, rungs
from cosim.simulation.summary import motion, numbers
from cosim.toolchain.processes import Progress
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.result import Result


def simulate_here(scene: Scene, progress: Progress, fmi_version: int) -> Result:
    """The run of a scene whose circuit and coupling are chosen. Raises as
    :func:`cosim.simulation.simulate.simulate` does."""
    if scene.has_ports:
        return _joined(scene, progress)
    if scene.surface_is_given:
        waveforms, summary = _followed_surface(scene)
        progress(scene.run.duration)
        return Result(scene, waveforms, summary | remarks(scene, waveforms, summary))
    with closing(Mechanics(scene, fmi_version)) as mechanics:
        recorder, driven, summary = _driven(scene, mechanics, progress)
    waveforms = _waveforms(scene, recorder, driven)
    told = remarks(scene, waveforms, summary, mechanics.normal_force)
    return Result(scene, waveforms, summary | told)


def summary_here(scene: Scene, progress: Progress) -> dict[str, Any]:
    """The summary alone, without notes."""
    if scene.has_ports:
        return _joined(few_rows(scene), progress).summary
    if scene.surface_is_given:
        return _followed_surface(scene)[1]
    with closing(Mechanics(scene)) as mechanics:
        return _driven(scene, mechanics, progress)[2]


def _joined(scene: Scene, progress: Progress) -> Result:
    from cosim.coupling.ports.results import joined

    return Result(scene, *joined(scene, progress))


def few_rows(scene: Scene) -> Scene:
    """The scene with as few rows as its summary needs."""
    if scene.run.average == "slope":
        return scene  # the rows show the part's way
    rows = {"output_step": scene.run.duration / 2.0}
    return scene.model_copy(update={"run": scene.run.model_copy(update=rows)})


def _followed_surface(scene: Scene) -> tuple[dict[str, Array], dict[str, Any]]:
    began = time.perf_counter()
    waveforms, moved = move_part(scene)
    return waveforms, numbers(scene, moved, Driven(None, "exact"), 0, began)


def _driven(
    scene: Scene, mechanics: Mechanics, progress: Progress
) -> tuple[Recorder, Driven, dict[str, Any]]:
    began = time.perf_counter()
    recorder = Recorder(scene, mechanics, progress)
    driven = rungs()[scene.circuit.model].drive(scene, recorder)
    summary = numbers(scene, motion(scene, recorder), driven, recorder.steps, began)
    return recorder, driven, summary


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
    return {name: known[name] for name in COLUMNS if name in known}
