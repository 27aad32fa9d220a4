"""Rung ``ideal``: the coil's current is the command's, whatever voltage it takes."""

from dataclasses import replace

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.agenda import SAME_TIME, count
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import commands
from cosim.drive.straights import straights
from cosim.files.spill import Tape, blocks
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Eddy, Electrics, coil_waves, magnetic, total
from cosim.toolchain.libraries import library


def drive(scene: Scene, recorder: Recorder) -> Driven:
    """The current is given; the coil's voltage follows from it."""
    drives = commands(scene)
    share = 1.0 / scene.sense
    coils = [_Coil(scene) for _ in drives]
    for edges, start, end in straights(drives, scene.run.duration):
        start, end = share * start, share * end
        recorder.follow(edges[1:], start, end)
        for k, coil in enumerate(coils):
            coil.follow(edges, start[:, k], end[:, k])
    motion = recorder.at_end["energy_in"]
    electric = coils[0].electrics(motion)
    if len(drives) > 1:
        # ``motion``, the work of both coils, is already in the first coil's balance.
        other = coils[1].electrics(0.0)
        energies = ("energy_in", "energy_copper", "energy_magnetic")
        sums = {name: getattr(electric, name) + getattr(other, name) for name in energies}
        electric = replace(electric, **sums)
    return Driven(
        electric,
        waves=lambda: coil_waves(
            drives, recorder, lambda k, end: coils[k].waves(recorder.column(f"back_emf{end}"))
        ),
    )


class _Coil:
    """Waveforms and energies of one coil whose current is prescribed, linear on intervals."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._squares, self._eddy = 0.0, Eddy(scene)  # 3 ∫ i² dt, A² s; the eddy branch
        self._most, self._least = -np.inf, np.inf
        self._last = 0.0
        self._waves = Tape(2, count(scene.run.output_step, scene.run.duration))
        self._waves.append([0.0, 0.0])  # the first row: at rest
        self._rows = count(scene.run.output_step, scene.run.duration)

    def follow(self, edges: Array, start: Array, end: Array) -> None:
        """Advance through the n intervals between ``edges`` (n + 1, s), with the current (n, A) at
        the start and the end of each."""
        scene, eddy = self._scene, self._eddy
        h = np.diff(edges)
        slope = (end - start) / h
        self._squares += total(h, start**2 + start * end + end**2)
        self._last = float(end[-1])
        # Extremes after settling: at both ends of each interval, the first one cut at ``settle``.
        late = edges[1:] > scene.run.settle
        if late.any():
            first = start[late] + slope[late] * np.maximum(scene.run.settle - edges[:-1][late], 0.0)
            self._most = max(self._most, float(first.max()), float(end[late].max()))
            self._least = min(self._least, float(first.min()), float(end[late].min()))
        branch = eddy.follow(h, start, end)
        step, first = scene.run.output_step, len(self._waves)
        stop = min(count(step, edges[-1] + SAME_TIME), self._rows)
        edges, start, end = (np.ascontiguousarray(values) for values in (edges, start, end))
        # Rows of current and voltage without back-EMF, which is added in ``waves``.
        for few in blocks(stop - first):
            rows = np.empty((few.stop - few.start, 2))
            library("loop").coil_rows(
                *(len(h), edges.ctypes.data, start.ctypes.data, end.ctypes.data),
                None if branch is None else branch.ctypes.data,
                *(scene.coil.resistance, scene.coil.inductance, eddy.resistance, eddy.tau),
                *(step, first + few.start, first + few.stop, rows.ctypes.data),
            )
            self._waves.append(rows)

    def waves(self, back_emf: Array) -> tuple[Array, Array]:
        """Current (A) and voltage (V) in the rows, for the back-EMF (V) in the rows."""
        waves, voltage = self._waves.array(), Tape(1, self._rows)
        for few in blocks(len(waves)):
            voltage.append(waves[few, 1] + back_emf[few])
        return self._waves.column(0), voltage.column()

    def electrics(self, motion: float) -> Electrics:
        """The balance at the end of the run; ``motion`` is the mechanical work (J) of one coil. The
        source has no limits, so the energy that it delivers is the sum of all other terms.
        """
        scene, coil = self._scene, self._scene.coil
        heat = (coil.resistance + scene.sense) * self._squares / 3.0
        copper = coil.count * (heat + self._eddy.heat)
        held = magnetic(scene, self._last, self._eddy.current)
        return Electrics(
            energy_in=copper + held + coil.count * motion,
            energy_copper=copper,
            energy_magnetic=held,
            current_max=self._most,
            current_min=self._least,
            limited={"output": 0.0},
        )
