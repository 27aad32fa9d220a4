"""Rung ``limited``: the current source reduced to its limits, solved with the mechanics in the FMU.

The source's command is an input of the FMU; there is no ngspice.
"""

from functools import partial

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import commands
from cosim.drive.straights import straights
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Electrics, coil_waves


def drive(scene: Scene, recorder: Recorder) -> Driven:
    """One monolithic solution of source, coil and mechanics."""
    drives = commands(scene)
    for edges, start, end in straights(drives, scene.run.duration):
        recorder.follow(edges[1:], start, end)

    def waves(_: int, end: str) -> tuple[Array, Array]:
        return recorder.column(f"coil_current{end}"), recorder.column(f"coil_voltage{end}")

    return Driven(
        _electrics(scene, recorder),
        method="monolithic",
        waves=partial(coil_waves, drives, recorder, waves),
    )


def _electrics(scene: Scene, recorder: Recorder) -> Electrics:
    """The electrical results of the current source in the FMU, at the end of the run."""
    count, run = scene.coil.count, scene.run
    totals, before = recorder.at_end, recorder.at_settle
    share = {
        limit: (totals[name] - before[name]) / (run.duration - run.settle)
        for limit, name in (
            ("swing_high", "output_high_time"),
            ("swing_low", "output_low_time"),
            ("current_limit", "current_limit_time"),
        )
    }
    return Electrics(
        energy_in=count * totals["energy_output"],
        energy_copper=count * totals["energy_copper"],
        energy_magnetic=count * totals["energy_magnetic"],
        current_max=recorder.extremes[6],  # behind those of the surface
        current_min=recorder.extremes[7],
        limited=share | {"output": sum(share.values())},
    )
