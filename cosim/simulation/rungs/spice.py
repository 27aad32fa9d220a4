"""The rungs in ngspice, which solves the circuit and leads the coupling."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np

from cosim.arrays import Array
from cosim.circuit.folded import FOLDED, folded
from cosim.circuit.netlist import AT_WORK, AT_WORK_HERE, OWN
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
    # Imported here, since only runs of a circuit need PySpice, which takes a while to load.
    from cosim.circuit.false_cycles import refuse_false
    from cosim.circuit.outputs import measured
    from cosim.coupling.loop.lead import engine
    from cosim.coupling.loop.macro_steps import coupled

    lead = coupled(scene, recorder)
    lead.run()
    log = lead.log()
    refuse_false(scene, log, _log_alone)
    values, notes = {}, []
    if scene.circuit.netlist is not None:
        _refuse_foreign_coil(scene, log)
        known = {word.removeprefix(OWN): log[word] for word in log if word.startswith(OWN)}
        values, without = measured(lead.deck.measures, log["time"], known)
        notes += [*lead.deck.notes, *without, *engine().remarks()]
        names = {"coil_voltage": ("v(out)", "v(sense)")}
        names |= {word: (OWN + word,) for word in scene.circuit.save or []}
        notes += folded(log, names, recorder.time, scene.run, FOLDED)
    electric, waves = _electrics(scene, command(scene), log, recorder.time)
    return Driven(
        electric,
        method=scene.coupling.method,
        circuit_steps=lead.steps,
        circuit_rejected=lead.state.attempts - lead.steps,
        versions={"ngspice": str(engine().ngspice_version)},
        measured=values,
        notes=notes,
        waves=lambda: waves,
    )


def _log_alone(scene: Scene) -> dict[str, Array]:
    """The log of the circuit of a run without any other result."""
    from cosim.coupling.loop.macro_steps import coupled

    with closing(Mechanics(scene)) as mechanics:
        lead = coupled(scene, Recorder(scene, mechanics, lambda _: None))
        lead.run()
        return lead.log()


def _electrics(
    scene: Scene, command: Command, log: dict[str, Array], rows: Array
) -> tuple[Electrics, dict[str, Array]]:
    """The electrical results and the coil's columns, from the log at the circuit's accepted points.

    Energies are sums over steps of length times product of means: with these the energy of an
    inductance balances exactly under ngspice's trapezoidal rule.
    """
    coil, circuit, settle = scene.coil, scene.circuit, scene.run.settle
    copper = coil.resistance / coil.count
    if circuit.netlist is None:
        copper += circuit.sense_resistance
    # Whether the circuit itself makes the command V1; else V1 is its input.
    made = "v(v1)" in log and circuit.model != "amplifier" and not scene.renamed
    delivered, squares, eddy = 0.0, 0.0, Eddy(scene)
    # A netlist's operating point may have a current.
    first = eddy.current = float(log["i(vemf)"][0] / coil.count)
    most, least = -np.inf, np.inf
    saved = circuit.save or []
    waves, done = Tape(2 + len(saved) + made), 0
    end = log["time"][-1]
    for part in _points(log):
        time, coils, out, sense = (part[k] for k in ("time", "i(vemf)", "v(out)", "v(sense)"))
        current = coils / coil.count
        h = np.diff(time)
        mean = 0.5 * (coils[1:] + coils[:-1])
        # In a netlist of the user's own, only the coil between ``out`` and ``sense`` is counted.
        lost = out if circuit.netlist is None else out - sense
        delivered += total(h, mean * (0.5 * (lost[1:] + lost[:-1])))
        squares += total(h, mean**2)
        eddy.follow(h, current[:-1], current[1:])
        settled = current[time >= settle]
        most, least = settled.max(initial=most), settled.min(initial=least)
        stop = len(rows) if time[-1] == end else int(np.searchsorted(rows, time[-1]))
        known = [current, out - sense, *(part[OWN + name] for name in saved)]
        known += [part["v(v1)"]] if made else []
        for few in blocks(stop - done):
            at = rows[done:stop][few]
            waves.append(np.stack([np.interp(at, time, values) for values in known], axis=1))
        done = stop
    electric = Electrics(
        energy_in=delivered,
        energy_copper=copper * squares + coil.count * eddy.heat,
        energy_magnetic=magnetic(scene, float(log["i(vemf)"][-1] / coil.count), eddy.current)
        - magnetic(scene, first, first),
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
    """The share of the time after settling in which each known limit acted."""
    from cosim.circuit.limits import shares_of_steps

    least = AT_WORK_HERE if scene.circuit.netlist is None else AT_WORK
    spent: dict[str, float] = {}
    whole = 0.0
    lead = 0
    for part in _points(log, lead=1):
        h = np.diff(part["time"])[lead:]
        h = h * (part["time"][1 + lead :] > scene.run.settle)
        whole += float(h.sum())
        for name, shares in shares_of_steps(part, least).items():
            spent[name] = spent.get(name, 0.0) + total(h, shares[lead:])
        lead = 1  # later parts begin a step early, so their first step is not counted again
    return {name: time / whole for name, time in spent.items()}


def _points(log: dict[str, Array], lead: int = 0) -> Iterator[dict[str, Array]]:
    """The log in parts, so that each step lies in one part: a part's last point is the next one's
    first. With ``lead`` each part begins so many points earlier."""
    for part in blocks(len(log["time"]) - 1):
        reach = slice(max(part.start - lead, 0), part.stop + 1)
        yield {name: np.ascontiguousarray(values[reach]) for name, values in log.items()}


def _refuse_foreign_coil(scene: Scene, log: dict[str, Array]) -> None:
    """Refuse a netlist whose voltage between ``out`` and ``sense`` is not that of the scene's coil.

    The integral of v = R i + L di/dt + e over each step is a linear equation in R and L. Least
    squares find them; the equations must hold, and R and L must be the scene's. Raises BadInput,
    since a reversed back-EMF source, one not in series with the coil, or a netlist's own R and L
    would give meaningless results. A coil with an eddy branch is not checked.
    """
    coil = scene.coil
    if coil.eddy_inductance:
        return
    normal, right = np.zeros((2, 2)), np.zeros(2)
    # Normal equations of flux = (R, L) @ slopes, summed over steps k.
    for slopes, flux, _ in _fluxes(scene, log):
        normal += np.einsum("ik,jk->ij", slopes, slopes)
        right += np.einsum("ik,k->i", slopes, flux)
    own = np.array([coil.resistance, coil.inductance])
    # R and L are determined only if the current both flows and changes.
    known = np.linalg.det(normal) > 1e-9 * normal[0, 0] * normal[1, 1]
    found = np.linalg.solve(normal, right) if known else own
    missing, worst, swept, scatter, moved = 0.0, 0.0, 0.0, 0.0, np.zeros(2)
    for slopes, flux, whole in _fluxes(scene, log):
        moved += np.abs(slopes).sum(axis=1)
        # Residuals are summed: in single steps of a stiff circuit the equation is inexact.
        residuals = flux - found @ slopes
        sums = missing + np.cumsum(residuals)
        missing, worst = float(sums[-1]), max(worst, float(np.abs(sums).max()))
        swept += float(whole.sum())
        scatter += float(np.abs(residuals).sum())
    ends = {"out": "v(out)", "sense": "v(sense)", "back_emf": "Vemf"}
    out, sense, emf = (scene.renamed.get(f"machine.{k}", word) for k, word in ends.items())
    if worst > 0.01 * swept + 1e-12 or (found < 0.0).any():
        raise BadInput(
            f"{scene.circuit.netlist}: {out} - {sense} is not the voltage of a coil at the current "
            f"i({emf}): {emf} must be in series with the coil, + towards {out}."
        )
    off = abs(found - own)
    # A deviation that hardly changes the voltage may be an error of ngspice within its tolerance,
    # or of its steps, if they miss the equation by as much, as at each jump of a staircase.
    slack = 3.0 * scene.circuit.reltol * swept + scatter
    if ((off > 0.01 * own) & (off * moved > slack)).any():
        (resistance, inductance), count = found.tolist(), coil.count
        raise BadInput(
            f"{scene.circuit.netlist}: the coil between {out} and {sense} has "
            f"{resistance / count:.4g} Ohm and {inductance / count * 1e3:.4g} mH, that of [coil] "
            f"{coil.resistance / count:.4g} Ohm and {coil.inductance / count * 1e3:.4g} mH: set "
            f"coil.resistance = {resistance:.4g} and coil.inductance = {inductance:.4g}, or take "
            "the scene's by .param coil_resistance, coil_inductance and count."
        )


def _fluxes(scene: Scene, log: dict[str, Array]) -> Iterator[tuple[Array, Array, Array]]:
    """For the steps of each part of the log, short ones together with the next long one, since
    ngspice's current is noisy in them: the integral of one coil's current (A s) and its change (A)
    as two rows; the integral of its voltage less the back-EMF (V s); the sum of the magnitudes of
    these two integrals (V s)."""
    for part in _points(log):
        current, h = part["i(vemf)"] / scene.coil.count, np.diff(part["time"])
        voltage, emf = part["v(out)"] - part["v(sense)"], part["emf"]
        charge, given, back = (0.5 * (x[1:] + x[:-1]) * h for x in (current, voltage, emf))
        slopes, whole = np.stack([charge, np.diff(current)]), np.abs(given) + np.abs(back)
        firsts = np.flatnonzero(np.append(True, h[:-1] > 0.1 * h.mean()))
        each = slopes, given - back, whole
        slopes, flux, whole = (np.add.reduceat(x, firsts, axis=-1) for x in each)
        yield slopes, flux, whole
