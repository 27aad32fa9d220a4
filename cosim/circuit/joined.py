"""A user's netlist that a scene's ports join to FMUs: no source or node in it has a fixed role.

Sources that a port feeds become external. A quantity to read is a vector of ngspice's, or an
expression, which an added B source computes as its voltage.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cosim.circuit.dialect.lines import Line, refuse
from cosim.circuit.dialect.words import definitions, number
from cosim.circuit.lint.allowed import passed
from cosim.circuit.lint.checks import check
from cosim.circuit.lint.deck import read
from cosim.circuit.lint.elements import Element, Scope, node, parse
from cosim.circuit.lint.expressions import sensed
from cosim.circuit.lint.topology import Expansion
from cosim.circuit.lint.write import written
from cosim.circuit.outputs import Measure, measures, without_effect
from cosim.errors import BadInput, plain
from cosim.scene.messages import ended, suggestion

# v(node) or i(source), but not v(0): ground is no vector of ngspice's, only in expressions.
_VECTOR = re.compile(r"(v(?!\s*\(\s*(?:0|gnd)\s*\))|i)\s*\(\s*([^\s(),]+)\s*\)", re.IGNORECASE)
_SUM = re.compile(r"[-+](?![^()]*\))")  # a sign outside parentheses
_FACTOR = re.compile(r"[vi]\s*\([^()]*\)", re.IGNORECASE)
_UNITS = {"v": "V", "i": "A", "iv": "W", "vv": "V2", "ii": "A2"}  # by the sorted factors
_CURRENTS = "vleh"  # elements whose current ngspice computes as an unknown
_READ = f"{_CURRENTS}rcdgfbi"  # elements whose current a B source may read
_NODE = "cosim_read"


@dataclass(frozen=True)
class Edges:
    """What a netlist's own sources have of edges."""

    pulses: tuple[str, ...]
    """ngspice's names of the sources with PULSE."""
    length: float
    """s, of edges of PULSE and EXP that have none; 0 without PULSE and EXP."""


@dataclass(frozen=True)
class Deck:
    """The deck for ngspice, and the vectors that it sends."""

    text: str
    vectors: Mapping[str, str]
    """ngspice's names of the saved vectors, by the names that the host has for them."""
    edges: Edges
    measures: Sequence[Measure] = ()
    """The netlist's own ``.meas``."""
    notes: Sequence[str] = ()
    """Sentences on lines of the netlist that have no effect, and on random numbers."""
    devices: Sequence[str] = ()
    """For the first vectors the device parameter that has the value within a step, or ""."""


def unit(words: str) -> str:
    """The unit of a vector, a product of vectors, or a sum of these; "?" for any other words."""
    terms = _SUM.split(words)
    if len(terms) > 1 and all(map(str.strip, terms)):
        first, *others = map(unit, terms)
        return first if {first} == {first, *others} else "?"
    factors = _FACTOR.findall(words)
    if "".join(words.split()) != "*".join("".join(each.split()) for each in factors):
        return "?"
    return _UNITS.get("".join(sorted(each[0].lower() for each in factors)), "?")


def deck(
    path: Path,
    sources: Sequence[str],
    words: Sequence[str],
    parameters: Mapping[str, float],
    duration: float,
    reltol: float,
    max_step: float,
    asked: bool,
    known: Mapping[str, float],
    called: tuple[str, str] = ("[[port]] source", "[[port]] probe"),
    through: Sequence[tuple[str, str]] = (),
    saved: Collection[str] = (),
) -> Deck:
    """The deck of a netlist in which the ``sources`` are external and the ``words`` are saved; if
    ``asked`` for within a step, each word is also a device's parameter. ``known`` are values for
    ``.param`` lines that the netlist may have, ``parameters`` for those that it must have. For each
    source and word of ``through`` the circuit adds the word, times the external source
    ``Vcosim_gain`` with the pair's number, to the source. Messages use the names ``called``, but
    ``circuit.save`` for words ``saved``.

    Raises BadInput: for the netlist with its line, for the rest with what is wrong in the scene.
    """
    netlist = checked(path, sources, words, asked=asked, called=called, saved=saved)
    top = netlist.top
    values = {**known, **own_parameters(top, plain(path), parameters)}
    fed = {source.lower() for source in sources}
    external = {
        each.line: "\n".join(_external(each, through)) for each in top.elements if each.name in fed
    }
    read_as = reading(netlist.words, len(words) if asked else 0)
    vectors = {word: vector for word, (vector, _) in zip(netlist.words, read_as, strict=True)}
    made = netlist.deck(external, values, vectors, duration, reltol, max_step)
    return replace(made, devices=[device for _, device in read_as[: len(words)]])


_ONE_BREAK, _ONE_TIME = 1e-10, 3e-15
"""Two edges nearer than these shares, of the longest step and of the run's duration, count as one.
ngspice itself has only the first, which a long run with short steps makes less than the rounding of
times. Two sources that round one edge differently then cause a tiny step with noise of amperes."""


