"""A netlist as an FMU: the deck written anew from what was parsed of it, in a library that runs
ngspice where the importer has it (``fmu/netlist``).
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from cosim.circuit.joined import Deck, deck, unit
from cosim.errors import BadInput
from cosim.fmus.pack import pack
from cosim.toolchain.libraries import SUFFIX, compiled

_PARAM = re.compile(
    r"\.param (\w+)=([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(meg|mil|[tgkmunpfa])?$"
)
_SCALES = {"t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "mil": 25.4e-6, "m": 1e-3, "u": 1e-6}
_SCALES |= {"n": 1e-9, "p": 1e-12, "f": 1e-15, "a": 1e-18}
_FALLBACK = {"?": "1"}


def netlist(
    path: Path,
    outputs: Sequence[str],
    target: Path,
    inputs: Sequence[str] = (),
    max_step: float = 2e-5,
    reltol: float = 1e-5,
    version: int = 2,
) -> None:
    """Write an .fmu of a netlist whose sources ``inputs`` the importer sets, and of which it reads
    the ``outputs``, vectors or expressions. Raises BadInput."""
    if not max_step > 0.0 or not 0.0 < reltol < 1.0:
        raise BadInput("--max-step must be above 0 s, and --reltol between 0 and 1.")
    made = deck(path, inputs, outputs, {}, 1.0, reltol, max_step, False, {}, called="--input")
    write(made, target, list(inputs), list(outputs), max_step, version)


def write(
    made: Deck, target: Path, inputs: Sequence[str], outputs: Sequence[str], step: float, fmi: int
) -> None:
    """Write the .fmu of a deck; outputs are in the order of its vectors."""
    rows = [
        ("parameter", name, "1", repr(value), "Of the netlist", name)
        for name, value in _given(made)
    ]
    for name in inputs:
        kind = {"v": "V", "i": "A"}[made.kinds[name.lower()]]
        rows.append(("input", name, kind, "0", "Value of the source", name.lower()))
    for words, vector in zip(outputs, made.vectors, strict=True):
        of = _FALLBACK.get(unit(words), unit(words))
        rows.append(("output", words, of, "0", "At the last accepted step", _sent(vector)))
    rows += [("pulse", name) for name in made.pulses]
    name = re.sub(r"\W", "_", target.stem, flags=re.ASCII)
    rows = [("about", f"{target.stem}, computed by ngspice"), ("step", repr(step)), *rows]
    ports = "".join("\t".join(row) + "\n" for row in rows)
    library = compiled(f"netlist{SUFFIX}")
    token = hashlib.sha256(f"{ports}{made.text}".encode() + library.read_bytes()).hexdigest()[:32]
    ports = f"name\t{name if name[:1].isalpha() else f'm{name}'}\ntoken\t{token}\n{ports}"
    pack(library, target, fmi, {"ports.txt": ports, "deck.cir": made.text + "\n"})


def _given(made: Deck) -> Iterator[tuple[str, float]]:
    """The parameters of the top level that are plain numbers; an importer may set them."""
    depth = 0
    for line in made.text.split("\n"):
        depth += line.startswith(".subckt") - line.startswith(".ends")
        found = _PARAM.match(line)
        if found and depth == 0:
            yield found[1], float(found[2]) * _SCALES.get(found[3] or "", 1.0)


def _sent(vector: str) -> str:
    """ngspice's name of ``v(out)`` or ``i(v1)``."""
    inner = vector[2:-1]
    return inner if vector.startswith("v") else f"{inner}#branch"
