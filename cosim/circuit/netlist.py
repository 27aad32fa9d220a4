"""A netlist made ready for co-simulation, and what may be read from its nodes.

Every netlist in ``circuits/`` also runs in plain ngspice. Here the scene's values replace those of
its ``.param`` lines, the sources Vemf and Vcommand (or Vdac and Voffset) become external, and the
scene's analysis and ``reltol`` replace the netlist's; its other options stay. A user's own netlist
is treated alike; ``circuits/README.md`` says what it must have.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

from cosim.circuit.dialect.lines import Line, refuse
from cosim.circuit.joined import Checked, Deck, checked, own_parameters, reading
from cosim.circuit.lint.checks import REQUIRED as AGREED
from cosim.files.resources import circuits
from cosim.scene import Scene

REQUIRED = ("i(vemf)", "v(out)", "v(sense)")
"""Vectors that every netlist has: the coils' total current, and the voltages of the coil's ends."""
OWN = "own "
"""Before a user's word in the log, as a netlist's own node may be called like the machine's."""
OPTIONAL = ("v1", "swing", "climit", "slewing")
"""Nodes that are read where a netlist has them: the command at the power amplifier's input, and one
for each limit, which acts while the node's magnitude is at least 0.5 V. Where ports name other
sources than the machine's they are the netlist's own."""

MOTIONAL = "v(motional)"
"""With the method "companion": the part of the back-EMF that the circuit itself integrates, V."""

LEAK_TIME = 0.1
"""s; time constant with which MOTIONAL decays. So it stays small over a long run, and ngspice's
relative tolerance remains one on the back-EMF."""


_CIRCUIT_PARAMETERS = (
    *("supply", "sense_resistance", "current_limit", "gain_bandwidth", "open_loop_gain"),
    *("slew_rate", "swing_loss_high", "swing_loss_low", "output_resistance"),
)


def parameters(scene: Scene) -> dict[str, float]:
    """The numbers that the scene gives to the netlists' ``.param`` lines, SI (gain in dB)."""
    circuit, coil = scene.circuit, scene.coil
    return {name: getattr(circuit, name) for name in _CIRCUIT_PARAMETERS} | {
        "snubber_resistance": circuit.snubber_resistance or 1.0,
        "snubber_capacitance": circuit.snubber_capacitance or 0.0,
        "coil_resistance": coil.resistance,
        "coil_inductance": coil.inductance,
        "eddy_inductance": coil.eddy_inductance or 0.0,
        "eddy_resistance": coil.eddy_resistance or 1.0,
        "count": coil.count,
    }


def path_of(scene: Scene) -> Path:
    """The netlist of the scene's circuit."""
    circuit = scene.circuit
    if circuit.netlist is not None:
        return Path(circuit.netlist)
    return circuits() / f"{circuit.model}.cir"


def prepare(scene: Scene) -> Deck:
    """The deck of the scene's circuit; the names of its vectors are the log's.

    The run goes to ``run.duration`` with steps of at most ``circuit.max_step``. Raises BadInput,
    beginning with the netlist's file and line, for what is wrong with it or might do harm.
    """
    path, words, circuit, renamed = path_of(scene), _words(scene), scene.circuit, scene.renamed
    # The sources that ports join to the machine, if any do.
    sources = [renamed[end] for end in ("machine.back_emf", "drive") if renamed]
    if circuit.netlist is None:
        netlist = _packaged(path)
    else:  # read anew each time, as the file may have changed
        kept, required = circuit.save or (), None if renamed else AGREED
        netlist = checked(path, sources, (*words.values(), *kept), required, "v", saved=kept)
        words |= {f"{OWN}{each}": each for each in netlist.words}
    title, elements = netlist.title, netlist.top.elements
    present = {node for element in elements for node in element.nodes}
    names = {element.name for element in elements}
    agreed = next((each for each in AGREED if names.issuperset(each)), ())
    fed = {name.lower() for name in sources} or {*agreed}
    external = {
        each.line: " ".join([each.name, *each.nodes, "external"])
        for each in elements
        if each.name in fed
    }
    companion = scene.coupling.method == "companion"
    if companion:
        emf = renamed.get("machine.back_emf", "vemf").lower()
        _carry_inertia(external, title, present, emf)
    for node in ("out", "sense"):
        if f"v({node})" not in words and node not in present:
            port = f', or a [[port]] to "machine.{node}"' if renamed else ""
            refuse(title, f"the netlist must have a node {node}, one of the coil's two ends{port}")
    saved = {name: name for name in REQUIRED}
    saved |= {f"v({name})": f"v({name})" for name in OPTIONAL if agreed and name in present}
    if companion:
        saved[MOTIONAL] = MOTIONAL
    vectors = dict(zip(netlist.words, reading(netlist.words), strict=True))
    saved |= {name: vectors[word][0] for name, word in words.items()}
    values = parameters(scene) | own_parameters(netlist.top, str(path), circuit.param or {})
    steps = scene.run.duration, circuit.reltol, circuit.max_step
    return netlist.deck(external, values, saved, *steps)


def _words(scene: Scene) -> dict[str, str]:
    """The words that a user's netlist has for the machine's current and ends, by the log's."""
    ends = {"machine.current": "i(vemf)", "machine.out": "v(out)", "machine.sense": "v(sense)"}
    return {ends[end]: name for end, name in scene.renamed.items() if end in ends}


@cache
def _packaged(path: Path) -> Checked:
    """A netlist of the package, read once a process; a run's step sets its edges, not its own."""
    return replace(checked(path, (), (), AGREED, "v"), dropped=())


def _carry_inertia(external: dict[Line, str], title: Line, present: set[str], emf: str) -> None:
    """Put the mechanics' local inertia in series with the coil, for the method "companion".

    A mass m behind the coil acts as a capacitor C = m/Bl² with e = ∫ i dt/C. As stick, slip and
    contact change m, the netlist has 1 F, charged by the current times the gain 1/C of ``Vgain``.
    """
    for node in ("motional", "motional_gain", "motional_emf"):
        if node in present:
            refuse(title, f'the node {node} cannot be used with coupling.method = "companion"')
    line = next(line for line, text in external.items() if text.startswith(f"{emf} "))
    name, plus, minus, *_ = external[line].split()
    external[line] = "\n".join(
        (
            f"{name} {plus} motional_emf external",
            f"Emotional motional_emf {minus} motional 0 1",
            "Vgain motional_gain 0 external",
            f"Bmotional 0 motional I=i({name})*v(motional_gain)",
            "Cmotional motional 0 1",
            f"Rmotional motional 0 {LEAK_TIME!r}",
        )
    )


AT_WORK, AT_WORK_HERE = 0.5, 1e-3
"""V: a limit acts while its node, ``swing`` or ``climit``, has at least this magnitude; in a user's
netlist, and in those of ``circuits/``, where the node is exactly 0 otherwise."""