def _own_step(dropped: Sequence[Line]) -> float | None:
    """The step, s, of the netlist's own .tran line; None without one: LTspice writes the stop time
    alone, or 0 for the step."""
    for line in dropped:
        word, *times = line.text.lower().split()
        if word == ".tran":
            # A single number is LTspice's stop time, so a step counts only with a stop behind it.
            step, stop = ([number(time) for time in times] + [None, None])[:2]
            return step if step and stop else None
    return None


_RANDOM = re.compile(r"(?<![\w.])(?:a?gauss|a?unif|trnoise|trrandom)(?=\s*\()", re.IGNORECASE)
_SEEDED = re.compile(r"^\.opt\w*\s(?:.*\s)?seed\s*=", re.IGNORECASE | re.MULTILINE)


def _remark(random: Sequence[str]) -> Iterator[str]:
    """A sentence on the functions and sources of a netlist that draw random numbers."""
    if noise := [name for name in random if name.startswith("tr")]:
        yield f"the values of {' and '.join(noise)} are random, and differ from run to run."
    elif random:
        yield (
            f"the random numbers of {', '.join(random)} are the same in each run; "
            ".options seed=N in the netlist draws others (it is 1 without)."
        )


@dataclass(frozen=True)
class Checked:
    """A netlist that :func:`checked` has found sound."""

    title: Line
    top: Scope
    words: tuple[str, ...]
    """Vectors and expressions that are read: those asked for, then those that measures need."""
    measures: Sequence[Measure] = ()
    dropped: Sequence[Line] = ()
    """Lines that ngspice does not see."""

    def deck(
        self,
        external: Mapping[Line, str],
        values: Mapping[str, float],
        vectors: Mapping[str, str],
        duration: float,
        reltol: float,
        max_step: float,
    ) -> Deck:
        """The deck for ngspice: the netlist with the lines of ``external`` sources replaced,
        ``values`` for the top level's parameters, a seed for random numbers if the netlist has
        none, and the analysis; ``vectors`` are the saved ones."""
        edges = self._edges(external, max_step, duration)
        text = [self.title.text]
        for line, element, holder in self.top.order:
            if line in external:
                text.append(external[line])
            elif all(each.used for each in holder.chain()):  # something calls the subcircuit
                free = (f" {key}=0" for key in sorted(holder.free) if line is holder.line)
                own = written(line, element, values if holder is self.top else {})
                text.append("".join([own, *free]))
        lines = "\n".join(text)
        random = [*dict.fromkeys(match[0].lower() for match in _RANDOM.finditer(lines))]
        if random and not _SEEDED.search(lines):
            text.append(".options seed=1")
        min_break = max(_ONE_BREAK * max_step, _ONE_TIME * duration)
        text += [
            # Without norefvalue ngspice reads the CPU time at each step, to print its progress.
            f".options norefvalue reltol={reltol!r} minbreak={min_break!r}",
            # All vectors are sent step by step; ngspice is to keep none, which would take memory.
            ".save none",
            f".tran {edges.length or max_step!r} {duration!r} 0 {max_step!r}",
            ".end",
        ]
        notes = [*without_effect(self.dropped), *_remark(random)]
        return Deck("\n".join(text), vectors, edges, self.measures, notes)

    def _edges(self, external: Collection[Line], max_step: float, duration: float) -> Edges:
        """Those of all sources but the ``external`` ones. Simulators differ in the length of edges
        without one; here it is the netlist's own step, or a run's longest, but at most 1 % of the
        shortest on-time or period of a PULSE, or without an own one of the run's longest step where
        an expression has one of these."""
        every = (element for _, element, _ in self.top.order)
        sources = [each.words for each in every if each and each.kind in "vi"]
        if not any({"pulse", "exp"} & {*words} for words in sources):
            return Edges((), 0.0)
        own = _own_step(self.dropped)
        lengths = [own or max_step, duration]
        for words in sources:
            if "pulse" in words:
                values = [number(word) for word in words[words.index("pulse") + 1 :]]
                lengths += [0.01 * value for value in values[5:7] if value]  # on-time and period
                lengths += [0.01 * max_step] * (None in values[5:7] and own is None)
        return Edges((*_pulses(self.top, external),), min(lengths))


def _external(element: Element, through: Sequence[tuple[str, str]]) -> Iterator[str]:
    """The lines of a source set by the host; a B source in series or parallel adds ``through``."""
    (plus, minus), name = element.nodes, element.name
    shares = [(k, words) for k, (source, words) in enumerate(through) if source.lower() == name]
    between = minus
    if shares:
        between = f"cosim_{name}" if element.kind == "v" else minus
        plus_of_sum = between if element.kind == "v" else plus
        total = "+".join(f"v(cosim_gain{k})*({words})" for k, words in shares)
        yield f"Bcosim_{name} {plus_of_sum} {minus} {element.kind}={total}"
    yield f"{name} {plus} {between} external"
    for k, _ in shares:
        yield f"Vcosim_gain{k} cosim_gain{k} 0 external"


