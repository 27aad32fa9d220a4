"""The common part of the rungs with mechanics; each rung has a file of its own.

A rung's file has the function ``drive``, which advances the recorder's mechanics from 0 to
``run.duration`` and raises BadInput and SimulationFailed; ``cosim/scene/rungs.py`` declares the
rungs and the keys that each uses. Energies are those of all ``coil.count`` coils, J; currents and
voltages those of one coil.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array, slope
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.pieces import Command
from cosim.files.spill import Tape, blocks
from cosim.scene import Scene
from cosim.scene.tables import Run
from cosim.trials.camera import frame_times


@dataclass(frozen=True)
class Electrics:
    """Energies, extremes and limits of the electrical side."""

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
    """Share of the time after settling in which each limit of the amplifier acted, by name;
    ``output``: in which any limit of its output did."""


@dataclass(frozen=True)
class Driven:
    """The results of a rung beside the mechanics', at the end of the run."""

    electric: Electrics | None
    """Results of the electrical side; None without a coil."""
    method: str = "uncoupled"
    """How circuit and mechanics were joined."""
    circuit_steps: int = 0
    circuit_rejected: int = 0
    versions: Mapping[str, str] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)
    """Numbers for the summary that the netlist itself asks for."""
    notes: Sequence[str] = ()
    waves: Callable[[], Mapping[str, Array]] = dict
    """Makes the columns of the coils: a value for each row of the waveforms. A row at a jump holds
    the value before it, as in the mechanics' columns; so the first row is the machine at rest,
    without command and current."""


@dataclass(frozen=True)
class Motion:
    """The motion of surface and part in a run; SI."""

    totals: Mapping[str, float]
    """Totals of one actuator from the start to the end: the part's height, times, counts and
    energies by the names of the mechanics' outputs; ``energy_in`` is the work of the coil's force,
    or of the surface whose velocity is given."""
    at_settle: Mapping[str, float]
    """Totals at the end of settling."""
    extremes: Mapping[str, float]
    """After settling, largest and smallest ``a_surface``, ``v_surface`` and ``z_surface``; infinite
    where an acceleration is not bounded."""
    frames: npt.NDArray[np.float64]
    """The surface's height at each instant of the camera's frames after settling."""
    slope: float | None
    """Slope of the straight line through the part's heights after settling, m/s; None where
    ``run.average`` does not ask for it."""
    ram: float | None = None
    """Position of the ram in its actuator in the last row, m; None without a ram."""


def average_slope(run: Run, heights: Array) -> float | None:
    """``slope`` of a motion whose part has ``heights`` (m) at the agenda's ``part_times``."""
    if run.average == "ends":
        return None
    return slope(frame_times(run.settle, len(heights)), heights)


def drive(scene: Scene, recorder: Recorder) -> Driven:
    """Drive the mechanics by the scene's rung; without a coil they move by themselves."""
    if not scene.rung.driven:
        nothing = np.zeros((1, 1))
        recorder.follow(np.array([scene.run.duration]), nothing, nothing)
        return Driven(None)
    name = "spice" if scene.rung.ngspice else scene.circuit.model
    return import_module(f"{__package__}.{name}").drive(scene, recorder)


def commanded(command: Command, rows: Array) -> Array:
    """V1 (V) at the times of the rows (s): at a jump the value before it, so 0 in the first row."""
    made = Tape(1, len(rows))
    for part in blocks(len(rows)):
        at = rows[part]
        made.append(np.where(at > 0.0, command.values_before(at), 0.0))
    return made.column()


def coil_waves(
    drives: Sequence[Command],
    recorder: Recorder,
    waves: Callable[[int, str], tuple[Array, Array]],
) -> dict[str, Array]:
    """Columns of each surface's coil: its command (V), current (A) and voltage (V). The last two
    come from ``waves(k, end)`` for coil number k and the end of its columns' names."""
    found: dict[str, Array] = {}
    for k, (drive, surface) in enumerate(zip(drives, ("", "_2"), strict=False)):
        found[f"command{surface}"] = commanded(drive, recorder.time)
        found[f"current{surface}"], found[f"coil_voltage{surface}"] = waves(k, surface)
    return found


def total(shares: Array, values: npt.NDArray[Any]) -> float:
    """Sum of the products, without BLAS: its threads cost more than the sum itself."""
    return float((shares * values).sum())


def magnetic(scene: Scene, current: float, eddy_current: float) -> float:
    """Energy (J) in the inductances of all coils, at these currents (A) of one coil."""
    coil = scene.coil
    own = 0.5 * coil.inductance * current**2
    return coil.count * (own + 0.5 * (coil.eddy_inductance or 0.0) * eddy_current**2)


class Eddy:
    """The eddy-current branch of one coil (inductance L2 parallel to R2, in series with the coil),
    solved exactly for a coil current that is linear on intervals."""

    def __init__(self, scene: Scene) -> None:
        inductance = scene.coil.eddy_inductance or 0.0
        self.resistance = scene.coil.eddy_resistance or 0.0
        self.tau = inductance / self.resistance if self.resistance else 0.0
        """Time constant of the branch, s; 0 where the coil has none."""
        self.heat = 0.0
        """Heat in the branch's resistance so far, J."""
        self.current = 0.0
        """Present current in the branch's inductance, A."""

    def follow(self, h: Array, start: Array, end: Array) -> Array | None:
        """Advance through intervals of lengths ``h`` (s), in each the coil's current (A) going from
        ``start`` to ``end``; gives the inductance's current (A) at the start of each interval.
        """
        if not self.tau:
            return None
        # tau di_L/dt = i - i_L with i a ramp: the resistance's current i - i_L tends to ``lag``,
        # and the difference ``rest`` decays with exp(-t/tau). The heat is R2 times the integral of
        # (lag + rest exp(-t/tau))².
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
