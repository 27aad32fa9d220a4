"""The results of a run of a scene with ports: its waveforms and its summary."""

import re
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.folded import HIDDEN, folded
from cosim.circuit.joined import unit
from cosim.circuit.outputs import measured
from cosim.coupling.loop.agenda import count, grid
from cosim.coupling.loop.lead import engine
from cosim.coupling.loop.structures import loop
from cosim.coupling.ports.run import Run
from cosim.errors import SimulationFailed, plain
from cosim.files.spill import Tape, blocks
from cosim.scene import Scene
from cosim.toolchain.versions import versions


def joined(
    scene: Scene, progress: Callable[[float], None]
) -> tuple[dict[str, Array], dict[str, Any], dict[str, str]]:
    """Waveforms, the summary, and the waveforms' units. Raises BadInput and SimulationFailed."""
    began = time.perf_counter()
    run = Run(scene, progress)
    run.run()
    signals: list[Signal] = []
    odd: list[str] = []
    for signal in _signals(run):
        if (beyond := ~np.isfinite(signal[3])).any():
            odd.append(f"{plain(signal[0])} (first at t = {signal[2][beyond.argmax()]:.6g} s)")
        else:
            signals.append(signal)
    _refuse_divergence(scene, signals)
    waves = Tape(1 + len(signals))
    step, rows = scene.run.output_step, count(scene.run.output_step, scene.run.duration)
    for part in blocks(rows):
        at = step * np.arange(part.start, part.stop, dtype=np.float64)
        waves.append(np.stack([at, *(_at(each, at) for each in signals)], axis=1))
    names = ["time", *(name for name, *_ in signals)]
    columns = {name: waves.column(k) for k, name in enumerate(names)}
    units = {"time": "s"} | {name: of for name, of, *_ in signals}
    summary = {
        f"{name}.{what}": value
        for name, _, times, values, continuous in signals
        for what, value in _numbers(scene.run.settle, times, values, continuous).items()
    }
    log = run.log.array()
    known = {w: log[:, 1 + len(run.plan.names) + k] for k, w in enumerate(run.deck.vectors)}
    asked = {*run.plan.names, *run.plan.words}
    of_circuit = {name: values for name, _, _, values, _ in signals if name in asked}
    values, without = measured(run.deck.measures, log[:, 0], known)
    summary |= values
    length = scene.run.duration - scene.run.settle
    for source, times, power in _powers(scene, signals):
        mean = _numbers(scene.run.settle, times, power, True)["mean"]
        summary |= {f"{source}.power": mean, f"{source}.energy": mean * length}
    summary |= {
        "circuit_steps": run.steps,
        "circuit_rejected": run.state.attempts - run.steps,
        "steps_repeated": run.state.redone,
        "fmu_steps": sum(side.fmu.steps for side in run.plan.sides),
        "wall_time": time.perf_counter() - began,
        "method": run.plan.method,
        "versions": versions() | {"ngspice": str(engine().ngspice_version)},
        "notes": [
            *(*run.deck.notes, *run.plan.notes, *run.plan.late_notes()),
            *(*_notes(run, odd), *without),
            *folded(
                {"time": log[:, 0], **of_circuit},
                {name: (name,) for name in of_circuit},
                *(grid(step, scene.run.duration), scene.run, HIDDEN),
            ),
        ],
    }
    return columns, summary, units


Signal = tuple[str, str, Array, Array, bool]
"""Name, unit, times (s), values, and whether it is continuous (else piecewise constant)."""


DIVERGED, BEYOND = 1e15, 1e150
"""Magnitudes, SI, above which a signal has diverged: one of a port, and any other (the square of
which would overflow)."""


def _refuse_divergence(scene: Scene, signals: list[Signal]) -> None:
    """Raise SimulationFailed, naming the signal that was the first to grow without bound."""
    ends = {end for port in scene.port for end in (port.origin, port.source, port.probe)}
    grown: list[tuple[float, str]] = []
    for name, _, times, values, _ in signals:
        most = DIVERGED if name in ends else BEYOND
        for part in blocks(len(times)):
            beyond = np.abs(values[part]) > most
            if beyond.any():
                grown.append((float(times[part][beyond.argmax()]), name))
                break
    if grown:
        time, name = min(grown)
        raise SimulationFailed(
            f"The run diverges: {plain(name)} has grown without bound by t = {time:.6g} s; check "
            "the signs and scales of the ports, or take a smaller circuit.max_step or "
            'coupling.macro_step, or coupling.method = "redo".'
        )


def _signals(run: Run) -> Iterator[Signal]:
    """Outputs of FMUs from the log ``points`` (time, then the row of all outputs); sources and
    probed values from ``log`` (time, sources, probed values)."""
    points, log = run.points.array(), run.log.array()
    for side in run.plan.sides:
        for column, (name, of, goes_on) in enumerate(side.columns, 1 + side.first):
            yield name, of, points[:, 0], points[:, column], goes_on
    for k, name in enumerate(run.plan.names):
        yield name, "V" if name[0] in "vV" else "A", log[:, 0], log[:, 1 + k], True
    for k, words in enumerate(run.plan.words):
        yield words, unit(words), log[:, 0], log[:, 1 + len(run.plan.names) + k], True


