"""The coupled loop: ngspice leads, a method couples, the recorder moves the mechanics."""

from typing import Protocol

from cosim.coupling.loop.led import Led
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.step_locked import StepLocked
from cosim.drive.command import Command
from cosim.scene import Scene


class Coupling(Protocol):
    """What the circuit knows of everything else."""

    def back_emf(self, time: float) -> float:
        """Back-EMF of the coil, V, at ``time`` (s), at or after the last accepted step."""
        ...

    def accepted(self, time: float, current: float, motional: float = 0.0) -> float:
        """The circuit has accepted a step to ``time`` (s), where one coil carries ``current`` (A).

        ``motional`` is the share of the back-EMF (V) that the circuit carries itself, if it does:
        it grows with ``gain`` times the current. Returns the longest step that the circuit may try
        next, s.
        """
        ...

    def gain(self, time: float) -> float:
        """Bl²/m_eff, V/(A s), of a circuit that carries a share of the back-EMF itself."""
        ...


def coupling(scene: Scene, recorder: Recorder, command: Command) -> Coupling:
    """The method of a scene whose circuit leads."""
    chosen = scene.coupling
    if chosen.method == "step-locked":
        return StepLocked(recorder)
    assert chosen.method != "auto", "it is another one by now"
    duration = scene.run.duration
    return Led(recorder, command, chosen.method, chosen.macro_step, chosen.order, duration)
