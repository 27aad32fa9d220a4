"""Mistakes that ngspice accepts in silence, reports obscurely or crashes on, each in one sentence.

What cannot be decided without evaluating the netlist passes.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise, takewhile

from cosim.circuit.dialect.lines import Line, refuse, shown
from cosim.circuit.dialect.words import closing, number, unbraced, word_set
from cosim.circuit.lint.elements import KINDS, Element, Scope, parse
from cosim.circuit.lint.expressions import Names, body, check_circles, check_names, sensed
from cosim.circuit.lint.topology import check_topology

REQUIRED = (("vemf", "vcommand"), ("vemf", "vdac", "voffset"))
"""Alternatives, each a set of top-level voltage sources that a co-simulation can replace."""

_NUMBER = re.compile(r"[+-]?(?:\d|\.\d)")
_OPERATOR = re.compile(r"[*/^]")
_BARE = re.compile(r"\b(?:[rclq]|flux)\s*=([^=]*?[()*/^][^=]*?)(?=\s\w+\s*=|$)", re.IGNORECASE)
"""R=, C=, L=, Q= or flux= with operators outside braces, which ngspice does not evaluate."""
_FACTOR = re.compile(r"\s[rcl]\s*=\s*(?!1(?:\.0*)?(?![\w.]))[^\s()]+")  # in a model; not 1
_WAVES = {"pulse": 7, "sin": 6, "exp": 6}
"""Most values of each; one more is a number of periods in LTspice, a phase in ngspice."""
_FOREIGN = (
    ("d", re.compile(r"\b((?:rev)?ilimit)\s*="),
     "is LTspice's ideal diode; write is, n and rs, or a B source"),
    ("sw", re.compile(r"\b([lv]ser|ilimit|epsilon)\s*=\s*(?!0(?![\w.]))"),
     "is LTspice's own; write it apart"),
    ("sw", re.compile(r"\b([vi]h)\s*=\s*[{']?\s*-"),
     "below 0 is LTspice's smooth switch; give it as a plain number"),
)  # fmt: skip
"""Elements, parameters of their models that LTspice alone knows, and the end of the message."""
_NO_VALUES = {"m", "temp", "dtemp", "tc", "tc1", "tc2", "ic", "scale", "noisy"}
"""Keys of R, C and L other than the value itself."""
_WAVEFORMS = word_set(
    """dc ac pulse sin exp pwl sffm am trnoise trrandom external distof1 distof2 portnum z0 pwr freq
    phase r td"""
)


def check(lines: Sequence[Line], required: Sequence[Sequence[str]] = REQUIRED) -> Scope:
    """The netlist's top level, or BadInput, beginning with ``file:line:``, for the first mistake.

    ``lines`` are those of ``deck.read``. One of the alternatives in ``required`` must be there.
    """
    top = parse(lines)
    names = Names(top)
    present = {element.name for element in top.elements}
    replaced = next((each for each in required if present.issuperset(each)), None)
    for scope in top.in_use():
        _check_duplicates(scope)
        check_names(scope, names)
        for element in scope.elements:
            if scope is not top or element.name not in (replaced or ()):
                _check_element(element, scope, names)
    check_circles(top, names)
    _check_required(top, required, missing=replaced is None)
    check_topology(top)
    return top


def _check_required(top: Scope, required: Sequence[Sequence[str]], missing: bool) -> None:
    agreed = {name for alternative in required for name in alternative}
    if required and missing:
        ways = " or ".join(
            " and ".join(name.capitalize() for name in alternative) for alternative in required
        )
        # One port makes the circuit a scene's own, in which nothing has a role.
        other = '; without the machine a [[port]] is needed, as from = "drive" to any source'
        refuse(
            top.line,
            f"the netlist must have, outside subcircuits, the sources {ways}"
            f"{other if required is REQUIRED else ''}",
        )
    for scope in top.in_use():
        for element in scope.elements:
            if "external" in element.words and (scope is not top or element.name not in agreed):
                element.refuse(" cannot be external: nothing drives it")


def _check_duplicates(scope: Scope) -> None:
    first: dict[str, Element] = {}
    for element in scope.elements:
        if not element.conditional and first.setdefault(element.name, element) is not element:
            refuse(element.line, f"there is a second {shown(element.name)}")


def _check_element(element: Element, scope: Scope, names: Names) -> None:
    kind = element.kind
    if KINDS[kind].models:
        _check_model(element, scope)
    if kind in "rcl":
        _check_passive(element, scope, names)
    elif kind in "vi":
        _check_source(element, scope, names)
    elif kind == "b" and not body(element.line).strip():
        element.refuse(" has neither V=… nor I=…")
    elif kind in "eg" and not element.words:
        element.refuse(" has no value")
    elif kind == "t" and not {"td", "f"} & {word.partition("=")[0] for word in element.words}:
        element.refuse(": write its delay, TD=…, or F=…, as ngspice would take 0.25 ns")
    elif kind in "fhw":
        _check_current_controlled(element, scope)
    elif kind == "k":
        if len(element.words) != 3:
            element.refuse(" must name two inductors and their coupling; write K pair by pair")
        _check_named(element, scope, "inductor", element.words[:2])
        coupling = number(element.words[2].rpartition("=")[2])
        if coupling is not None and abs(coupling) > 1.0:
            element.refuse(f" couples by {coupling:g}; it must be from -1 to 1")
    elif kind == "t" and not any(word.startswith(("z0=", "zo=")) for word in element.words):
        element.refuse(" has no Z0=…")
    elif kind == "x":
        _check_call(element, scope)
    if kind in "beg":
        _check_named(element, scope, "source", _plain(sensed(element.line.text, "i")))


def _check_model(element: Element, scope: Scope) -> None:
    name = element.model
    if element.kind in "swo":
        place = 1 if element.kind == "w" else 0
        if len(element.words) <= place:
            element.refuse(" has too few nodes or no model")
        name = element.words[place]
    if name is None:
        return
    types = scope.model_types(name)
    if types is None:
        scope.refuse_model(element, name)
    _check_type(element, name, types)
    line = next(s.model_lines[name] for s in scope.chain() if name in s.model_lines)
    for kinds, parameter, cure in _FOREIGN:
        if element.kind in kinds and (found := parameter.search(line.text.lower())):
            refuse(line, f"{found[1]} of {shown(name)} {cure}")


def _check_type(element: Element, model: str, types: set[str]) -> None:
    if types and not types & word_set(KINDS[element.kind].models):
        element.refuse(f": the model {shown(model)} is of type {shown(min(types))}")


def _check_passive(element: Element, scope: Scope, names: Names) -> None:
    if any(word.partition("=")[0] not in _NO_VALUES for word in element.words if "=" in word):
        if match := _BARE.search(unbraced(element.line.text)):
            value = element.line.text[slice(*match.span(1))].strip()
            element.refuse(f": write {{…}} around its value, {shown(value)}")
        return
    first = next((word for word in element.words if "=" not in word), None)
    if first is None:
        element.refuse(" has no value")
    if _OPERATOR.search(unbraced(first)) and scope.model_types(first) is None:
        element.refuse(f": write {{…}} around its value, {shown(first)}")
    if len(element.words) > 1 and None not in map(number, element.words[:2]):
        element.refuse(" has two values; a number has a decimal point, not a comma")
    for word in element.words:
        line = next((s.model_lines[word] for s in scope.chain() if word in s.model_lines), None)
        if line and len(element.words) > 1 and (factor := _FACTOR.search(line.text.lower())):
            element.refuse(
                f": {factor[0].strip()} of {shown(word)} multiplies its value in PSpice, and "
                "nothing in ngspice; write the product here, and 1 there"
            )
    for word in element.words[1:]:
        known = number(word) is not None or "=" in word or word[0] in "{'"
        if not (known or scope.model_types(word) or names.is_parameter(scope, word)):
            element.refuse(f": {shown(word)} is neither a model nor name=value; leave it out")
    if _NUMBER.match(first) or first[0] in "{'+-":
        return
    types = scope.model_types(first)
    if types is not None:
        _check_type(element, first, types)
    elif not names.is_parameter(scope, first):
        element.refuse(f": {shown(first)} is neither a number nor a model")
    elif element.kind == "r":
        element.words[0] = f"{{{first}}}"  # ngspice takes a bare word for a model


def _values(words: Sequence[str], wave: str) -> list[str]:
    """A waveform's values: the words behind it up to another waveform or an assignment."""
    after = words[words.index(wave) + 1 :] if wave in words else []
    return [*takewhile(lambda word: word not in _WAVEFORMS and "=" not in word, after)]


