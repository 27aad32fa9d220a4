"""The voice coil's electrical side of a run: waveforms and energies, with or without a circuit.

Energies are those of all ``coil.count`` coils, J; currents and voltages those of one coil.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.drive import Command
from cosim.scene import Scene

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Electrics:
    """What the electrical side did; arrays hold a value for each row of the waveforms."""

    command: Array
    """V1, V."""
    current: Array
    """Current of one coil, A."""
    coil_voltage: Array
    """Voltage across the coils, V."""
    energy_in: float
    """Delivered to coils and sense resistor, J."""
    energy_copper: float
    """Turned into heat in coils (copper and eddy currents) and sense resistor, J."""
    energy_magnetic: float
    """In the coils' inductances at the end, J."""
    saturated_fraction: float
    """Share of the time after settling in which the amplifier's output was at a limit."""


def from_circuit(
    scene: Scene, command: Command, log: dict[str, Array], rows: Array, over_limit: Array
) -> Electrics:
    """From the vectors at the accepted points of a circuit.

    Energies are sums of step times means over the step: for them the trapezoidal companion of an
    inductance, which ngspice integrates with, balances exactly.
    """
    coil, circuit = scene.coil, scene.circuit
    time, total, out, sense = (log[k] for k in ("time", "i(vemf)", "v(out)", "v(sense)"))
    current = total / coil.count
    h = np.diff(time)
    mean = 0.5 * (total[1:] + total[:-1])
    mean_out = 0.5 * (out[1:] + out[:-1])
    copper = coil.resistance / coil.count + circuit.sense_resistance
    eddy_heat, eddy_current = 0.0, 0.0
    if coil.eddy_inductance and coil.eddy_resistance:
        eddy_heat, eddy_current = _eddy(
            coil.eddy_inductance, coil.eddy_resistance, h, current[:-1], current[1:]
        )
    after = time[1:] > scene.run.settle
    limited = np.dot(h[after], over_limit[1:][after]) / max(h[after].sum(), 1e-300)
    return Electrics(
        command=np.interp(rows, time, log["v(v1)"]),
        current=np.interp(rows, time, current),
        coil_voltage=np.interp(rows, time, out - sense),
        energy_in=float(np.dot(h, mean * mean_out)),
        energy_copper=float(copper * np.dot(h, mean**2)) + coil.count * eddy_heat,
        energy_magnetic=_magnetic(scene, float(current[-1]), eddy_current),
        saturated_fraction=float(limited),
    )


def from_command(
    scene: Scene, command: Command, log: dict[str, Array], rows: Array, emf: Array, motion: float
) -> Electrics:
    """From a prescribed current, linear on intervals: ``log`` holds ``time``, the intervals' ends
    (s), and ``start`` and ``end``, the current of one coil (A) at the two ends of each.

    ``emf`` is the back-EMF (V) at the rows, ``motion`` the work (J) that one coil did. The source
    gives whatever voltage the current takes, so what it delivers is the sum of where it goes.
    """
    coil = scene.coil
    edges, start, end = log["time"], log["start"], log["end"]
    h = np.diff(edges)
    squares = float(np.dot(h, start**2 + start * end + end**2)) / 3.0
    slope = (end - start) / h
    at = np.clip(np.searchsorted(edges, rows, side="right") - 1, 0, len(h) - 1)
    current = start[at] + slope[at] * (rows - edges[at])
    voltage = coil.resistance * current + coil.inductance * slope[at] + emf
    eddy_heat, eddy_current = 0.0, 0.0
    if coil.eddy_inductance and coil.eddy_resistance:
        branch = np.empty(len(h) + 1)
        eddy_heat, eddy_current = _eddy(
            coil.eddy_inductance, coil.eddy_resistance, h, start, end, branch
        )
        tau = coil.eddy_inductance / coil.eddy_resistance
        lag = slope[at] * tau
        rest = start[at] - branch[at] - lag
        voltage += coil.eddy_resistance * (lag + rest * np.exp(-(rows - edges[at]) / tau))
    heat = (coil.resistance + coil.count * scene.circuit.sense_resistance) * squares
    copper = coil.count * (heat + eddy_heat)
    magnetic = _magnetic(scene, float(end[-1]), eddy_current)
    return Electrics(
        command=command.values(rows),
        current=current,
        coil_voltage=voltage,
        energy_in=copper + magnetic + coil.count * motion,
        energy_copper=copper,
        energy_magnetic=magnetic,
        saturated_fraction=0.0,
    )


def _magnetic(scene: Scene, current: float, eddy_current: float) -> float:
    coil = scene.coil
    own = 0.5 * coil.inductance * current**2
    return coil.count * (own + 0.5 * (coil.eddy_inductance or 0.0) * eddy_current**2)


def _eddy(
    inductance: float,
    resistance: float,
    h: Array,
    start: Array,
    end: Array,
    branch: Array | None = None,
) -> tuple[float, float]:
    """Heat in the eddy resistance (J) and current of the eddy inductance at the end (A).

    For a coil current that is linear on intervals of lengths ``h`` between ``start`` and ``end``;
    the LR2 branch is then solved exactly. ``branch`` receives its current at the edges.
    """
    tau = inductance / resistance
    heat, own = 0.0, 0.0
    for k in range(len(h)):
        if branch is not None:
            branch[k] = own
        lag = (end[k] - start[k]) / h[k] * tau
        rest = start[k] - own - lag
        decay = np.exp(-h[k] / tau)
        heat += resistance * (
            lag**2 * h[k]
            + 2.0 * lag * rest * tau * (1.0 - decay)
            + 0.5 * rest**2 * tau * (1.0 - decay**2)
        )
        own = end[k] - lag - rest * decay
    if branch is not None:
        branch[len(h)] = own
    return float(heat), float(own)
