"""The voice coil's electrical side of a run: waveforms and energies, with or without a circuit.

Energies are those of all ``coil.count`` coils, J; currents and voltages those of one coil.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.drive import Command
from cosim.errors import BadInput
from cosim.recorder import Recorder
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
    current_max: float
    """Largest current of one coil after settling, A."""
    current_min: float
    """Smallest current of one coil after settling, A."""
    limited: dict[str, float]
    """Share of the time after settling in which each limit of the amplifier acted, by name, and
    ``output`` for its output being at any."""


def from_circuit(
    scene: Scene,
    command: Command,
    log: dict[str, Array],
    rows: Array,
    limits: dict[str, npt.NDArray[np.bool_]],
) -> Electrics:
    """From the vectors at the accepted points of a circuit, and which limits acted there.

    Energies are sums of step times means over the step: for them the trapezoidal companion of an
    inductance, which ngspice integrates with, balances exactly.
    """
    coil, circuit = scene.coil, scene.circuit
    time, total, out, sense = (log[k] for k in ("time", "i(vemf)", "v(out)", "v(sense)"))
    current = total / coil.count
    h = np.diff(time)
    mean = 0.5 * (total[1:] + total[:-1])
    copper = coil.resistance / coil.count
    delivered = out
    if circuit.netlist is None:
        copper += circuit.sense_resistance
    else:
        # What lies beyond the coil's ends is the netlist's own affair.
        delivered = out - sense
    mean_delivered = 0.5 * (delivered[1:] + delivered[:-1])
    eddy_heat, eddy_current = 0.0, 0.0
    if coil.eddy_inductance and coil.eddy_resistance:
        eddy_heat, eddy_current = _eddy(
            coil.eddy_inductance, coil.eddy_resistance, h, current[:-1], current[1:]
        )
    spent = h * (time[1:] > scene.run.settle)
    spent /= spent.sum()
    # A step that only begins or ends at the limit counts half.
    limited = {
        name: _total(spent, 0.5 * acts[1:] + 0.5 * acts[:-1]) for name, acts in limits.items()
    }
    at_limit = [acts for name, acts in limits.items() if name != "slew"]
    if at_limit:
        acts = np.any(at_limit, axis=0)
        limited["output"] = _total(spent, 0.5 * acts[1:] + 0.5 * acts[:-1])
    made = "v(v1)" in log and circuit.model != "amplifier"  # by the circuit, not given to it
    settled = current[time >= scene.run.settle]
    return Electrics(
        command=np.interp(rows, time, log["v(v1)"]) if made else command.values(rows),
        current=np.interp(rows, time, current),
        coil_voltage=np.interp(rows, time, out - sense),
        energy_in=_total(h, mean * mean_delivered),
        energy_copper=copper * _total(h, mean**2) + coil.count * eddy_heat,
        energy_magnetic=_magnetic(scene, float(current[-1]), eddy_current),
        current_max=float(settled.max()),
        current_min=float(settled.min()),
        limited=limited,
    )


def refuse_foreign_coil(scene: Scene, log: dict[str, Array]) -> None:
    """Refuse a netlist whose voltage between ``out`` and ``sense`` is not that of the scene's coil.

    Over the run, v = R i + L di/dt + e must hold in its integral, with the scene's coil; one with
    an eddy branch is not checked. Raises BadInput: a source the wrong way round, not in series with
    the coil, or values of the netlist's own would make a result without meaning.
    """
    coil = scene.coil
    if coil.eddy_inductance:
        return
    time, current = log["time"], log["i(vemf)"] / coil.count
    h = np.diff(time)
    mean = 0.5 * (current[1:] + current[:-1])
    voltage = log["v(out)"] - log["v(sense)"]
    expected = coil.resistance * mean * h + coil.inductance * np.diff(current)
    given = 0.5 * (voltage[1:] + voltage[:-1]) * h
    emf = 0.5 * (log["emf"][1:] + log["emf"][:-1]) * h
    # Running sums: single steps of a stiff circuit need not obey to the digit.
    missing = np.cumsum(given - expected - emf)
    swept = np.abs(given).sum() + np.abs(emf).sum()
    if np.abs(missing).max() > 0.01 * swept + 1e-12:
        raise BadInput(
            f"{scene.circuit.netlist}: v(out) - v(sense) is not the voltage of the scene's coil at "
            "the current i(Vemf): Vemf must be in series with the coil, + towards out, and the "
            "coil's values must come from .param lines (coil_resistance, coil_inductance, count)."
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
    squares = _total(h, start**2 + start * end + end**2) / 3.0
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
    # At the corners, and where settling ends.
    settled = max(0, int(np.searchsorted(edges, scene.run.settle, side="right")) - 1)
    at_settle = start[settled] + slope[settled] * (scene.run.settle - edges[settled])
    after = np.concatenate([[at_settle], end[settled:], start[settled + 1 :]])
    return Electrics(
        command=command.values(rows),
        current=current,
        coil_voltage=voltage,
        energy_in=copper + magnetic + coil.count * motion,
        energy_copper=copper,
        energy_magnetic=magnetic,
        current_max=float(after.max()),
        current_min=float(after.min()),
        limited={"output": 0.0},
    )


def both(first: Electrics, second: Electrics) -> Electrics:
    """The first coil's electrics with the energies of two coils that have a source each."""
    return replace(
        first,
        energy_in=first.energy_in + second.energy_in,
        energy_copper=first.energy_copper + second.energy_copper,
        energy_magnetic=first.energy_magnetic + second.energy_magnetic,
    )


def from_source(scene: Scene, command: Command, recorder: Recorder) -> Electrics:
    """From the mechanics' own current source, at the end of its run.

    In a row at a corner or jump of the command stands the voltage before it.
    """
    count, run = scene.coil.count, scene.run
    totals, before = recorder.mechanics.totals(), recorder.at_settle
    columns = recorder.mechanics.columns
    share = {
        limit: (totals[name] - before[name]) / (run.duration - run.settle)
        for limit, name in (
            ("swing_high", "output_high_time"),
            ("swing_low", "output_low_time"),
            ("current_limit", "current_limit_time"),
        )
    }
    return Electrics(
        command=command.values(recorder.time),
        current=recorder.rows[:, columns.index("coil_current")],
        coil_voltage=recorder.rows[:, columns.index("coil_voltage")],
        energy_in=count * totals["energy_output"],
        energy_copper=count * totals["energy_copper"],
        energy_magnetic=count * totals["energy_magnetic"],
        current_max=recorder.extremes[6],
        current_min=recorder.extremes[7],
        limited=share | {"output": sum(share.values())},
    )


def _total(shares: Array, values: npt.NDArray[Any]) -> float:
    """Sum of the products, without BLAS: its threads cost more than the sum itself."""
    return float((shares * values).sum())


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
