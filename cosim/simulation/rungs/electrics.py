"""The voice coil's electrical side of a run: energies and the command.

Energies are those of all ``coil.count`` coils, J; currents and voltages those of one coil.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.drive.pieces import Command
from cosim.files.spill import Tape, blocks
from cosim.scene import Scene


@dataclass(frozen=True)
class Electrics:
    """What the electrical side did, in numbers."""

    energy_in: float
    """Delivered to coils and sense resistor, J."""
    energy_copper: float
    """Turned into heat in coils (copper and eddy currents) and sense resistor, J."""
    energy_magnetic: float
    """In the coils' inductances at the end, J."""
    current_max: float
    """Largest current of one coil after settling, A."""
    current_min: float
    """Smallest current of one coil after settling, A."""
    limited: dict[str, float]
    """Share of the time after settling in which each limit of the amplifier acted, by name, and
    ``output`` for its output being at any."""


def commanded(command: Command, rows: Array) -> Array:
    """V1 (V) at the times of the rows (s), at a jump the value before it; 0 in the first row, where
    the command has not begun."""
    made = Tape(1, len(rows))

    def write(at: Array, values: Array) -> None:
        command.values_before(at, values)
        values[: at.searchsorted(0.0, "right")] = 0.0

    for part in blocks(len(rows)):
        made.add(part.stop - part.start, partial(write, rows[part]))
    return made.column()


def total(shares: Array, values: npt.NDArray[Any]) -> float:
    """Sum of the products, without BLAS: its threads cost more than the sum itself."""
    return float((shares * values).sum())


def magnetic(scene: Scene, current: float, eddy_current: float) -> float:
    """Energy in the inductances of all coils, J, at these currents of one (A)."""
    coil = scene.coil
    own = 0.5 * coil.inductance * current**2
    return coil.count * (own + 0.5 * (coil.eddy_inductance or 0.0) * eddy_current**2)


class Eddy:
    """The LR2 branch of one coil, whose current is linear on intervals; solved exactly."""

    def __init__(self, scene: Scene) -> None:
        inductance = scene.coil.eddy_inductance or 0.0
        self.resistance = scene.coil.eddy_resistance or 0.0
        self.tau = inductance / self.resistance if self.resistance else 0.0
        """Its time constant, s; 0 where the coil has no such branch."""
        self.heat = 0.0
        """In its resistance so far, J."""
        self.current = 0.0
        """In its inductance at the end, A."""

    def follow(self, h: Array, start: Array, end: Array) -> Array | None:
        """Go on through intervals of lengths ``h`` (s), the coil's current (A) between ``start``
        and ``end``; gives the branch's current at the beginning of each.
        """
        if not self.tau:
            return None
        tau, own, heat = self.tau, self.current, self.heat
        branch = np.empty(len(h))
        for k in range(len(h)):
            branch[k] = own
            lag = (end[k] - start[k]) / h[k] * tau
            rest = start[k] - own - lag
            decay = np.exp(-h[k] / tau)
            heat += self.resistance * (
                lag**2 * h[k]
                + 2.0 * lag * rest * tau * (1.0 - decay)
                + 0.5 * rest**2 * tau * (1.0 - decay**2)
            )
            own = end[k] - lag - rest * decay
        self.current, self.heat = float(own), float(heat)
        return branch
