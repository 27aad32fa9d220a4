"""Writes a netlist's lines anew from the parsed ones: ngspice sees no other text.

ngspice takes a name glued to a number for the next word (``vto=1level=8`` sets the level), and
ignores unknown words in silence. Here each number ends where a person sees its end, and unknown
keys are refused.
"""

import re
from collections.abc import Iterator, Mapping

from cosim.circuit.dialect.lines import Line, refuse, shown
from cosim.circuit.dialect.words import (
    NUMBER,
    TOKEN,
    Definition,
    closing,
    definitions,
    word_set,
    words,
)
from cosim.circuit.lint.allowed import MOS_LEVELS
from cosim.circuit.lint.elements import KINDS, Element

_NAME = re.compile(r"[a-z_][\w.$#]*", re.IGNORECASE)
_HEAD = re.compile(r"[^\s(),{}='\"`\\]+")
_KEY = re.compile(r"([a-z_]\w*)=(?!=)", re.IGNORECASE)
_PAIR = re.compile(r"([a-z_]\w*)=(.+)", re.IGNORECASE | re.DOTALL)
_INITIAL = re.compile(r"\s*v\s*\(\s*([^\s(),{}=']+)\s*\)\s*=\s*(\{[^{}]*\}|'[^']*'|[^\s,]+)\s*,?")

_ELSEWHERE = {
    "rser": "write a resistor in series", "lser": "write an inductor in series",
    "rpar": "write a resistor in parallel", "cpar": "write a capacitor in parallel",
    "laplace": "write the filter with R and C",
}  # fmt: skip
_FORMS = {
    "poly": "POLY(n) takes its controls, then 2 to 50 numbers if n is 1, else 1 to 50",
    "table": "TABLE takes an expression in braces, then two points or more that rise in x",
    "laplace": "LAPLACE takes a ratio of polynomials in s, the upper one of no higher power; "
    "write another filter with R and C",
    "freq": "FREQ is not known here; write the filter with R and C",
    "vcvs": "with MAX and MIN write a B source",
    "vccs": "with MAX and MIN write a B source",
} | dict.fromkeys(("and", "nand", "or", "nor"), "gates are not known here; write a B source")
"""Words for which ngspice needs code models, where ``dialect`` could not rewrite them."""


def written(line: Line, element: Element | None, values: Mapping[str, float]) -> str:
    """The line's text written anew, with ``values`` for .param lines by name. Raises BadInput for
    anything unknown."""
    text = line.text
    word = text.split()[0].lower()
    if element is not None:
        return _element(element)
    if word == ".param":
        return "\n".join(_definition(line, each, values) for each in definitions(line))
    if word == ".model":
        return _model(line)
    if word in (".ic", ".nodeset"):
        return f"{word} {' '.join(_initial(line, text[len(word) :].lower()))}"
    if word == ".subckt":
        _, name, *rest = words(text)
        return " ".join([word, *(_word(line, each) for each in (_called(name), *rest))])
    if word in (".ends", ".global"):
        return " ".join([word, *(_word(line, each) for each in words(text)[1:])])
    return _expression(line, text)  # of conditions; options are numbers


def _definition(line: Line, each: Definition, values: Mapping[str, float]) -> str:
    if each.formals is not None:
        return f".func {each.name}({','.join(each.formals)}) {_expression(line, each.body)}"
    value = repr(values[each.name]) if each.name in values else _expression(line, each.body)
    return f".param {each.name}={value}"


def _called(name: str) -> str:
    """A subcircuit's name in letters and digits: ngspice does not find one with parameters that is
    called ``LM12/NS`` or ``IR-2110``."""
    return re.sub(r"[^\w{}()='\",]", lambda odd: f"_{ord(odd[0]):x}_", name)


def _element(element: Element) -> str:
    line = element.line
    known = word_set(KINDS[element.kind].keys)
    if element.kind in "efgh":
        for word in element.words:
            if cure := _FORMS.get(word.partition("=")[0]):
                element.refuse(f": {cure}")
    found = [match[1].lower() for match in map(_KEY.match, element.words) if match]
    for key in found:
        if known and key not in known:
            cure = _ELSEWHERE.get(key, "leave it out if the circuit is the same without it")
            element.refuse(f": {shown(key)} is nothing that ngspice knows of it; {cure}")
    head = [element.name, *element.nodes, *element.controls]
    if element.model:
        head.append(_called(element.model) if element.kind == "x" else element.model)
    for part in head:
        if not _HEAD.fullmatch(part):
            element.refuse(f": {shown(part)} is no name")
    if element.kind in "beghfvi":  # skip as many names as ``head`` has: a node 5V is no number
        names = re.match(rf"(?:[\s(),]*[^\s(),]+){{{len(head)}}}[\s),]*", line.text)
        rest = line.text[names.end() :] if names else ""
        return " ".join([*head, _expression(line, rest)])
    return " ".join([*head, *(_word(line, word) for word in element.words)])


def _model(line: Line) -> str:
    _, name, kind, *rest = words(line.text)
    for word in rest:
        pair = _PAIR.fullmatch(word)
        if pair is None and not _NAME.fullmatch(word):
            refuse(line, f"{shown(word)} is no parameter of a model; write name=value")
        if (pair[1] if pair else word) == "level":
            most = MOS_LEVELS if kind in ("nmos", "pmos") else frozenset("123456789")
            if pair is None or pair[2] not in most:
                given = pair[2] if pair else "without ="
                refuse(line, f"models of level {shown(given)} are not allowed: some write files")
    return " ".join([".model", name, kind, *(_word(line, word) for word in rest)])


def _initial(line: Line, text: str) -> Iterator[str]:
    place = 0
    while place < len(text.rstrip()):
        match = _INITIAL.match(text, place)
        if match is None:
            refuse(line, f"{shown(text[place:].strip())} is not v(node)=value")
        yield f"v({match[1]})={_word(line, match[2])}"
        place = match.end()


def _word(line: Line, word: str) -> str:
    """A value, or ``key=value``."""
    if pair := _PAIR.fullmatch(word):
        return f"{pair[1]}={_word(line, pair[2])}"
    if word[0] in "{'" and closing(word, 0) == len(word):
        return _expression(line, word)
    sign = word[: word[0] in "+-"]
    if number := NUMBER.fullmatch(word, len(sign)):
        return f"{sign}{number[1]}{number[2] or ''}"
    if not _HEAD.fullmatch(word) or (word[len(sign) : len(sign) + 1].isdigit() and "=" in word):
        refuse(line, f"{shown(word)} is neither a value nor name=value; put a blank between two")
    return word


def _expression(line: Line, text: str) -> str:
    """An expression, or a line of expressions, token by token; blanks stay where they are."""
    found = ""
    for token in TOKEN.finditer(text):
        number = NUMBER.match(text, token.start()) if token["number"] else None
        if token["unknown"] or (token["number"] and (number is None or number[0] != token[0])):
            refuse(line, f"{shown(text[token.start() :])} is no expression that ngspice can read")
        if number and re.match(r"\s*=(?!=)", text[token.end() :]):
            refuse(line, f"{shown(token[0])} cannot be set; put a blank between two words")
        found += f"{number[1]}{number[2] or ''}" if number else token[0]
    return found
