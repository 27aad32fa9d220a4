"""What LTspice and PSpice write otherwise than ngspice, in ngspice's words.

Each logical line is rewritten before anything looks at it, so the checks see what ngspice will see.
What cannot be rewritten stays as it is, and is refused where it is used.

Polynomials and tables become behavioural sources. ngspice has code models for them, which its
library does not bring on every machine, which cost each step, and which round a table's corners.
"""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations_with_replacement, count, pairwise
from math import pi

from cosim.circuit.lint.lines import MAX_LINE, Line, refuse
from cosim.circuit.lint.words import closing, number, split_arguments, word_set, words

_LETTERS = str.maketrans(
    {"\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00a7": "_"}
)
"""Both micros, both ohms, and what LTspice puts between the kind of a part and its name."""
_MOST = 50
"""Coefficients of a polynomial, and tables in a line."""

_FUNCTIONS = {
    "if": ("c,x,y", "ternary_fcn(c,x,y)"),
    "limit": ("x,y,z", "min(max(x,min(y,z)),max(y,z))"),
    "uplim": ("x,y,z", "min(x,y-z)+min(max(x-y+z,0),2*z)-min(max(x-y+z,0),2*z)**2/(4*z)"),
    "dnlim": ("x,y,z", "max(x,y+z)-min(max(y+z-x,0),2*z)+min(max(y+z-x,0),2*z)**2/(4*z)"),
    "pwrs": ("x,y", "sgn(x)*pwr(x,y)"),
    "stp": ("x", "u(x)"),
    "buf": ("x", "u(x-0.5)"),
    "inv": ("x", "u(0.5-x)"),
    "hypot": ("x,y", "sqrt(x*x+y*y)"),
}
"""Their functions that ngspice lacks: parameters, and the same in its own."""
_CALL = re.compile(r"(?<![\w.])([a-z_]\w*)\s*\(")
_DEFINED = re.compile(r"\.func\s+(\w+)|(\w+)\s*(?:\([^()]*\)\s*)?=(?!=)")
_TABLE = re.compile(r"(?<![\w.])table\s*\(", re.IGNORECASE)
_PI = re.compile(r"(?<![\w.])pi(?!\w|\s*\()")

_MAKERS = word_set("mfg pn type pppkg iave vpk vceo icrating qg")
_REMARKS = {
    "b": word_set("tripdv tripdt"), "r": word_set("tol pwr"),
    "c": word_set("v irms vrms mtbf") | _MAKERS,
    "l": word_set("ipk irms mtbf") | _MAKERS, "vdmos": word_set("vds ron") | _MAKERS,
}  # fmt: skip
"""Ratings, makers and LTspice's steps, which nothing computes with."""
_PARASITES = {"c": word_set("rser lser rpar cpar rlshunt"), "l": word_set("rser rpar cpar"),
              "v": word_set("rser cpar")}  # fmt: skip
_PAIR = re.compile(
    r"""(?<!\S)([a-z]\w*)\s*=\s*("[^"]*"|\{[^{}]*\}|'[^']*'|[^\s,()"{}']+)""", re.IGNORECASE
)
_SPLIT_NUMBER = re.compile(r"^(\d+)(meg|[tgkmunpf])(\d+)(?!\S)", re.IGNORECASE)
_GLUED = re.compile(r"(?<==)\s*(\d+)(meg|[tgkmunpf])(\d+)(?![\w.])", re.IGNORECASE)
"""4k7 for 4.7k, as a value and behind a name."""
_POINT = re.compile(r"^(\d+)r(\d+)(?!\S)", re.IGNORECASE)
_MODEL = re.compile(r"\.model\s+\S+\s+(\w+)", re.IGNORECASE)
_SWITCH = re.compile(r"\.model\s+(\S+)\s+([vi]switch)\b", re.IGNORECASE)
_CONTROL = {"vswitch": ("v", "1", "0"), "iswitch": ("i", "1m", "0")}
"""Of PSpice's switches: what controls them, and at how much of it they are on and off."""
_LOGIC = re.compile(r"(?<!&)&(?!&)|(?<!\|)\|(?!\|)|~")
_LOGICAL = {"&": "&&", "|": "||", "~": "!"}
"""LTspice's and, or, not."""


