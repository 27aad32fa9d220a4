"""Rung ``none`` with a command: no coil; the mechanics move by themselves."""

from collections.abc import Generator

import numpy as np

from cosim.coupling.loop.recorder import Block, Recorder
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Led


class Undriven(Led):
    """The coil carries no current."""

    names = ("none",)

    def lead(self, scene: Scene, recorder: Recorder) -> Generator[Block, None, Driven]:
        nothing = np.zeros((1, 1))
        yield np.array([scene.run.duration]), nothing, nothing
        return Driven(None)
