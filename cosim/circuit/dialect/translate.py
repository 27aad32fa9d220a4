"""Translates the dialects of LTspice and PSpice to ngspice's, line by line.

Each logical line is rewritten before any check, so the checks see what ngspice will see. What
cannot be rewritten stays as it is, and is refused where it is used.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from cosim.circuit.dialect.curves import source, without_tables
from cosim.circuit.dialect.gates import gate
from cosim.circuit.dialect.laplace import without_laplace
from cosim.circuit.dialect.lines import Line
from cosim.circuit.dialect.operators import respelt
from cosim.circuit.dialect.parts import MAKERS, REMARKS, with_law, with_memory, with_parts
from cosim.circuit.dialect.words import FUNC, MODEL, WORD, taken

_LETTERS = str.maketrans(
    {"\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00a7": "_"}
)
"""Both micros, both ohms, and the section sign that LTspice puts between a part's kind and name."""
_DRAWN = re.compile(r"^(i\S*)\s+(\S+)\s+(\S+)\s+(?:tbl|table)\s*=?\s*\(([^()]*)\)", re.I)
"""A source whose current is a table of its own voltage."""
_BY_LAW = re.compile(r"^(b\S*)\s+(\S+)\s+(\S+)\s+r\s*=(?!=)\s*(.*?)(?=\s+\w+\s*=(?!=)|$)", re.I)
"""LTspice's resistor of this law."""
_SIGMA = re.compile(r"(?<![\w.])gauss\s*\(([^(),]*)\)", re.IGNORECASE)
"""LTspice's, of the standard deviation alone."""
_VALUED = re.compile(r"(?<=\s)value\s*=?\s*(?={)", re.IGNORECASE)
_KIND = re.compile(r"^([efgh]\S*(?:\s+\S+){2}\s+)[vc]c[vc]s\s+(?!.*\b(?:max|min)\s*=)", re.I)
"""VCVS, CCCS and the like: HSPICE's redundant word for the kind of a source without MAX or MIN."""
_NOISELESS = re.compile(r"\s+noiseless\b", re.IGNORECASE)
_TRUTH = re.compile(
    r"(?:(?<=[(,{~&|])|(?<=\w=))\s*(v\([^()]*\))(?=\s*(?:&(?!&)|\|(?!\|)))"  # left
    r"|(?:(?<=~)|(?<=(?<!&)&)|(?<=(?<!\|)\|))\s*(v\([^()]*\))(?=\s*(?:[&|)?},;]|$))",  # right
    re.IGNORECASE,
)
"""A bare voltage as operand of LTspice's & | ~: true above 0.5; to ngspice all but 0 is true."""
_SYNONYMS = {".params": ".param", ".define": ".param", "cap": "c", "ind": "l"}
_COILS = re.compile(r"(k\S*)((?:\s+l\S*){3,})\s+(\S+)", re.IGNORECASE)  # K of three or more
# NAME VALUE in a .param line without equals signs.
_UNEQUAL = re.compile(r"(?<=\s)([a-z_]\w*)\s+(?=[{'\d.+-]|[a-z_]\w*\()", re.IGNORECASE)


def in_ngspice(line: Line) -> list[Line]:
    """The line in ngspice's dialect, as one or more lines.

    The order matters: first other programs' forms of elements become B sources, since all that
    follows is to see their expressions; then expressions are rewritten; last, elements are taken
    apart, whose parts have expressions that are ngspice's already.
    """
    text = _KIND.sub(r"\1", _NOISELESS.sub("", line.text.translate(_LETTERS)))
    text = _SIGMA.sub(r"agauss(0,\1,1)", text)
    if drawn := _DRAWN.match(text):
        name, plus, minus, points = drawn.groups()
        points = ",".join(WORD.findall(points))
        text = f"b{name} {plus} {minus} i=table(v({plus},{minus}),{points}){text[drawn.end() :]}"
    text = without_tables(_BY_LAW.sub(r"\1 \2 \3 i=v(\2,\3)/(\4)", text))
    if text[:1].lower() in "beg":
        text = _VALUED.sub("value=", re.sub(r"'([^']*)'", r"{\1}", text))
        head, equals, rest = text.partition("=")  # a name before a blank is no function to ngspice
        text = head + equals + re.sub(r"(?<![\w.])([a-z_]\w*)\s+\(", r"\1(", rest, flags=re.I)
        text = _TRUTH.sub(lambda truth: f"({truth[1] or truth[2]}>0.5)", text)
        if len(parts := [*without_laplace(text)]) > 1:  # B sources, rewritten in their turn
            return [each for part in parts for each in in_ngspice(replace(line, text=part))]
    return [replace(line, text=" ".join(each.split())) for each in _parts_of(respelt(text))]


def _parts_of(text: str) -> Sequence[str]:
    """A line as those of which ngspice makes the same: elements with parasitic parts, laws or
    memory, gates and coils taken apart, directives and models spelt as ngspice has them."""
    kind = text[:1].lower()
    if kind == "q":  # the substrate in brackets
        return [re.sub(r"\[([^\s\[\]]+)\]", r"\1", text)]
    if kind in "rclvibefgh":
        *parts, own = with_parts(text, kind)
        own = source(own) if kind in "efgh" else own
        split = with_memory if kind in "beg" else with_law if kind in "rcl" else lambda own: [own]
        return [*parts, *split(own)]
    if kind == "a":
        return gate(text)
    if coils := _COILS.fullmatch(text):
        pairs = enumerate(combinations(coils[2].split(), 2))
        return [f"{coils[1]}_{place} {' '.join(pair)} {coils[3]}" for place, pair in pairs]
    if text.lower().startswith((".param", ".define")):
        word, _, rest = text.partition(" ")
        rest = rest if "=" in rest else _UNEQUAL.sub(r"\1=", f" {rest}")
        return [f"{_SYNONYMS.get(word.lower(), word)} {rest}"]
    if function := FUNC.fullmatch(text):
        return [f".param {function[1]}={function[2]}"]
    if text.lower().startswith((".ic", ".nodeset")):
        return [re.sub(r"\)\s+(?=[{'\d.+-])", ")=", text)]
    if model := MODEL.match(text):
        remarks = REMARKS["vdmos"] if model[1].lower() == "vdmos" else MAKERS
        own = _SYNONYMS.get(model[1].lower(), model[1])
        text = text[: model.start(1)] + own + text[model.end(1) :]
        text = re.sub(r"(?i)(?<=\sako:)\s+", "", text)
        return [taken(text.replace("(", " ( ", 1), remarks)[0]]
    return [text]
