"""The words of a netlist's line: brackets, assignments and definitions, as ngspice splits them."""

import re
from collections.abc import Collection
from functools import cache
from typing import NamedTuple

from cosim.circuit.dialect.lines import Line

_ASSIGNED = re.compile(r"\s*(?<![<>=!])=(?!=)\s*")  # "=", but no comparison
_FORMALS = r"\(\s*(?:[a-z_]\w*(?:\s*,\s*[a-z_]\w*)*\s*)?\)"
_DEFINITION = re.compile(rf"(?<!\w)([a-z_]\w*)\s*({_FORMALS})?\s*=(?!=)\s*")
FUNC = re.compile(rf"\.func\s+([a-z_]\w*\s*{_FORMALS})\s*=?(?!=)\s*(\S.*)", re.IGNORECASE)


NUMBER = re.compile(
    r"((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(meg|mil|[tgkmunpf])?[a-z]*(?![\w.])", re.IGNORECASE
)
TOKEN = re.compile(
    r"""(?P<operand>(?P<read>[vi]\s*\(\s*[^\s(){}='][^(){}=']*\))|@[\w.#]+\[\w+\]
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?[a-z]*)|(?P<name>[a-z_][\w.$#]*+(?!\s*\()))
    |(?P<begin>(?P<call>[a-z_][\w.$#]*)\s*\(|[({])|(?P<end>[)}])
    |(?P<join>\*\*|&&|\|\||<>|[=<>!]=|[*/^%&|=<>?:,])|(?P<prefix>[-+!~])
    |[ .'\[\]]|(?P<unknown>.)""",
    re.IGNORECASE | re.VERBOSE | re.DOTALL,
)
"""A token of an expression or of a line of them. Blanks, points, quotes and [ ] belong to no group;
v() and i() are one token with what they read, since nodes are no names of parameters."""
_FACTORS = {"t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "mil": 25.4e-6, "m": 1e-3, "u": 1e-6,
            "n": 1e-9, "p": 1e-12, "f": 1e-15}  # fmt: skip
"""1A is an ampere: "a" for atto exists only in later versions of ngspice."""

# A value in braces, in single quotes or bare, as a group.
VALUE = r"(\{[^{}]*\}|'[^']*'|[^\s,()\"{}'=]++)"
# KEY=VALUE, the value in double quotes or as VALUE, without the latter's group.
_PAIR = re.compile(rf"""(?<!\S)([a-z]\w*)\s*=\s*("[^"]*"|{VALUE[1:-1]})""", re.IGNORECASE)
# .model, its name and base, and its type as a group.
MODEL = re.compile(r"\.model\s+\S+\s+(?:ako:\s*\S+\s+)?(\w+)", re.IGNORECASE)
WORD = re.compile(r"[^\s,]+")


@cache
def word_set(text: str) -> frozenset[str]:
    return frozenset(text.split())


def number(text: str) -> float | None:
    """The value of a plain number as ngspice reads it, None for any other text."""
    match = NUMBER.fullmatch(text, text[:1] in ("+", "-"))
    if match is None:
        return None
    sign = -1.0 if text[0] == "-" else 1.0
    return sign * float(match[1]) * _FACTORS.get((match[2] or "").lower(), 1.0)


def sent(vector: str) -> str:
    """What ngspice calls a vector that it sends: ``i(vemf)`` is ``vemf#branch``, ``v(out)`` is
    ``out``, but ``v(2)`` is ``V(2)``."""
    inner = vector[2:-1]
    if vector[0] == "i":
        return f"{inner}#branch"
    return f"V({inner})" if inner[:1].isdigit() else inner


def words(text: str) -> list[str]:
    """The words of a line, lower case: ``{…}`` and ``'…'`` whole, ``key=value`` in one."""
    found: list[str] = []
    word = ""
    place = 0
    text = text.lower()
    while place < len(text):
        char = text[place]
        if char in "{'":
            end = closing(text, place)
            word += text[place:end]
            place = end
        elif assigned := _ASSIGNED.match(text, place):
            word = (word or (found.pop() if found else "")) + "="
            place = assigned.end()
        else:
            if char in " \t,()":
                if word:
                    found.append(word)
                word = ""
            else:
                word += char
            place += 1
    return [*found, word] if word else found


def closing(text: str, place: int) -> int:
    """The place after the bracket that closes the one at ``place`` (the text's end if none)."""
    if text[place] == "'":
        return (text.find("'", place + 1) + 1) or len(text)
    opening = text[place]
    shutting = {"{": "}", "(": ")"}[opening]
    depth = 0
    for i in range(place, len(text)):
        depth += (text[i] == opening) - (text[i] == shutting)
        if depth == 0:
            return i + 1
    return len(text)


def arguments_of(text: str, place: int) -> tuple[list[str], int]:
    """The arguments of the call whose bracket is at ``place``, and the place after the call."""
    end = closing(text, place)
    inside, found, place = text[place + 1 : end - 1], [""], 0
    while place < len(inside):
        after = closing(inside, place) if inside[place] in "({'" else place + 1
        if inside[place] == ",":
            found.append("")
        else:
            found[-1] += inside[place:after]
        place = after
    return (found if inside.strip() else []), end


class Definition(NamedTuple):
    """A function with its formal parameters, or a parameter, which has None there."""

    name: str
    formals: list[str] | None
    body: str
    line: Line


def definitions(line: Line) -> list[Definition]:
    """The definitions of a line, lower case; none if it is no ``.param`` line."""
    if not line.text.lower().startswith(".param"):
        return []
    body = line.text.partition(" ")[2].lower()
    starts = [*_DEFINITION.finditer(unbraced(body))]
    ends = [match.start() for match in starts[1:]] + [len(body)]
    return [
        Definition(
            match[1],
            re.findall(r"\w+", match[2]) if match[2] else None,
            body[match.end() : end].strip(" ,"),
            line,
        )
        for match, end in zip(starts, ends, strict=False)
    ]


def unbraced(text: str) -> str:
    """The text with the content of braces and quotes replaced by as many blanks."""
    return re.sub(r"\{[^{}]*\}|'[^']*'", lambda match: f"{{{' ' * (len(match[0]) - 2)}}}", text)


def split_assignments(found: list[str]) -> tuple[list[str], list[str]]:
    """The words before the first ``key=value`` or ``params:``, and the assignments after these."""
    for i, word in enumerate(found):
        if word in ("params:", "optional:", "text:") or "=" in word:
            return found[:i], [word for word in found[i:] if "=" in word]
    return found, []


def taken(text: str, keys: Collection[str]) -> tuple[str, dict[str, str]]:
    """The text without the assignments to these keys, and their values."""
    given = {match[1].lower(): match[2] for match in _PAIR.finditer(text)}
    less = _PAIR.sub(lambda match: "" if match[1].lower() in keys else match[0], text)
    return less, {key: value for key, value in given.items() if key in keys}