def checked(
    path: Path,
    sources: Sequence[str],
    words: Sequence[str],
    required: Sequence[Sequence[str]] | None = None,
    kinds: str = "vi",
    asked: bool = False,
    called: tuple[str, str] = ("[[port]] source", "[[port]] probe"),
    saved: Collection[str] = (),
) -> Checked:
    """Read a netlist in which the ``sources`` are of these ``kinds``, and to which sources are
    added that read the ``words`` and those of its measurements; of the alternatives ``required``,
    else the ``sources``, one must be there. Raises BadInput, for words with the name ``called`` or,
    if they are ``saved``, ``circuit.save``."""
    lines, dropped = read(path)
    asks, top, name = measures(dropped), parse(lines), plain(path)
    found = {element.name: element for element in top.elements}
    for source in sources:
        if source.lower() not in found or source[0].lower() not in kinds:
            able = sorted(each for each in found if each[0] in kinds)
            hint = suggestion(source.lower(), able) or f" (it has {', '.join(able) or 'none'})"
            if lines[0].text.lower().split()[1] == source.lower():
                hint = "; the first line of the netlist, where it stands, is the title"
            must = f"must be a {' or '.join(kinds.upper())} source of its own"
            raise BadInput(ended(f'{name}: {called[0]} = "{plain(source)}" {must}{hint}'))
    every: dict[str, Line] = {}
    for each in words:
        key = "circuit.save" if each in saved else called[1]
        every[each] = Line(each, f'{name}: {key} = "{plain(each)}"', 0)
        if not each.strip():
            what = "must be a vector or an expression of the netlist"
            raise BadInput(f"{every[each].place} {what}.")
    for ask in asks:
        every |= {each: replace(ask.line, text=each) for each in ask.words if each not in every}
    read_as = reading([*every], len(words) if asked else 0)
    extra: list[Line] = []
    for k, line in enumerate(every.values()):
        if read_as[k][0] == f"v({_NODE}{k})":
            extra.append(replace(line, text=f"Bcosim{k} {_NODE}{k} 0 V={line.text}"))
            passed(extra[-1])  # raises BadInput for what may not stand in a netlist
    _check_vectors(top, every.values())
    required = [[source.lower() for source in sources]] if required is None else required
    return Checked(lines[0], check([*lines, *extra], required), tuple(every), asks, dropped)


def reading(words: Sequence[str], asked: int = 0) -> list[tuple[str, str]]:
    """For each of the words the vector and the device parameter ("" without one) that have its
    value. The first ``asked`` words are also read within a step, by the parameter."""
    found = []
    for k, each in enumerate(words):
        match, current = _VECTOR.fullmatch(each), each[:1].lower() == "i"
        # A B source must compute within a step any node's voltage, and always a current that
        # ngspice has no vector for.
        able = match and match[2][:1].lower() in _CURRENTS if current else k >= asked
        if match and able:
            inner = match[2].lower()
            found.append((f"i({inner})", f"@{inner}[i]") if current else (f"v({inner})", ""))
        else:
            found.append((f"v({_NODE}{k})", f"@bcosim{k}[v]"))
    return found


def _check_vectors(top: Scope, wanted: Iterable[Line]) -> None:
    """Raise BadInput for a node or current that the top level lacks; names with a dot or colon lie
    in subcircuits, and are not looked up."""
    known: dict[str, set[str]] = {
        "v": {node for element in top.elements for node in element.nodes} | {"0"},
        "i": {each.name for each in top.elements if each.kind in _READ},
    }
    for each in wanted:
        if "@" in each.text:
            refuse(
                each,
                "what is within a device is not read; for its current put a source of 0 V in "
                "series, and ask for i of that",
            )
        for kind, what in (("v", "node"), ("i", "element of two ends")):
            for inner in sensed(f"b 1 0 v={each.text}", kind):
                if not re.search(r"[.:]", inner) and node(inner) not in known[kind]:
                    hint = suggestion(inner, known[kind])
                    raise BadInput(ended(f"{each.place}: there is no {what} {plain(inner)}{hint}"))


def own_parameters(top: Scope, name: str, given: Mapping[str, float]) -> dict[str, float]:
    """The values given to ``.param`` lines, by their names in small letters. Raises BadInput."""
    every = (each for line, _ in top.lines for each in definitions(line))
    known = [each.name for each in every if each.formals is None]
    for key in given:
        if key.lower() not in known:
            able = [each for each in known if not each.startswith("cosim_")]
            hint = suggestion(key.lower(), able) or f" (it has {', '.join(able) or 'none'})"
            raise BadInput(ended(f"{name}: circuit.param.{key} must be one of its .param{hint}"))
    return {key.lower(): value for key, value in given.items()}


def _pulses(top: Scope, external: Collection[Line]) -> Iterator[str]:
    """ngspice's names of the sources with PULSE, such as ``v.x1.x2.v3``, but the external ones."""
    for part in Expansion(top).parts(top, {}):
        path, element = part.path, part.element
        if element.kind in "vi" and "pulse" in element.words and element.line not in external:
            yield f"{element.kind}.{path}{element.name}" if path else element.name
