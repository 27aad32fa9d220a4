"""What each rung with mechanics does with them; one rung a file.

``cosim/scene/rungs.py`` declares the rungs and the keys that each uses.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array, slope
from cosim.coupling.loop.recorder import Recorder
from cosim.files.declared import modules
from cosim.scene import Scene
from cosim.scene.tables import Run
from cosim.simulation.rungs.electrics import Electrics
from cosim.trials.camera import FRAME_RATE, frame_times


@dataclass(frozen=True)
class Driven:
    """What a rung has done to the mechanics by the end of the run."""

    electric: Electrics | None
    """The account of the coil; None where there is none."""
    method: str = "uncoupled"
    """How circuit and mechanics were joined."""
    circuit_steps: int = 0
    circuit_rejected: int = 0
    versions: Mapping[str, str] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)
    """Numbers for the summary that the netlist itself asks for."""
    notes: Sequence[str] = ()
    waves: Callable[[], Mapping[str, Array]] = dict
    """Makes the columns of the coils: a value for each row of the waveforms. In a row at a jump
    stands what is before it, as in the mechanics' columns, whose state a row is: the first row is
    the machine at rest, without command and current."""


@dataclass(frozen=True)
class Motion:
    """What surface and part did in a run; SI."""

    totals: Mapping[str, float]
    """At the end, counted from the start, of one actuator: the part's height, times, counts and
    energies by the names of the mechanics' outputs; ``energy_in`` is what the coil's force, or the
    surface that is given its velocity, has done."""
    at_settle: Mapping[str, float]
    """The same when settling ended."""
    extremes: Mapping[str, float]
    """After settling, largest and smallest ``a_surface``, ``v_surface`` and ``z_surface``; infinite
    where there is none."""
    frames: npt.NDArray[np.float64]
    """The surface's height at each instant of the camera's frames after settling."""
    slope: float | None
    """Of the straight line through the part's heights after settling, m/s; None where
    ``run.average`` does not ask for it."""
    ram: float | None = None
    """Where the ram is in its actuator in the last row, m; None where there is no ram."""


def average_slope(run: Run, time: Array, heights: Array) -> float | None:
    """``slope`` of a motion whose part has ``heights`` (m) at ``time`` (s)."""
    if run.average == "ends":
        return None
    # A record's length in a scene is rounded, to less than a hundredth of a frame.
    frames = frame_times(run.settle, int((run.duration - run.settle) * FRAME_RATE + 0.01) + 1)
    return slope(frames, np.interp(frames, time, heights))


class Rung(ABC):
    """A way to drive the mechanics."""

    names: ClassVar[tuple[str, ...]]
    """Values of ``circuit.model``."""

    @abstractmethod
    def drive(self, scene: Scene, recorder: Recorder) -> Driven:
        """Move the recorder's mechanics from 0 to ``run.duration``.

        Raises BadInput and SimulationFailed.
        """


@cache
def rungs() -> dict[str, Rung]:
    """Each rung with mechanics by its names; a file in this folder is a rung."""
    modules(__name__.rpartition(".")[0])
    return {name: kind() for kind in Rung.__subclasses__() for name in kind.names}
