"""Runs a scene where it may run: in a worker process behind a fence if ngspice has a part in it.

What only the worker needs is not imported here, since it takes a while.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.arrays import Array
from cosim.circuit.joined import own_parameters
from cosim.circuit.lint.deck import named, read
from cosim.circuit.lint.elements import parse
from cosim.circuit.netlist import path_of
from cosim.errors import plain
from cosim.files import spill
from cosim.files.resources import circuits
from cosim.files.spill import Packed, place
from cosim.scene import Scene, changed
from cosim.toolchain import fence
from cosim.toolchain.libraries import ngspice_library
from cosim.toolchain.processes import Bounds, ProcessLost, Progress, end_idle, in_a_worker, isolated
from cosim.waveforms.result import Result


def one_run(scene: Scene, progress: Progress, fmi_version: int = 3, alone: bool = False) -> Result:
    """What :func:`cosim.simulation.here.simulate_here` gives, from where it may run. Raises also
    SimulationFailed where the process dies or hangs."""
    if in_a_worker() or not scene.rung.ngspice:
        from cosim.simulation.here import simulate_here

        return simulate_here(scene, progress, fmi_version, alone)
    try:
        ran = isolated(_worked, (scene, fmi_version, alone), progress, bounds(scene))
    except ProcessLost as lost:
        if not scene.fmu:
            raise
        names = ", ".join(fmu.name for fmu in scene.fmu)
        raise ProcessLost(
            f"{str(lost).rstrip('.')}; of its FMUs ({names}) one may be why."
        ) from None
    progress(scene.run.duration)
    return Result(scene, *ran)


def refuse_unknown(scene: Scene, names: Iterable[str]) -> None:
    """Raise BadInput where one of the keys ``table.key`` is no ``.param`` of the scene's netlist,
    or no parameter of its FMUs."""
    own = [name for name in names if name.startswith(("circuit.param.", "fmu."))]
    if not own:
        return
    scene = changed(scene, dict.fromkeys(own, 0.0), "--over")
    if scene.circuit.param and scene.rung.ngspice:
        path = path_of(scene)
        own_parameters(parse(read(path)), plain(str(path)), scene.circuit.param)
    files = {fmu.name: fmu.file for fmu in scene.fmu}
    asked = [(files[name.split(".")[1]], name) for name in own if name.startswith("fmu.")]
    if asked:
        isolated(_known, asked, lambda _: None, bounds(scene))


def _known(asked: Sequence[tuple[str, str]], progress: Progress) -> None:
    """Of an FMU's file and a key that is to be a parameter of it."""
    from cosim.coupling.ports.strangers import stranger

    for file, name in asked:
        stranger(file).settable(name.split(".", 2)[2], f"--over {plain(name)}")


@contextmanager
def on_disk_in(folder: Path) -> Iterator[None]:
    """What :func:`cosim.files.spill.on_disk_in` does, for runs in workers too, whose folders are
    gone at its end."""
    with spill.on_disk_in(folder):
        try:
            yield
        finally:
            end_idle(folder)


def bounds(scene: Scene) -> Bounds:
    """Of a worker for the scene, and for others with the same files. Raises BadInput where ngspice
    is missing."""
    files = scene.files
    netlist = files.pop("netlist", None)
    circuit = named(Path(netlist)) if netlist else [circuits()]
    reads = *map(str, circuit), *filter(_is_meant, files.values())
    return Bounds(reads, place(), ngspice_library(), (_load, None))


def _is_meant(path: str) -> bool:
    """A file, or the folder of an FMU: what lies below another is nobody's business."""
    return Path(path).is_file() or Path(path, "modelDescription.xml").is_file()


def _load(_: None) -> None:
    """Load what the run will: ngspice looks up whose process this is, which the fence forbids."""
    from cosim.circuit import false_cycles  # noqa: F401
    from cosim.coupling.loop.lead import engine
    from cosim.simulation import here  # noqa: F401

    engine()


def _worked(
    given: tuple[Scene, int, bool], progress: Progress
) -> tuple[Packed | dict[str, Array], dict[str, Any], Mapping[str, str]]:
    """A run in a worker: waveforms, summary, units."""
    from cosim.simulation.here import simulate_here

    scene, fmi_version, alone = given
    result = simulate_here(scene, progress, fmi_version, alone)
    if scene.rung.own_netlist and fence.lacking and not alone:
        result.summary["notes"].append(
            f"this system has no {' and no '.join(fence.lacking)}: nothing but the reader's own "
            "checks stands between the netlist, or an FMU's code, and your files."
        )
    columns = {} if alone else Packed(result.columns)
    return columns, result.summary, dict(result.units)
