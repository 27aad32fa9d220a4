"""Polynomials and tables as behavioural sources.

ngspice has code models for them, but these are not installed on every machine, take time in each
step, and round a table's corners.
"""

import re
from itertools import chain, combinations_with_replacement, count, pairwise

from cosim.circuit.dialect.lines import MAX_LINE, MOST
from cosim.circuit.dialect.words import arguments_of, number, words

_TABLE = re.compile(r"(?<![\w.])(?:table|tbl)\s*\(", re.IGNORECASE)


def without_tables(text: str) -> str:
    """Calls of ``table`` rewritten as ``pwl``, the last one first, so inner before outer calls."""
    if text[:1].lower() in "eg":
        text = re.sub(r"(?i)(?<=\s)table\s*=\s*", "table ", text)  # the source's own, see below
    for match in [*_TABLE.finditer(text)][:MOST][::-1]:
        given, end = arguments_of(text, match.end() - 1)
        call = _lines(given[0], given[1:]) if given else None
        if call is not None and len(text) + len(call) < MAX_LINE:
            text = text[: match.start()] + call + text[end:]
    return text


def source(text: str) -> str:
    """A controlled source; a polynomial or a table as a B source with "b" before its name."""
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
    """The expression of ``POLY(n)``, controls, coefficients (of 1, x, y, …, x², xy, …), or None."""
    if len(found) < 2 or not re.fullmatch(r"[1-9]\d?", found[1]):
        return None
    dimension, each = int(found[1]), 2 if kind in "eg" else 1
    read, factors = found[2 : 2 + each * dimension], found[2 + each * dimension :]
    least = 1 if dimension > 1 or [*map(number, factors)] == [0.0] else 2
    if any("=" in word for word in found) or not least <= len(factors) <= MOST:
        return None  # of one coefficient but 0 programs disagree whether it is the constant
    pairs = zip(*[iter(read)] * each, strict=True)  # groups of ``each`` consecutive words
    inputs = [f"{'v' if each == 2 else 'i'}({','.join(names)})" for names in pairs]
    degrees = (combinations_with_replacement(inputs, degree) for degree in count())
    terms = [
        "*".join([f"({factor})", *product])
        for factor, product in zip(factors, chain.from_iterable(degrees), strict=False)
        if number(factor) != 0.0
    ]
    return " + ".join(terms) or "0"


def _lines(x: str, points: list[str]) -> str | None:
    """An expression for straight lines between the points x, y, x, y, …, constant outside; None
    where they are too few, no pairs or do not rise in x."""
    known = [number(point) for point in points[::2]]
    rising = all(a is None or b is None or a < b for a, b in pairwise(known))
    if len(points) < 4 or len(points) % 2 or not rising:
        return None
    if all(number(point) is not None for point in points):
        return f"pwl(min(max({x}, {points[0]}), {points[-2]}), {', '.join(points)})"
    # ngspice's pwl takes no parameters, and braces not within others.
    plain = [f"({point.strip().strip('{}')})" for point in points]
    law = plain[1]
    for a, ya, b, yb in zip(plain[::2], plain[1::2], plain[2::2], plain[3::2], strict=False):
        law += f"+({yb}-{ya})/({b}-{a})*(min(max({x},{a}),{b})-{a})"
    return f"({law})"
