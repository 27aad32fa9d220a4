"""Runs a scene in this process, or, if it needs ngspice, in a worker process behind a fence.

Modules that only the worker needs are imported there, since their import takes a while.
"""

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.arrays import Array
from cosim.circuit.lint.deck import named
from cosim.errors import BadInput, plain
from cosim.files import spill
from cosim.files.resources import circuits
from cosim.files.spill import Packed, place
from cosim.scene import Scene
from cosim.toolchain import fence
from cosim.toolchain.libraries import ngspice_library
from cosim.toolchain.processes import end_idle, in_a_worker, isolated
from cosim.toolchain.threads import Progress
from cosim.toolchain.worker import Bounds, ProcessLost
from cosim.waveforms.result import Result


def one_run(scene: Scene, progress: Progress, alone: bool = False) -> Result:
    """The result of :func:`cosim.simulation.here.simulate_here`, in this process or a worker.
    Raises SimulationFailed also where the worker dies or hangs."""
    refuse_missing(scene)
    if in_a_worker() or not scene.rung.ngspice:
        from cosim.simulation.here import simulate_here

        with told(scene):
            return simulate_here(scene, progress, alone)
    ends: list[str] = []
    try:
        with told(scene):
            ran = isolated(_worked, (scene, alone), progress, bounds(scene), ends.append)
    except ProcessLost as lost:
        if not scene.fmu:
            raise
        names = ", ".join(fmu.name for fmu in scene.fmu)
        raise ProcessLost(
            f"{str(lost).rstrip('.')}; of its FMUs ({names}) one may be why."
        ) from None
    for how in ends:
        ran[1].setdefault("notes", []).append(
            f"all was computed when the simulation's process was lost ({how}): one of its "
            "FMUs may not stand its own end."
        )
    progress(scene.run.duration)
    return Result(scene, *ran)


def refuse_missing(scene: Scene) -> None:
    """Raise BadInput for a file that the scene names and that is not there."""
    for key, path in scene.files.items():
        if not os.path.exists(path) and (key != "circuit.netlist" or scene.rung.own_netlist):
            words = f'{plain(key)} = "{plain(path)}": there is no such file'
            cure = "a path counts from the scene's file, so move the two together"
            raise scene.bad(f"{words}." if key in scene.given else f"{words}; {cure}.")


@contextmanager
def told(scene: Scene) -> Iterator[None]:
    """Within this context a BadInput names the scene, or the option that gave the key at fault,
    too, unless it names a netlist's line: ports, ``circuit.save`` and parameters are checked where
    netlist and FMUs are read."""
    try:
        yield
    except BadInput as error:
        if not scene.rung.own_netlist or re.match(r".*?:\d+: ", str(error)):
            raise
        raise scene.bad(str(error)) from error


@contextmanager
def on_disk_in(folder: Path) -> Iterator[None]:
    """As :func:`cosim.files.spill.on_disk_in`, also for workers, which end with the block."""
    with spill.on_disk_in(folder):
        try:
            yield
        finally:
            end_idle(folder)


def bounds(scene: Scene) -> Bounds:
    """The files that a worker for the scene may read, and its libraries; scenes with the same files
    can share a worker. Raises BadInput where ngspice is missing."""
    files = scene.files
    netlist = files.pop("circuit.netlist", None)
    circuit = named(Path(netlist)) if netlist else [circuits()]
    reads = *map(str, circuit), *filter(_is_meant, files.values())
    return Bounds(reads, place(), ngspice_library(), _load)


def _is_meant(path: str) -> bool:
    """Whether a path is a file or the folder of an FMU; other folders must not be readable."""
    return Path(path).is_file() or Path(path, "modelDescription.xml").is_file()


def _load() -> None:
    """Load libraries before the fence closes: ngspice looks up the user, which it forbids."""
    from cosim.circuit import false_cycles  # noqa: F401
    from cosim.coupling.loop.lead import engine
    from cosim.simulation import here  # noqa: F401

    engine()


def _worked(
    given: tuple[Scene, bool], progress: Progress
) -> tuple[Packed | dict[str, Array], dict[str, Any], Mapping[str, str]]:
    """A run in a worker: waveforms, summary, units."""
    from cosim.simulation.here import simulate_here

    scene, alone = given
    result = simulate_here(scene, progress, alone)
    if scene.rung.own_netlist and fence.lacking and not alone:
        result.summary["notes"].append(
            f"this system has no {' and no '.join(fence.lacking)}: nothing but the reader's own "
            "checks stands between the netlist, or an FMU's code, and your files."
        )
    columns = {} if alone else Packed(result.columns)
    return columns, result.summary, dict(result.units)