def _powers(scene: Scene, signals: list[Signal]) -> Iterator[tuple[str, Array, Array]]:
    """For each voltage source that an FMU feeds and whose current it reads: its name, times (s) and
    the power (W) that the circuit delivers to the FMU."""
    known = {name: (times, values) for name, _, times, values, _ in signals}
    currents = {
        ("".join(port.probe.lower().split()), str(port.to).partition(".")[0]): port.probe
        for port in scene.port
        if port.probe is not None
    }
    for port in scene.port:
        source, fmu = port.source or "", str(port.origin).partition(".")[0]
        probe = currents.get((f"i({source.lower()})", fmu))
        if source and probe is not None:
            times, voltage = known[source]
            yield source, times, voltage * known[probe][1]


def _at(signal: Signal, at: Array) -> Array:
    """Values at times ``at`` (s): linear between points, or held where not continuous."""
    _, _, times, values, continuous = signal
    if continuous:
        return np.interp(at, times, values)
    last = np.searchsorted(times, at * (1 + 1e-12), "right") - 1
    return values[np.maximum(last, 0)]


def _numbers(settle: float, times: Array, values: Array, continuous: bool) -> dict[str, float]:
    """Mean, rms, least and greatest value after settling, with straight lines between the points,
    or held values where not continuous."""
    length = total = squares = 0.0
    least, greatest = np.inf, -np.inf
    for part in blocks(len(times) - 1):
        reach = slice(part.start, part.stop + 1)
        t, y = times[reach], values[reach]
        if t[-1] <= settle and t[-1] < times[-1]:
            continue
        if t[0] < settle < t[-1]:
            first = np.interp(settle, t, y) if continuous else y[t <= settle][-1]
            y, t = np.append(first, y[t > settle]), np.append(settle, t[t > settle])
        h, a = np.diff(t), y[:-1]
        b = y[1:] if continuous else a
        length += float(h.sum())
        # Integrals of a line from a to b over h, and of its square.
        total += float((h * (a + b)).sum()) / 2.0
        squares += float((h * (a * a + a * b + b * b)).sum()) / 3.0
        least, greatest = min(least, float(y.min())), max(greatest, float(y.max()))
    found = {"mean": total / length, "rms": float(np.sqrt(squares / length))}
    return found | {"least": least, "greatest": greatest}


_OFTEN, _LONG, _WITHIN = 10, 10_000, 20
"""Ringing is reported if the steps are so many times those that ``circuit.max_step``, or a shorter
macro step, asks for, and their number is above the second; a node within a subcircuit must ring the
third times as much as a named one to be named."""
_SELDOM, _MANY = 2, 10
"""An FMU has steps of its own if its outputs change only every so manieth step or less often,
judged from so many changes on."""


def _notes(run: Run, odd: list[str]) -> Iterator[str]:
    """Sentences on what ngspice told, ringing, values that are no numbers, outputs that repeated
    steps change, and FMUs with steps of their own; ``odd`` names signals that were left out."""
    yield from engine().remarks()
    longest, key = run.plan.scene.circuit.max_step, "circuit.max_step"
    if 0.0 < run.state.macro_step < longest:  # 0 without macro steps
        longest, key = run.state.macro_step, "coupling.macro_step"
    often = run.steps * longest / run.state.duration
    if often > _OFTEN and run.steps > _LONG:
        turns = {
            name: loop().ports_turns(k)
            for k, name in enumerate(engine().sent)
            if not re.search(r"#|cosim_|_[rl]ser\b", name)  # nodes that no user has named
        }
        # A node that the user has named is clearer than one within a model, if it rings at all.
        node = max(turns, key=lambda n: turns[n] if "." not in n else turns[n] / _WITHIN)
        called = re.sub(r"^v\(|_vmeas_\d+|\)$", "", node)  # of 7, where I is read
        yield (
            f"the circuit took {run.steps} steps, {often:.0f} times as many as {key} "
            f"asks for. It turned most often, {turns[node]} times, at node {called}: if it rings "
            "there, damp it, say by a resistor and a capacitor to ground."
        )
    if odd:
        yield f"left out, as they are no finite numbers, and nothing reads them: {', '.join(odd)}."
    if names := ", ".join(name for _, name, at, _ in run.plan.outputs() if run.odd[at]):
        yield f"repeated steps change {names}, which the FMU does not restore, so they are off."
    points = run.points.array()
    for side in run.plan.sides:
        told = run.plan.method == "macro-steps" and side.of.step > 0.0  # the plan's notes have it
        columns = enumerate(side.columns, 1 + side.first)
        own = np.nan_to_num(points[:, [column for column, (*_, goes_on) in columns if goes_on]])
        changed = np.flatnonzero((own[1:] != own[:-1]).any(axis=1)) + 1
        # The median interval between changes: an output at rest for long says nothing.
        if not told and len(changed) > _MANY and np.median(np.diff(changed)) >= _SELDOM:
            yield (
                f"the outputs of {side.name} changed in only {len(changed)} of {len(points) - 1} "
                "steps: it moves in steps of its own, mostly of "
                f"{np.median(np.diff(points[changed, 0])):.2g} s. A controller that samples is to "
                "do so; where it is a model that integrates by fixed steps, coupling.method = "
                '"macro-steps" with a coupling.macro_step of that length or more suits it.'
            )
