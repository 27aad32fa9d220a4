"""The rungs in ngspice, which solves the circuit and leads the coupling."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import command
from cosim.drive.pieces import Command
from cosim.errors import BadInput
from cosim.files.spill import Tape, blocks
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.rungs.rung import Driven, Eddy, Electrics, commanded, magnetic, total


def drive(scene: Scene, recorder: Recorder) -> Driven:
    """The coupling method of the scene joins ngspice and the mechanics."""
    # Only those who run a circuit load PySpice, which takes a while.
    from cosim.circuit.false_cycles import refuse_false
    from cosim.circuit.lint.outputs import measured
    from cosim.circuit.netlist import asked_for
    from cosim.coupling.loop.macro_steps import coupled

    lead = coupled(scene, recorder)
    lead.run()
    log = lead.log()
    version = recorder.mechanics.instance.version
    refuse_false(scene, log, lambda finer: _log_alone(finer, version))
    values, notes = {}, []
    if scene.circuit.netlist is not None:
        _refuse_foreign_coil(scene, log)
        asks, notes = asked_for(scene)
        values, without = measured(asks, log["time"], log)
        notes += without
    electric, waves = _electrics(scene, command(scene), log, recorder.time)
    return Driven(
        electric,
        method=scene.coupling.method,
        circuit_steps=lead.steps,
        circuit_rejected=lead.state.attempts - lead.steps,
        versions={"ngspice": lead.ngspice},
        measured=values,
        notes=notes,
        waves=lambda: waves,
    )


def _log_alone(scene: Scene, fmi_version: int) -> dict[str, Array]:
    """The circuit's waveforms of a run of which nothing else is wanted."""
    from cosim.coupling.loop.macro_steps import coupled

    with closing(Mechanics(scene, fmi_version)) as mechanics:
        lead = coupled(scene, Recorder(scene, mechanics, lambda _: None))
        lead.run()
        return lead.log()


def _electrics(
    scene: Scene, command: Command, log: dict[str, Array], rows: Array
) -> tuple[Electrics, dict[str, Array]]:
    """From the vectors at the accepted points of the circuit: the account, and the columns.

    Energies are sums of step times means over the step: for them the trapezoidal companion of an
    inductance, which ngspice integrates with, balances exactly.
    """
    coil, circuit, settle = scene.coil, scene.circuit, scene.run.settle
    copper = coil.resistance / coil.count
    if circuit.netlist is None:
        copper += circuit.sense_resistance
    made = "v(v1)" in log and circuit.model != "amplifier"  # by the circuit, not given to it
    delivered, squares, eddy = 0.0, 0.0, Eddy(scene)
    most, least = -np.inf, np.inf
    saved = circuit.save or []
    waves, done = Tape(2 + len(saved) + made), 0
    end = log["time"][-1]
    for part in _points(log):
        time, coils, out, sense = (part[k] for k in ("time", "i(vemf)", "v(out)", "v(sense)"))
        current = coils / coil.count
        h = np.diff(time)
        mean = 0.5 * (coils[1:] + coils[:-1])
        # What lies beyond the coil's ends is the netlist's own affair.
        lost = out if circuit.netlist is None else out - sense
        delivered += total(h, mean * (0.5 * (lost[1:] + lost[:-1])))
        squares += total(h, mean**2)
        eddy.follow(h, current[:-1], current[1:])
        settled = current[time >= settle]
        most, least = settled.max(initial=most), settled.min(initial=least)
        stop = len(rows) if time[-1] == end else int(np.searchsorted(rows, time[-1]))
        known = [current, out - sense, *(part[name] for name in saved)]
        known += [part["v(v1)"]] if made else []
        for here in blocks(stop - done):
            at = rows[done:stop][here]
            waves.append(np.stack([np.interp(at, time, values) for values in known], axis=1))
        done = stop
    electric = Electrics(
        energy_in=delivered,
        energy_copper=copper * squares + coil.count * eddy.heat,
        energy_magnetic=magnetic(scene, float(log["i(vemf)"][-1] / coil.count), eddy.current),
        current_max=float(most),
        current_min=float(least),
        limited=_limited(scene, log),
    )
    return electric, {
        "command": waves.column(2 + len(saved)) if made else commanded(command, rows),
        "current": waves.column(0),
        "coil_voltage": waves.column(1),
        **{name: waves.column(2 + k) for k, name in enumerate(saved)},
    }


def _limited(scene: Scene, log: dict[str, Array]) -> dict[str, float]:
    """The share of the time after settling in which each limit acted, of those known."""
    from cosim.circuit.limits import shares_of_steps
    from cosim.circuit.netlist import AT_WORK, AT_WORK_HERE

    least = AT_WORK_HERE if scene.circuit.netlist is None else AT_WORK
    spent: dict[str, float] = {}
    whole = 0.0
    for steps in blocks(len(log["time"]) - 1):
        # One step more, for what leads to the first.
        lead = min(steps.start, 1)
        reach = slice(steps.start - lead, steps.stop + 1)
        part = {name: np.ascontiguousarray(values[reach]) for name, values in log.items()}
        h = np.diff(part["time"])[lead:]
        h = h * (part["time"][1 + lead :] > scene.run.settle)
        whole += float(h.sum())
        for name, shares in shares_of_steps(part, least).items():
            spent[name] = spent.get(name, 0.0) + total(h, shares[lead:])
    return {name: time / whole for name, time in spent.items()}


def _points(log: dict[str, Array]) -> Iterator[dict[str, Array]]:
    """The log in parts, each with the first point of the next one as its last."""
    for part in blocks(len(log["time"]) - 1):
        reach = slice(part.start, part.stop + 1)
        yield {name: np.ascontiguousarray(values[reach]) for name, values in log.items()}


def _refuse_foreign_coil(scene: Scene, log: dict[str, Array]) -> None:
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
        ends = {"out": "v(out)", "sense": "v(sense)", "back_emf": "Vemf"}
        out, sense, emf = (scene.renamed.get(f"machine.{k}", word) for k, word in ends.items())
        raise BadInput(
            f"{scene.circuit.netlist}: {out} - {sense} is not the voltage of the scene's coil at "
            f"the current i({emf}): {emf} must be in series with the coil, + towards {out}, and "
            "the coil's resistance and inductance must be those of [coil] (as .param lines "
            "coil_resistance, coil_inductance and count they are)."
        )
