"""Rung ``none`` with a command: no coil; the mechanics move by themselves."""

import numpy as np

from cosim.coupling.loop.recorder import Recorder
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven


def drive(scene: Scene, recorder: Recorder) -> Driven:
    """The coil carries no current."""
    nothing = np.zeros((1, 1))
    recorder.follow(np.array([scene.run.duration]), nothing, nothing)
    return Driven(None)
