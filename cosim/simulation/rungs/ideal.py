"""Rung ``ideal``: the coil's current is the command's, whatever voltage it takes."""

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Block, Recorder
from cosim.drive.command import commands
from cosim.drive.pieces import Command
from cosim.drive.straights import straights
from cosim.files.spill import Tape, blocks
from cosim.scene import Scene
from cosim.simulation.rungs.electrics import Eddy, Electrics, commanded, magnetic, total
from cosim.simulation.rungs.rung import Driven, Led


class Ideal(Led):
    """The current is given; the coil's voltage follows from it."""

    names = ("ideal",)

    def lead(self, scene: Scene, recorder: Recorder) -> Generator[Block, None, Driven]:
        drives = commands(scene)
        share = 1.0 / (scene.circuit.sense_resistance * scene.coil.count)
        times, currents = Tape(1), [Tape(2) for _ in drives]
        times.append(0.0)
        for edges, start, end in straights(drives, scene.run.duration):
            start, end = share * start, share * end
            yield edges[1:], start, end
            times.append(edges[1:])
            for k, tape in enumerate(currents):
                tape.append(np.stack([start[:, k], end[:, k]], axis=1))
        logs = [
            {"time": times.column(), "start": tape.column(0), "end": tape.column(1)}
            for tape in currents
        ]
        motion = recorder.mechanics.totals()["energy_in"]
        rows = recorder.time
        electric = _electrics(scene, drives[0], logs[0], rows, recorder.column("back_emf"), motion)
        if len(drives) == 1:
            return Driven(electric)
        # The work that both coils did is in the first one's account.
        other = _electrics(scene, drives[1], logs[1], rows, recorder.column("back_emf_2"), 0.0)
        energies = ("energy_in", "energy_copper", "energy_magnetic")
        sums = {name: getattr(electric, name) + getattr(other, name) for name in energies}
        second = {"current_2": other.current, "coil_voltage_2": other.coil_voltage}
        return Driven(replace(electric, **sums), second=second)


def _electrics(
    scene: Scene, command: Command, log: dict[str, Array], rows: Array, emf: Array, motion: float
) -> Electrics:
    """From a prescribed current, linear on intervals: ``log`` holds ``time``, the intervals' ends
    (s), and ``start`` and ``end``, the current of one coil (A) at the two ends of each.

    ``emf`` is the back-EMF (V) at the rows, ``motion`` the work (J) that one coil did. The source
    gives whatever voltage the current takes, so what it delivers is the sum of where it goes.
    """
    coil, settle = scene.coil, scene.run.settle
    times, count = log["time"], len(log["start"])
    squares, eddy = 0.0, Eddy(scene)
    most, least = -np.inf, np.inf
    waves, done = Tape(2), 0
    # At the corners, and where settling ends.
    settled = max(0, int(np.searchsorted(times, settle, side="right")) - 1)
    for part in blocks(count):
        edges, start, end = times[part.start : part.stop + 1], log["start"][part], log["end"][part]
        h = np.diff(edges)
        squares += total(h, start**2 + start * end + end**2)
        slope = (end - start) / h
        stop = len(rows) if part.stop == count else int(np.searchsorted(rows, edges[-1]))
        branch = eddy.follow(h, start, end)
        for few in blocks(stop - done):
            row = rows[done:stop][few]
            at = np.clip(np.searchsorted(edges, row, side="right") - 1, 0, len(h) - 1)
            current = start[at] + slope[at] * (row - edges[at])
            voltage = coil.resistance * current + coil.inductance * slope[at] + emf[done:stop][few]
            if branch is not None:
                lag = slope[at] * eddy.tau
                rest = start[at] - branch[at] - lag
                voltage += eddy.resistance * (lag + rest * np.exp(-(row - edges[at]) / eddy.tau))
            waves.append(np.stack([current, voltage], axis=1))
        done = stop
        if part.start <= settled < part.stop:
            here = settled - part.start
            most = least = start[here] + slope[here] * (settle - edges[here])
        after = [end[max(settled - part.start, 0) :], start[max(settled + 1 - part.start, 0) :]]
        most = max(most, *(values.max(initial=-np.inf) for values in after))
        least = min(least, *(values.min(initial=np.inf) for values in after))
    squares /= 3.0
    heat = (coil.resistance + coil.count * scene.circuit.sense_resistance) * squares
    copper = coil.count * (heat + eddy.heat)
    held = magnetic(scene, float(log["end"][-1]), eddy.current)
    return Electrics(
        command=commanded(command, rows),
        current=waves.column(0),
        coil_voltage=waves.column(1),
        energy_in=copper + held + coil.count * motion,
        energy_copper=copper,
        energy_magnetic=held,
        current_max=float(most),
        current_min=float(least),
        limited={"output": 0.0},
    )