def _check_source(element: Element, scope: Scope, names: Names) -> None:
    for wave, most in _WAVES.items():
        values = _values(element.words, wave)
        if len(values) > most:
            element.refuse(
                f": {wave.upper()} takes {most} values; leave out the next, a number of periods to "
                "LTspice and a phase to ngspice, or write that many as PWL"
            )
        if wave == "sin" in element.words and number([*values, "0", "0", "0"][2]) == 0.0:
            element.refuse(": SIN has no frequency; give one above 0, or its DC value alone")
    points = _values(element.words, "pwl")
    if any(word.startswith("+") for word in points[::2]):
        element.refuse(": write the times of PWL since the start, not since the last one")
    if "repeat" in points:
        element.refuse(": instead of REPEAT write r=0 after the points of PWL")
    for last, time in pairwise(map(number, points[::2])):
        if last is not None and time is not None and last > time:
            element.refuse(f": the times of PWL must rise, {time:g} s comes after {last:g} s")
    for word in element.words:
        plain = word.lstrip("+-")
        if _OPERATOR.search(unbraced(word)):
            element.refuse(f": write {{…}} around its value, {shown(word)}")
        if plain[:1] in ("{", "'") and closing(plain, 0) < len(plain):
            element.refuse(f": something stands behind the bracket of {shown(word)}; leave it out")
        known = plain in _WAVEFORMS or names.is_parameter(scope, plain)
        if known or "=" in word or _NUMBER.match(word) or plain[:1] in ("{", "'", ""):
            continue
        element.refuse(f": {shown(word)} is neither a number, a parameter nor a waveform")


