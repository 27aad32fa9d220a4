"""The voice coil's electrical side of a run: waveforms and energies, with or without a circuit.

Energies are those of all ``coil.count`` coils, J; currents and voltages those of one coil.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import Command
from cosim.errors import BadInput
from cosim.files.spill import Tape, blocks
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
    limits_at_work: Callable[[dict[str, Array]], dict[str, npt.NDArray[np.bool_]]],
) -> Electrics:
    """From the vectors at the accepted points of a circuit; ``limits_at_work`` tells of points of
    the log which limits acted there.

    Energies are sums of step times means over the step: for them the trapezoidal companion of an
    inductance, which ngspice integrates with, balances exactly.
    """
    coil, circuit, settle = scene.coil, scene.circuit, scene.run.settle
    copper = coil.resistance / coil.count
    if circuit.netlist is None:
        copper += circuit.sense_resistance
    made = "v(v1)" in log and circuit.model != "amplifier"  # by the circuit, not given to it
    after = sum(
        float((np.diff(part["time"]) * (part["time"][1:] > settle)).sum()) for part in _points(log)
    )
    delivered, squares, eddy = 0.0, 0.0, _Eddy(scene)
    most, least = -np.inf, np.inf
    limited: dict[str, float] = {}
    waves, done = Tape(3 if made else 2), 0
    end = log["time"][-1]
    for part in _points(log):
        time, total, out, sense = (part[k] for k in ("time", "i(vemf)", "v(out)", "v(sense)"))
        current = total / coil.count
        h = np.diff(time)
        mean = 0.5 * (total[1:] + total[:-1])
        # What lies beyond the coil's ends is the netlist's own affair.
        lost = out if circuit.netlist is None else out - sense
        delivered += _total(h, mean * (0.5 * (lost[1:] + lost[:-1])))
        squares += _total(h, mean**2)
        eddy.follow(h, current[:-1], current[1:])
        spent = h * (time[1:] > settle)
        spent /= after
        limits = limits_at_work(part)
        at_limit = [acts for name, acts in limits.items() if name != "slew"]
        if at_limit:
            limits["output"] = np.any(at_limit, axis=0)
        for name, acts in limits.items():
            # A step that only begins or ends at the limit counts half.
            share = _total(spent, 0.5 * acts[1:] + 0.5 * acts[:-1])
            limited[name] = limited.get(name, 0.0) + share
        settled = current[time >= settle]
        most, least = settled.max(initial=most), settled.min(initial=least)
        stop = len(rows) if time[-1] == end else int(np.searchsorted(rows, time[-1]))
        known = [current, out - sense, *([part["v(v1)"]] if made else [])]
        for here in blocks(stop - done):
            at = rows[done:stop][here]
            waves.append(np.stack([np.interp(at, time, values) for values in known], axis=1))
        done = stop
    return Electrics(
        command=waves.column(2) if made else commanded(command, rows),
        current=waves.column(0),
        coil_voltage=waves.column(1),
        energy_in=delivered,
        energy_copper=copper * squares + coil.count * eddy.heat,
        energy_magnetic=_magnetic(scene, float(log["i(vemf)"][-1] / coil.count), eddy.current),
        current_max=float(most),
        current_min=float(least),
        limited=limited,
    )


def _points(log: dict[str, Array]) -> Iterator[dict[str, Array]]:
    """The log in parts, each with the first point of the next one as its last."""
    for part in blocks(len(log["time"]) - 1):
        reach = slice(part.start, part.stop + 1)
        yield {name: np.ascontiguousarray(values[reach]) for name, values in log.items()}


def commanded(command: Command, rows: Array) -> Array:
    """V1 (V) at the times of the rows (s)."""
    made = Tape(1)
    for part in blocks(len(rows)):
        made.append(command.values(rows[part]))
    return made.column()


def refuse_foreign_coil(scene: Scene, log: dict[str, Array]) -> None:
    """Refuse a netlist whose voltage between ``out`` and ``sense`` is not that of the scene's coil.

    Over the run, v = R i + L di/dt + e must hold in its integral, with the scene's coil; one with
    an eddy branch is not checked. Raises BadInput: a source the wrong way round, not in series with
    the coil, or values of the netlist's own would make a result without meaning.
    """
    coil = scene.coil
    if coil.eddy_inductance:
        return
    missing, worst, swept = 0.0, 0.0, 0.0
    for part in _points(log):
        current = part["i(vemf)"] / coil.count
        h = np.diff(part["time"])
        mean = 0.5 * (current[1:] + current[:-1])
        voltage = part["v(out)"] - part["v(sense)"]
        expected = coil.resistance * mean * h + coil.inductance * np.diff(current)
        given = 0.5 * (voltage[1:] + voltage[:-1]) * h
        emf = 0.5 * (part["emf"][1:] + part["emf"][:-1]) * h
        # Running sums: single steps of a stiff circuit need not obey to the digit.
        sums = missing + np.cumsum(given - expected - emf)
        missing, worst = float(sums[-1]), max(worst, float(np.abs(sums).max()))
        swept += float(np.abs(given).sum() + np.abs(emf).sum())
    if worst > 0.01 * swept + 1e-12:
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
    coil, settle = scene.coil, scene.run.settle
    times, count = log["time"], len(log["start"])
    squares, eddy = 0.0, _Eddy(scene)
    most, least = -np.inf, np.inf
    waves, done = Tape(2), 0
    # At the corners, and where settling ends.
    settled = max(0, int(np.searchsorted(times, settle, side="right")) - 1)
    for part in blocks(count):
        edges, start, end = times[part.start : part.stop + 1], log["start"][part], log["end"][part]
        h = np.diff(edges)
        squares += _total(h, start**2 + start * end + end**2)
        slope = (end - start) / h
        stop = len(rows) if part.stop == count else int(np.searchsorted(rows, edges[-1]))
        branch = eddy.follow(h, start, end)
        for few in blocks(stop - done):
            row = rows[done:stop][few]
            at = np.clip(np.searchsorted(edges, row, side="right") - 1, 0, len(h) - 1)
            current = start[at] + slope[at] * (row - edges[at])
            voltage = coil.resistance * current + coil.inductance * slope[at] + emf[done:stop][few]
            if branch is not None:
                lag = slope[at] * eddy.tau
                rest = start[at] - branch[at] - lag
                voltage += eddy.resistance * (lag + rest * np.exp(-(row - edges[at]) / eddy.tau))
            waves.append(np.stack([current, voltage], axis=1))
        done = stop
        if part.start <= settled < part.stop:
            here = settled - part.start
            most = least = start[here] + slope[here] * (settle - edges[here])
        after = [end[max(settled - part.start, 0) :], start[max(settled + 1 - part.start, 0) :]]
        most = max(most, *(values.max(initial=-np.inf) for values in after))
        least = min(least, *(values.min(initial=np.inf) for values in after))
    squares /= 3.0
    heat = (coil.resistance + coil.count * scene.circuit.sense_resistance) * squares
    copper = coil.count * (heat + eddy.heat)
    magnetic = _magnetic(scene, float(log["end"][-1]), eddy.current)
    return Electrics(
        command=commanded(command, rows),
        current=waves.column(0),
        coil_voltage=waves.column(1),
        energy_in=copper + magnetic + coil.count * motion,
        energy_copper=copper,
        energy_magnetic=magnetic,
        current_max=float(most),
        current_min=float(least),
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
        command=commanded(command, recorder.time),
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


class _Eddy:
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
