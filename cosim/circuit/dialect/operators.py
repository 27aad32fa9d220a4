"""Operators, numbers and comparisons of LTspice and PSpice in ngspice's spelling."""

import re

from cosim.circuit.dialect.words import MODEL, closing

SPLIT = r"(\d+)(meg|[tgkmunpf])(\d+)"  # 4k7 for 4.7k
_WITHIN = re.compile(rf"v\s*\([^()]*\)|(?<![\w.$#]){SPLIT}(?![\w.])", re.IGNORECASE)
"""4k7 in an expression. Node names within v(…) are matched first, without groups, to be kept."""
_COMPOUND = re.compile(r"\{([^{}]*[^\w.{}\s][^{}]*)\}")
"""A braced expression with an operator. In B sources ngspice drops the braces, so ``{a+b}*2``
becomes ``a+b*2``; written as ``{(a+b)}*2`` it is right."""
_EQUAL = re.compile(
    r"(?<![\w.)}\]])((?!time)[a-z_]\w*|\{\w+\})\s*([=!<]=|<>|>(?!=))\s*(\d+\.?\d*)(?![\w.*/^+-])",
    re.I,
)
_NEAR = {"==": "(abs({}-{})<1e-9*{})", "<=": "({}-{}<1e-9*{})", ">": "({}-{}>1e-9*{})"}
"""Comparisons with a number, with a tolerance: in B sources ngspice rounds parameters, so that 3
becomes 3.0000000000000004. 0 stays exact."""
# First characters of bases whose powers stay: none, or a positive number (of 1e-3 the 3 is seen).
_UNSIGNED = ("", *"0123456789.")
_NAMING = re.compile(r"[\w.$#]")
# An operator, a sign, and the exponent: group 3 has it if it is even, else it is a name or number.
_POWER = re.compile(r"(\s*(?:\*\*|\^)\s*)([+-]?)(?:(\d*[02468])(?![\w.])|[\w.]*)")
_BEFORE = re.compile(r"(?<=[\w)}])\s*(?:\*\*|\^)\s*[+-]?$")  # powers are computed from the left
_LOGIC = re.compile(r"(?<!&)&(?!&)|(?<!\|)\|(?!\|)|~")
_LOGICAL = {"&": "&&", "|": "||", "~": "!"}
"""LTspice's and, or, not."""


def respelt(text: str) -> str:
    """A line with its operators, numbers and comparisons in ngspice's spelling."""
    kind, word = text[:1].lower(), text[:4].lower()
    if word not in (".inc", ".lib"):  # names of files
        text = _LOGIC.sub(lambda match: _LOGICAL[match[0]], text)
        text = text if word == ".mea" else _powers(text)
    if kind in "brclx" or word in (".par", ".def") or MODEL.match(text):
        head, equals, rest = text.partition("=")  # behind which no node stands
        text = head + equals + _pointed(rest)
    text = re.sub(r"\{[^{}]*\}", lambda braced: _pointed(braced[0]), text)
    if kind in "beg":
        text = _EQUAL.sub(_compared, text)
        # Only where some braced expression is not already one pair of parentheses.
        if any(each[0] != "(" or closing(each, 0) < len(each) for each in _COMPOUND.findall(text)):
            text = text.replace("{", "{(").replace("}", ")}")
    return text


def _pointed(expression: str) -> str:
    """4k7 as 4.7k throughout an expression, node names kept."""
    return _WITHIN.sub(lambda m: f"{m[1]}.{m[3]}{m[2]}" if m[1] else m[0], expression)


def _compared(match: re.Match[str]) -> str:
    """A match of ``_EQUAL`` as a comparison with a tolerance."""
    parameter, how, value = match.groups()
    law = _NEAR.get(how, "(abs({}-{})>1e-9*{})")  # of != and <>
    return law.format(parameter, value, value) if float(value) else match[0]


def _powers(text: str) -> str:
    """``x**y`` as ``pow(x,y)`` unless y is an even number, since ngspice's ``**`` raises the
    magnitude of x. Between comparisons ``^`` is the exclusive or of LTspice and PSpice."""
    place = 0
    while match := _POWER.search(text, place):
        start = place = match.start()
        depth = 0  # Backwards to the start of the base: a name, number, bracket, call or power.
        while start and (depth or text[start - 1] in ")}" or _NAMING.match(text[start - 1])):
            start -= 1
            depth += (text[start] in ")}") - (text[start] in "({")
            if not depth and (before := _BEFORE.search(text, max(0, start - 20), start)):
                start = before.start()
        end = match.end()
        if text[end : end + 1] in ("(", "{"):
            end = closing(text, end)
        base, exponent = text[start:place], text[place + len(match[1]) : end]
        if match[3] or base[:1] in _UNSIGNED or not exponent.strip("+-"):
            place = match.end()
            continue
        exclusive = "^" in match[1] and re.search("[<>]|==", base + exponent)
        call = f"({base}!={exponent})" if exclusive else f"pow({base},{exponent})"
        text = f"{text[:start]}{call}{text[end:]}"
        place = start
    return text