def in_ngspice(line: Line) -> list[Line]:
    """The line as ngspice knows it, in one line or more."""
    text = _without_tables(line.text.translate(_LETTERS))
    kind = text[:1].lower()
    if not text.startswith((".inc", ".lib")):
        text = _LOGIC.sub(lambda match: _LOGICAL[match[0]], text)
    text = _GLUED.sub(r"\1.\3\2", text) if kind in "rclx" or _MODEL.match(text) else text
    if kind in "rclv":
        found = [*_passive(text, kind)]
    elif kind in "efgh":
        found = [_source(text)]
    elif kind == "b":
        found = [_taken(text, _REMARKS[kind])[0]]
    elif model := _MODEL.match(text):
        remarks = _REMARKS["vdmos"] if model[1].lower() == "vdmos" else _MAKERS
        found = [_taken(text.replace("(", " ( ", 1), remarks)[0]]
    else:
        found = [text]
    return [replace(line, text=" ".join(each.split())) for each in found]


def prelude(lines: Sequence[Line]) -> list[Line]:
    """The functions and constants of theirs that the lines use and do not define."""
    called: dict[str, set[int]] = {}
    defined: set[str] = set()
    for line in lines:
        text = line.text.lower()
        if text.startswith((".func", ".param")):
            defined.update(*_DEFINED.findall(text))
        if ("{" in text or "'" in text or text.startswith(".param")) and _PI.search(text):
            called["pi"] = {0}
        for match in _CALL.finditer(text):
            if match[1] in _FUNCTIONS:
                inside = text[match.end() : closing(text, match.end() - 1) - 1]
                called.setdefault(match[1], set()).add(len(split_arguments(inside)))
    found = [
        f".func {name}({formals}) {{{body}}}"
        for name, (formals, body) in _FUNCTIONS.items()
        if name not in defined and len(formals.split(",")) in called.get(name, ())
    ]
    if "pi" in called and "pi" not in defined:
        found.append(f".param pi={pi!r}")
    return [Line(text, lines[0].file, 1) for text in found]


def without_smooth_switches(lines: Sequence[Line]) -> list[Line]:
    """PSpice's switches as B sources: from off to on the logarithm of their resistance is a cubic
    of the control (Cadence, *PSpice Reference Guide*, voltage-controlled switch). Raises BadInput.
    """
    scopes = [*_scopes(lines)]
    cards = {
        (scope, match[2][0].lower(), match[1].lower()): _conductance(line, match[2].lower())
        for line, scope in zip(lines, scopes, strict=True)
        if (match := _SWITCH.match(line.text))
    }
    found = []
    for line, scope in zip(lines, scopes, strict=True):
        by, controls = {"s": ("v", 2), "w": ("i", 1)}.get(line.text[0].lower(), ("", 0))
        name, *rest = words(line.text) if controls else [""]
        model = rest[2 + controls] if controls and len(rest) > 2 + controls else ""
        about = (cards.get((scope[:depth], by, model)) for depth in range(len(scope), -1, -1))
        if conductance := next(filter(None, about), None):
            nodes, control = rest[:2], ",".join(rest[2 : 2 + controls])
            law = conductance(f"{by}({control})")
            text = f"b{name} {' '.join(nodes)} i=v({','.join(nodes)})*{law}"
            found.append(replace(line, text=text))
        elif not _SWITCH.match(line.text):
            found.append(line)
    return found


def _scopes(lines: Sequence[Line]) -> Iterator[tuple[int, ...]]:
    """For each line the places of the .subckt lines about it, the outermost first."""
    scope: tuple[int, ...] = ()
    for place, line in enumerate(lines):
        word = line.text.split(None, 1)[0].lower()
        if word == ".subckt":
            scope = (*scope, place)
        elif word == ".ends":
            scope = scope[:-1]
        yield scope


def _conductance(line: Line, kind: str) -> Callable[[str], str]:
    """Of a model of a switch, the expression by its control."""
    by, *ends = _CONTROL[kind]
    given = {"ron": "1", "roff": "1meg", f"{by}on": ends[0], f"{by}off": ends[1]}
    given |= _taken(line.text, given)[1]
    on_resistance, off_resistance, on, off = (f"({value})" for value in given.values())
    known = [number(value) for value in given.values()]
    if 0.0 in known[:2] or (known[2] == known[3] and known[2] is not None):
        refuse(line, f"ron and roff must be above 0, {by}on and {by}off apart")
    middle = f"0.5*ln({on_resistance}*{off_resistance})"
    span = f"ln({on_resistance}/{off_resistance})"

    def law(control: str) -> str:
        way = f"min(max(({control}-0.5*({on}+{off}))/({on}-{off}),-0.5),0.5)"
        return f"exp(-{middle}-{span}*{way}*(1.5-2*{way}*{way}))"

    return law