def _check_current_controlled(element: Element, scope: Scope) -> None:
    found = element.words
    if not found:
        element.refuse(" names no source whose current controls it")
    if element.kind != "w" and ("=" in found[0] or found[0][0] in "{'"):
        return
    if found[:1] == ["poly"]:
        return
    if len(found) < 2:
        element.refuse(" has too few words")
    _check_named(element, scope, "source", _plain(found[:1]))


def _check_named(element: Element, scope: Scope, what: str, names: Iterable[str]) -> None:
    for name in names:
        if name not in scope.names:
            element.refuse(f": there is no {what} {shown(name)} here")


def _plain(names: Iterable[str]) -> Iterator[str]:
    """The names without paths into subcircuits, which are not followed."""
    return (name for name in names if "." not in name and ":" not in name)


def _check_call(element: Element, scope: Scope) -> None:
    name = element.model or ""
    subcircuits = scope.subcircuit(name)
    if subcircuits is None:
        element.refuse(
            f": no subcircuit {shown(name)} is defined here; include the file with its .subckt"
        )
    counts = {len(subcircuit.pins) for subcircuit in subcircuits}
    if len(element.nodes) not in counts:
        element.refuse(
            f" has {len(element.nodes)} nodes, but the subcircuit {shown(name)} has {max(counts)}"
        )
    known = {"m"}.union(*(subcircuit.parameters for subcircuit in subcircuits))
    for key in (word.partition("=")[0] for word in element.words if "=" in word):
        if key not in known:
            has = ", ".join(sorted(known - {"m"})) or "none"
            cure = f"(it has {has}); give it a value in the .subckt line, {shown(key)}=…"
            element.refuse(f": {shown(name)} has no parameter {shown(key)} {cure}")
