"""One run of a circuit in ngspice, coupled to whatever gives it a back-EMF."""

from collections.abc import Callable, Sequence
from itertools import chain
from math import isfinite

import numpy as np
import numpy.typing as npt

from cosim.circuit.netlist import MOTIONAL, prepare
from cosim.circuit.ngspice import engine
from cosim.coupling.loop import Coupling
from cosim.drive.command import Command
from cosim.errors import SimulationFailed
from cosim.files.spill import Tape
from cosim.scene import Scene

_AFTER_JUMP, _SHARE_AFTER_JUMP = 1e-7, 1e-2
"""Longest step after a jump of the command, in s and in ``circuit.max_step``: what ngspice
remembers of the slopes before it misleads its choice of the step. The start is one too: V1 leaves 0
at once. This step is of first order and nothing judges it, so finer runs must shorten it too."""

_ON_TIME = 1e-13
"""s; ngspice's own sums of steps reach a time of ours only within rounding."""

_POINTS = 4096
"""How many points go into the log at a time."""


class CircuitRun:
    """ngspice leads; the coupling follows each step that it accepts.

    Steps end on the jumps of the command, and begin small after them.
    """

    def __init__(self, scene: Scene, command: Command, coupling: Coupling) -> None:
        self._scene = scene
        self._command = command
        self._coupling = coupling
        self._count = scene.coil.count
        self._jump = command.next_jump(0.0)
        self._after_jump = min(_AFTER_JUMP, _SHARE_AFTER_JUMP * scene.circuit.max_step)
        self._time = 0.0
        self._deck, self._saved = self._netlist()
        self._motional = self._saved.index(MOTIONAL) if MOTIONAL in self._saved else None
        self._log = Tape(2 + len(self._saved))
        self._new: list[tuple[float, ...]] = []
        """Points that are not in the log yet."""
        self.attempts = 0
        """Steps that ngspice tried."""

    @property
    def steps(self) -> int:
        """Steps that ngspice accepted."""
        return max(0, len(self._log) + len(self._new) - 1)

    @property
    def ngspice(self) -> str:
        """Version of ngspice."""
        return str(engine().ngspice_version)

    def log(self) -> dict[str, npt.NDArray[np.float64]]:
        """Time (s), the back-EMF given (V) and the saved vectors (A, V) at the accepted points."""
        names = ("time", "emf", *self._saved)
        self._keep()
        return dict(zip(names, self._log.array().T, strict=True))

    def _keep(self) -> None:
        self._log.append(np.fromiter(chain.from_iterable(self._new), np.float64))
        self._new = []

    def run(self) -> None:
        """Run to ``run.duration``. Raises SimulationFailed with the reason and the time reached."""
        duration = self._scene.run.duration
        self._lead()
        if self._time < duration * (1 - 1e-9):
            raise SimulationFailed(
                f"ngspice stopped at t = {self._time:.6g} s of {duration:g} s: {engine().said()}. "
                "If the circuit is right, a smaller circuit.max_step or another circuit.reltol may "
                "help."
            )

    def _netlist(self) -> tuple[str, tuple[str, ...]]:
        return prepare(self._scene)

    def _lead(self) -> None:
        engine().run_transient(self._deck, self._saved, self)

    # What ngspice asks for (see cosim.circuit.ngspice.Leader).

    def source(self, name: str) -> Callable[[float], float]:
        if name == "vemf":
            return self._coupling.back_emf
        if name == "vgain":
            count = self._count
            return lambda time: self._coupling.gain(time) / count
        if name == "vcommand":
            return self._held(self._command.value, self._command.value_before, 0.0)
        if name == "vdac":
            # At the start, where V1 = 0.
            offset = self._command.v_offset
            return self._held(self._command.v_dac, self._command.v_dac_before, offset)
        if name == "voffset":
            offset = self._command.v_offset
            return self._held(self._command.v_offset_at, self._command.v_offset_before, offset)
        raise unknown_source(name)

    def _held(
        self, value: Callable[[float], float], before: Callable[[float], float], start: float
    ) -> Callable[[float], float]:
        """A source that keeps its left limit until a step has ended on the jump."""

        def source(time: float) -> float:
            if time <= 0.0:
                return start
            if time >= self._jump - _ON_TIME:
                return before(self._jump)
            return value(time)

        return source

    def attempted(self) -> None:
        self.attempts += 1

    def accepted(self, time: float, values: Sequence[float], next_step: float) -> float:
        if not isfinite(sum(values)):
            raise out_of_range(time)
        motional = 0.0 if self._motional is None else values[self._motional]
        self._new.append((time, self._coupling.back_emf(time) + motional, *values))
        if len(self._new) == _POINTS:
            self._keep()
        self._time = time
        if time <= 0.0:
            return self._after_jump
        longest = self._coupling.accepted(time, values[0] / self._count, motional)
        if time >= self._jump - _ON_TIME:
            self._jump = self._command.next_jump(self._jump)
            longest = min(longest, self._after_jump)
        return min(next_step, longest, self._jump - time)


def unknown_source(name: str) -> SimulationFailed:
    """What to raise for an external source that is none of the agreed ones."""
    return SimulationFailed(f"The netlist has an external source {name} that nothing feeds.")


def out_of_range(time: float) -> SimulationFailed:
    """What to raise for values of the circuit that are not finite."""
    return SimulationFailed(f"The circuit left the range of numbers at t = {time:.6g} s.")
