"""Mistakes that ngspice takes silently, tells obscurely or does not survive, told in one sentence.

Where it cannot be decided without evaluating the netlist, it passes.
"""

import re
from collections.abc import Sequence

from cosim.circuit.lint.deck import Line, refuse, shown, word_set
from cosim.circuit.lint.elements import MODEL_TYPES, Element, Scope, parse
from cosim.circuit.lint.expressions import Names, body, check_circles, check_names, sensed
from cosim.circuit.lint.topology import check_topology

REQUIRED = (("vemf", "vcommand"), ("vemf", "vdac", "voffset"))
"""Alternatives, each a set of top-level voltage sources that a co-simulation can replace."""

_NUMBER = re.compile(r"[+-]?(?:\d|\.\d)")
_NO_VALUES = {"m", "temp", "dtemp", "tc", "tc1", "tc2", "ic", "scale", "noisy"}
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
    for scope in top.in_use():
        _check_duplicates(scope)
        check_names(scope, names)
        for element in scope.elements:
            _check_element(element, scope, names)
    check_circles(top)
    _check_required(top, required)
    check_topology(top)
    return top


def _check_required(top: Scope, required: Sequence[Sequence[str]]) -> None:
    present = {element.name for element in top.elements}
    agreed = {name for alternative in required for name in alternative}
    if required and not any(present.issuperset(alternative) for alternative in required):
        ways = " or ".join(
            " and ".join(name.capitalize() for name in alternative) for alternative in required
        )
        refuse(top.line, f"the netlist must have, outside subcircuits, the sources {ways}")
    for scope in top.in_use():
        for element in scope.elements:
            if "external" in element.words and (scope is not top or element.name not in agreed):
                refuse(element.line, f"{shown(element.name)} cannot be external: nothing drives it")


def _check_duplicates(scope: Scope) -> None:
    seen: set[str] = set()
    for element in scope.elements:
        if element.conditional:
            continue
        if element.name in seen:
            refuse(element.line, f"there is a second {shown(element.name)}")
        seen.add(element.name)


def _check_element(element: Element, scope: Scope, names: Names) -> None:
    kind, line = element.kind, element.line
    if kind in MODEL_TYPES:
        _check_model(element, scope)
    if kind in "rcl":
        _check_passive(element, scope, names)
    elif kind in "vi":
        _check_source(element, scope, names)
    elif kind == "b":
        if not body(line).strip():
            refuse(line, f"{shown(element.name)} has neither V=… nor I=…")
    elif kind in "eg":
        if not element.words:
            refuse(line, f"{shown(element.name)} has no value")
    elif kind in "fhw":
        _check_current_controlled(element, scope)
    elif kind == "k":
        _check_coupling(element, scope)
    elif kind == "t" and not any(word.startswith(("z0=", "zo=")) for word in element.words):
        refuse(line, f"{shown(element.name)} has no Z0=…")
    elif kind == "x":
        _check_call(element, scope)
    _check_sensed(element, scope)


def _check_model(element: Element, scope: Scope) -> None:
    name = element.model
    if element.kind in "swo":
        place = 1 if element.kind == "w" else 0
        if len(element.words) <= place:
            refuse(element.line, f"{shown(element.name)} has too few nodes or no model")
        name = element.words[place]
    if name is None:
        return
    types = scope.model_types(name)
    if types is None:
        refuse(element.line, f"{shown(element.name)}: no model {shown(name)} is defined here")
    if types and not types & MODEL_TYPES[element.kind]:
        refuse(
            element.line,
            f"{shown(element.name)}: the model {shown(name)} is of type {shown(min(types))}",
        )


def _check_passive(element: Element, scope: Scope, names: Names) -> None:
    line, name = element.line, shown(element.name)
    if all(word.partition("=")[0] in _NO_VALUES for word in element.words if "=" in word):
        plain = [word for word in element.words if "=" not in word]
        if not plain:
            refuse(line, f"{name} has no value")
        first = plain[0]
        if _NUMBER.match(first) or first[0] in "{'" or first[0] in "+-":
            return
        types = scope.model_types(first)
        if types is not None:
            if types and not types & MODEL_TYPES[element.kind]:
                refuse(line, f"{name}: the model {shown(first)} is of type {shown(min(types))}")
        elif names.is_parameter(scope, first):
            if element.kind == "r":
                refuse(
                    line,
                    f"{name}: write {{{shown(first)}}}, as ngspice takes a bare word for a model",
                )
        else:
            refuse(line, f"{name}: {shown(first)} is neither a number nor a model")


def _check_source(element: Element, scope: Scope, names: Names) -> None:
    for word in element.words:
        plain = word.lstrip("+-")
        if (
            "=" in word
            or _NUMBER.match(word)
            or plain[:1] in ("{", "'", "")
            or plain in _WAVEFORMS
            or names.is_parameter(scope, plain)
        ):
            continue
        refuse(
            element.line,
            f"{shown(element.name)}: {shown(word)} is neither a number, a parameter nor a waveform",
        )


def _check_current_controlled(element: Element, scope: Scope) -> None:
    found = element.words
    if element.kind != "w" and (not found or "=" in found[0] or found[0][0] in "{'"):
        return
    count, start = 1, 0
    if found and found[0] == "poly":
        if len(found) < 2 or not found[1].isdigit():
            return
        count, start = int(found[1]), 2
    controls = found[start : start + count]
    if len(found) <= start + count:
        refuse(element.line, f"{shown(element.name)} has too few words")
    for control in controls:
        _check_source_exists(element, scope, control)


def _check_source_exists(element: Element, scope: Scope, name: str) -> None:
    if "." in name or ":" in name:
        return
    if name not in scope.names:
        refuse(element.line, f"{shown(element.name)}: there is no source {shown(name)} here")


def _check_coupling(element: Element, scope: Scope) -> None:
    if len(element.words) < 3:
        refuse(element.line, f"{shown(element.name)} must name two inductors and their coupling")
    for name in element.words[:2]:
        if name not in scope.names:
            refuse(element.line, f"{shown(element.name)}: there is no inductor {shown(name)} here")


def _check_call(element: Element, scope: Scope) -> None:
    name = element.model or ""
    subcircuits = scope.subcircuit(name)
    if subcircuits is None:
        refuse(element.line, f"{shown(element.name)}: no subcircuit {shown(name)} is defined here")
    counts = {len(subcircuit.pins) for subcircuit in subcircuits}
    if len(element.nodes) not in counts:
        refuse(
            element.line,
            f"{shown(element.name)} has {len(element.nodes)} nodes, but the subcircuit "
            f"{shown(name)} has {max(counts)}",
        )


def _check_sensed(element: Element, scope: Scope) -> None:
    if element.kind in "beg":
        for name in sensed(element.line.text, "i"):
            _check_source_exists(element, scope, name)
