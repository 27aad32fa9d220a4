"""A netlist made ready for co-simulation.

Every netlist in ``circuits/`` also runs in plain ngspice. Here the values of its ``.param`` lines
are replaced by the scene's, its agreed sources become external ones, and its analysis gives way to
the host's. Its options stay, but for the tolerance, which is the scene's.
"""

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import BadInput
from cosim.resources import circuits
from cosim.scene import Scene

EMF_SOURCE = "vemf"
"""Source of the back-EMF, in series with the coil: the coils' total current is that through it."""
COMMAND_SOURCES = ("vcommand", "vdac", "voffset")
"""Sources of the command: V1 itself, or the DAC's voltage and the offset pin's."""

LIMITS: dict[str, tuple[str, ...]] = {
    "amplifier": ("v(swing)",),
    "full": ("v(swing)", "v(climit)"),
}
"""Vectors that tell of an output at its limit, swing or current, while their magnitude is at least
0.5."""

_OWN_COMMANDS = (".tran", ".end", ".save", ".print", ".plot")


def parameters(scene: Scene) -> dict[str, float]:
    """The numbers that the scene gives to the netlists' ``.param`` lines, SI (gain in dB)."""
    circuit, coil = scene.circuit, scene.coil
    return {
        "supply": circuit.supply,
        "sense_resistance": circuit.sense_resistance,
        "current_limit": circuit.current_limit,
        "gain_bandwidth": circuit.gain_bandwidth,
        "open_loop_gain": circuit.open_loop_gain,
        "slew_rate": circuit.slew_rate,
        "swing_loss_high": circuit.swing_loss_high,
        "swing_loss_low": circuit.swing_loss_low,
        "coil_resistance": coil.resistance,
        "coil_inductance": coil.inductance,
        "eddy_inductance": coil.eddy_inductance or 0.0,
        "eddy_resistance": coil.eddy_resistance or 1.0,
        "count": coil.count,
    }


def prepare(scene: Scene, save: tuple[str, ...]) -> str:
    """The deck of the scene's circuit model, for ``ngSpice_Circ``.

    ``save`` are the vectors to keep. The run goes to ``run.duration`` with steps of at most
    ``circuit.max_step``.
    """
    path = circuits() / f"{scene.circuit.model}.cir"
    lines = _inlined(path)
    values = parameters(scene)
    title, body = lines[0], lines[1:]
    deck = [title]
    depth = 0
    for line in body:
        words = line.lower().split()
        if not words or words[0].startswith("*") or words[0] in _OWN_COMMANDS:
            continue
        depth += (words[0] == ".subckt") - (words[0] == ".ends")
        if words[0] in (*COMMAND_SOURCES, EMF_SOURCE):
            name, plus, minus = line.split()[:3]
            line = f"{name} {plus} {minus} external"
        elif depth == 0 and (match := re.fullmatch(r"\.param\s+(\w+)\s*=.*", line, re.IGNORECASE)):
            name = match[1].lower()
            if name in values:
                line = f".param {name}={values[name]!r}"
        deck.append(line)
    run, circuit = scene.run, scene.circuit
    deck += [
        f".options reltol={circuit.reltol!r}",
        f".save {' '.join(save)}",
        f".tran {circuit.max_step!r} {run.duration!r} 0 {circuit.max_step!r}",
        ".end",
    ]
    return "\n".join(deck)


def _inlined(path: Path) -> list[str]:
    """The lines of a netlist with its includes, which lie in the same folder, in their places."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{path}: the netlist cannot be read ({error.strerror}).") from error
    lines: list[str] = []
    for line in text.splitlines():
        words = line.split()
        if words and words[0].lower() in (".include", ".inc"):
            # The first line of an included file is no title.
            lines += _inlined(path.parent / Path(words[1].strip("\"'")).name)
        else:
            lines.append(line)
    return lines


def at_limit(scene: Scene, log: dict[str, npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """1 at the points of the log where the output is at its swing or current limit, else 0."""
    beyond = [np.abs(log[vector]) >= 0.5 for vector in LIMITS[scene.circuit.model]]
    return np.any(beyond, axis=0).astype(float)