def _taken(text: str, keys: Collection[str]) -> tuple[str, dict[str, str]]:
    """The text without the assignments to these keys, and what they are."""
    given = {match[1].lower(): match[2] for match in _PAIR.finditer(text)}
    less = _PAIR.sub(lambda match: "" if match[1].lower() in keys else match[0], text)
    return less, {key: value for key, value in given.items() if key in keys}


def _without_tables(text: str) -> str:
    """Calls of ``table`` as the straight lines that they mean, innermost first."""
    if text[:1].lower() in "eg":
        text = re.sub(r"(?i)(?<=\s)table\s*=\s*", "table ", text)  # the source's own, see below
    for match in [*_TABLE.finditer(text)][:_MOST][::-1]:
        end = closing(text, match.end() - 1)
        x, *points = split_arguments(text[match.end() : end - 1]) or [""]
        call = _lines(x, points)
        if call is not None and len(text) + len(call) < MAX_LINE:
            text = text[: match.start()] + call + text[end:]
    return text


def _lines(x: str, points: list[str]) -> str | None:
    """An expression for straight lines between points, level outside; None if they are none."""
    known = [number(point) for point in points[::2]]
    rising = all(a is None or b is None or a < b for a, b in pairwise(known))
    if len(points) < 4 or len(points) % 2 or not rising:
        return None
    return f"pwl(min(max({x}, {points[0]}), {points[-2]}), {', '.join(points)})"


def _passive(text: str, kind: str) -> Iterator[str]:
    """R, C, L and V: without ratings; their parasitic parts as elements of their own."""
    parts = _PARASITES.get(kind, frozenset())
    less, given = _taken(text, parts | _REMARKS.get(kind, frozenset()))
    given = {key: value for key, value in given.items() if key in parts and number(value) != 0.0}
    found = less.split(None, 3)
    if len(found) < 4 or (given and re.search(r"(?i)\bm\s*=", less)):
        yield text
        return
    name, plus, minus, rest = found
    if kind == "v":
        rest = re.sub(r"(?i)\bsine\b", "sin", rest)
    else:
        rest = _SPLIT_NUMBER.sub(r"\1.\3\2", rest)
        rest = _POINT.sub(r"\1.\2", rest) if kind == "r" else rest
    at = plus
    for key in ("rser", "lser"):
        if key in given:
            yield f"{key[0]}{name}_{key} {at} {name}_{key} {given[key]}"
            if key == "lser" and "rlshunt" in given:
                yield f"r{name}_rlshunt {at} {name}_{key} {given['rlshunt']}"
            at = f"{name}_{key}"
    yield f"{name} {at} {minus} {rest}"
    for key in ("rpar", "cpar"):
        if key in given:
            yield f"{key[0]}{name}_{key} {plus} {minus} {given[key]}"


def _source(text: str) -> str:
    """A controlled source; a polynomial or a table as B source, of its name after a B."""
    name, *found = words(text)
    kind = name[0]
    nodes, rest = found[:2], found[2:]
    value = _polynomial(rest, kind) if rest[:1] == ["poly"] else None
    if kind in "eg" and rest[:1] == ["table"] and rest[1:] and rest[1][0] in "{'":
        value = _lines(rest[1].rstrip("=")[1:-1], rest[2:])
    elif kind in "eg" and rest[2:3] == ["table"]:
        value = _lines(f"v({rest[0]},{rest[1]})", rest[3:])
    if value is None:
        return text
    return f"b{name} {' '.join(nodes)} {'v' if kind in 'eh' else 'i'}={value}"


def _polynomial(found: list[str], kind: str) -> str | None:
    """The expression of ``POLY(n)``, controls, coefficients; None if it is none."""
    if len(found) < 2 or not re.fullmatch(r"[1-9]\d?", found[1]):
        return None
    dimension, each = int(found[1]), 2 if kind in "eg" else 1
    read, factors = found[2 : 2 + each * dimension], found[2 + each * dimension :]
    if any("=" in word for word in found) or not 1 + (dimension == 1) <= len(factors) <= _MOST:
        return None  # of one coefficient programs disagree whether it is the constant
    pairs = zip(*[iter(read)] * each, strict=True)
    inputs = [f"{'v' if each == 2 else 'i'}({','.join(names)})" for names in pairs]
    degrees = (combinations_with_replacement(inputs, degree) for degree in count())
    terms = [
        "*".join([f"({factor})", *product])
        for factor, product in zip(factors, chain.from_iterable(degrees), strict=False)
        if number(factor) != 0.0
    ]
    return " + ".join(terms) or "0"
