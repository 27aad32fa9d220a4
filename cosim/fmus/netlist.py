"""A netlist as an FMU: the deck, written anew from the parsed netlist, with a library that runs the
importer's own ngspice (``fmu/netlist``)."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

from cosim.circuit.dialect.words import number, sent
from cosim.circuit.joined import Deck, deck, unit
from cosim.errors import BadInput, plain
from cosim.fmus.pack import pack
from cosim.toolchain.libraries import SUFFIX, compiled

_PARAM = re.compile(r"\.param (\w+)=(\S+)$")
_UNITS = {"v": "V", "i": "A", "?": "1"}


def netlist(
    path: Path,
    outputs: Sequence[str],
    target: Path,
    inputs: Sequence[str] = (),
    max_step: float = 2e-5,
    reltol: float = 1e-5,
    version: int = 2,
) -> None:
    """Write an .fmu of a netlist: the importer sets the sources ``inputs``, and reads ``outputs``,
    vectors or expressions. Raises BadInput."""
    if not 0.0 < max_step < inf or not 0.0 < reltol < 1.0:
        raise BadInput("--max-step must be above 0 s and finite, and --reltol between 0 and 1.")
    if len({name.lower() for name in inputs}) < len(inputs):
        raise BadInput(f"--input {plain(', '.join(inputs))}: names a source twice.")
    called = "--input", "--output"
    made = deck(path, inputs, outputs, {}, 1.0, reltol, max_step, False, {}, called)
    vectors = {words: made.vectors[words] for words in outputs}  # without those of .meas
    write(replace(made, vectors=vectors), inputs, target, max_step, version)


def write(deck: Deck, inputs: Sequence[str], target: Path, step: float, fmi: int) -> None:
    """Write the .fmu of a deck: ``inputs`` are its external sources, its vectors the outputs."""
    text, outputs = deck.text, deck.vectors
    # A .param is no parameter of the FMU if another variable has its name, or it has two values.
    given = [*_given(text)]
    taken = {"time", *inputs, *(f"{name}_slope" for name in inputs), *outputs}
    taken |= {name for name, count in Counter(name for name, _ in given).items() if count > 1}
    rows = [("parameter", k, "1", repr(v), "Of the netlist", k) for k, v in given if k not in taken]
    for name in inputs:
        rows.append(
            ("input", name, _UNITS[name[0].lower()], "0", "Value of the source", name.lower())
        )
    for words, vector in outputs.items():
        shown = _UNITS.get(unit(words), unit(words))
        rows.append(("output", words, shown, "0", "At the last accepted step", sent(vector)))
    rows += [("pulse", name) for name in deck.edges.pulses]
    name = re.sub(r"\W", "_", target.stem, flags=re.ASCII)
    rows = [("about", f"{plain(target.stem)}, computed by ngspice"), ("step", repr(step)), *rows]
    ports = "".join("\t".join(row) + "\n" for row in rows)
    library = compiled(f"netlist{SUFFIX}")
    token = hashlib.sha256(f"{ports}{text}".encode() + library.read_bytes()).hexdigest()[:32]
    ports = f"name\t{name if name[:1].isalpha() else f'm{name}'}\ntoken\t{token}\n{ports}"
    pack(library, target, fmi, {"ports.txt": ports, "deck.cir": text + "\n"})


def _given(text: str) -> Iterator[tuple[str, float]]:
    """The parameters of the top level that are plain numbers; an importer may set them."""
    depth = 0
    for line in text.split("\n"):
        depth += line.startswith(".subckt") - line.startswith(".ends")
        found = _PARAM.match(line)
        value = number(found[2]) if found and depth == 0 else None
        if found and value is not None:
            yield found[1], value
