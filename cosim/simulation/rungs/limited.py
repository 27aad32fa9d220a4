"""Rung ``limited``: the current source reduced to its limits, solved with the mechanics in the FMU.

The source's command is an input of the FMU; there is no ngspice.
"""

from collections.abc import Sequence
from functools import partial

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import commands
from cosim.drive.pieces import Command
from cosim.drive.straights import straights
from cosim.scene import Scene
from cosim.simulation.rungs.electrics import Electrics, commanded
from cosim.simulation.rungs.rung import Driven, Rung


class Limited(Rung):
    """One monolithic solution of source, coil and mechanics."""

    names = ("limited",)

    def drive(self, scene: Scene, recorder: Recorder) -> Driven:
        drives = commands(scene)
        for edges, start, end in straights(drives, scene.run.duration):
            recorder.follow(edges[1:], start, end)
        waves = partial(_waves, drives, recorder)
        return Driven(_electrics(scene, recorder), method="monolithic", waves=waves)


def _waves(drives: Sequence[Command], recorder: Recorder) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for drive, surface in zip(drives, ("", "_2"), strict=False):
        found[f"command{surface}"] = commanded(drive, recorder.time)
        found[f"current{surface}"] = recorder.column(f"coil_current{surface}")
        found[f"coil_voltage{surface}"] = recorder.column(f"coil_voltage{surface}")
    return found


def _electrics(scene: Scene, recorder: Recorder) -> Electrics:
    """From the mechanics' own current source, at the end of its run."""
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
        current_max=recorder.extremes[6],
        current_min=recorder.extremes[7],
        limited=share | {"output": sum(share.values())},
    )
