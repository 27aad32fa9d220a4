"""``LAPLACE`` of LTspice and PSpice: a ratio of polynomials in s, as a chain of integrators.

With den(s)·z = u and num(s)·z = y the voltages of the chain are z, s·z, s²·z, …, scaled to similar
size: time by T, at which the highest and the lowest term of the denominator are equal, and voltages
by the numerator's greatest coefficient.
"""

import ast
import re
from collections.abc import Iterator
from functools import reduce
from itertools import zip_longest

from cosim.circuit.dialect.words import NUMBER, closing, number

# Name, two nodes, control (an expression, V=… or two nodes), LAPLACE, law; LTspice's options go.
_FORM = re.compile(
    r"(\S+)\s+([^\s(),=]+)\s+([^\s(),=]+)\s+((?:\S.*?)?)\s*\blaplace\b\s*=?\s*(.+?)"
    r"(?:\s+(?:window|nfft|mtol)\s*=.*)?",
    re.IGNORECASE,
)
_OPERAND = re.compile(rf"(?:{NUMBER.pattern})|(?!s\b)[a-z_]\w*", re.IGNORECASE)
_MOST_POWER, _LONGEST = 10, 1_000  # of s; characters of a coefficient
_One = list[str]  # a polynomial's coefficients, the constant one first; exactly "0" for none
_Ratio = tuple[_One, _One]


def without_laplace(text: str) -> Iterator[str]:
    """The lines of a filter and of the source that it feeds; the text itself without a filter."""
    match = _FORM.fullmatch(text.strip())
    name, plus, minus, control, law = match.groups() if match else ("", "", "", "", "")
    kind, u = "v" if name[:1] in "eE" else "i", ""
    if law[:1] == "{" and not control:
        end = closing(law, 0)
        u, law = law[1 : end - 1], law[end:].lstrip(" =")
    elif own := re.fullmatch(r"([vi])\s*=\s*(.+)", control, re.IGNORECASE):
        kind, u = own.groups()
    elif len(nodes := re.findall(r"[^\s(),=]+", control)) == 2:
        u = f"v({','.join(nodes)})"
    ratio = _ratio(law.replace("{", "(").replace("}", ")")) if u else None
    if ratio is None:
        yield text
        return
    (num, den), own = ratio, re.sub(r"\W", "_", name.lower())
    most = len(den) - 1
    least = next(power for power, each in enumerate(den) if each != "0")
    t, unit = f"cosim_{own}_t", f"cosim_{own}_k"  # no parameters of the user's
    x = [f"{own}_s{power}" for power in range(most + 1)]
    alike = f"abs(({den[most]})/({den[least]}))**(1/{max(most - least, 1)})"
    yield f".param {t}={{{alike if most > least else 1}}}"
    shares = [f"({each})*{t}**(-{power})" for power, each in enumerate(num)]
    greatest = reduce(lambda a, b: f"max({a},abs({b}))", shares, "1e-99")
    yield f".param {unit}={{{greatest}}}"
    held = "".join(
        f"-{{(({each})*{t}**{most - power}/({den[most]}))}}*v({x[power]})"
        for power, each in enumerate(den[:most])
        if each != "0"
    )
    yield f"b{x[most]} {x[most]} 0 v={{({unit}*{t}**{most}/({den[most]}))}}*({u}){held}"
    for power in range(most):  # integrators below the lowest term have no rest point: held at 0
        still = f"time > 0 ? v({x[power + 1]}) : -1e9*v({x[power]})"
        yield f"b{x[power]} 0 {x[power]} i={still if power < least else f'v({x[power + 1]})'}"
        yield f"c{x[power]} {x[power]} 0 {{{t}}}"
    y = "+".join(f"{{({each}/{unit})}}*v({x[power]})" for power, each in enumerate(shares))
    yield f"b{name} {plus} {minus} {kind}={y}"


def _ratio(law: str) -> _Ratio | None:
    """Numerator and denominator without common powers of s; None if the law is no proper ratio.
    Python parses it, with the numbers and names but s replaced by ``_0``, ``_1``, …"""
    found: list[str] = []

    def placed(match: re.Match[str]) -> str:
        found.append(match[0])
        return f"_{len(found) - 1}"

    try:
        tree = ast.parse(_OPERAND.sub(placed, law).replace("^", "**").strip(), mode="eval")
        num, den = _of(tree.body, found)
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return None
    while len(num) > 1 and num[0] == den[0] == "0":
        num, den = num[1:], den[1:]
    return (num, den) if len(num) <= len(den) and den[-1] != "0" else None


def _of(node: ast.expr, found: list[str]) -> _Ratio:
    """The ratio of a node of the law's syntax tree. Raises ValueError where it is none."""
    match node:
        case ast.Name("s" | "S"):
            return ["0", "1"], ["1"]
        case ast.Name(name):
            return [found[int(name[1:])]], ["1"]
        case ast.Call(ast.Name(name), arguments):
            given = [_constant(_of(each, found)) for each in arguments]
            return [f"{found[int(name[1:])]}({','.join(given)})"], ["1"]
        case ast.UnaryOp(ast.USub(), inner):
            num, den = _of(inner, found)
            return _times(["-1"], num), den
        case ast.BinOp(left, operation, right):
            (a, b), (c, d) = _of(left, found), _of(right, found)
        case _:
            raise ValueError
    match operation:
        case ast.Mult():
            return _times(a, c), _times(b, d)
        case ast.Div():
            return _times(a, d), _times(b, c)
        case ast.Add() | ast.Sub():
            sign = ["1"] if isinstance(operation, ast.Add) else ["-1"]
            pairs = zip_longest(_times(a, d), _times(_times(sign, c), b), fillvalue="0")
            sums = ("+".join(each for each in pair if each != "0") or "0" for pair in pairs)
            return [*sums], _times(b, d)
    power = _constant((c, d))
    if len(a) == len(b) == 1:
        return [f"({_constant((a, b))})**({power})"], ["1"]
    if not isinstance(operation, ast.Pow) or number(power) not in range(1, _MOST_POWER):
        raise ValueError
    factors = [(a, b)] * int(number(power) or 1)
    return reduce(lambda x, y: (_times(x[0], y[0]), _times(x[1], y[1])), factors)


def _constant(ratio: _Ratio) -> str:
    (num, *more), (den, *others) = ratio
    if more or others:
        raise ValueError
    return num if den == "1" else f"({num})/({den})"


def _times(a: _One, b: _One) -> _One:
    found = ["0"] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            if "0" not in (x, y):
                term = "*".join(f"({each})" for each in (x, y) if each != "1") or "1"
                found[i + j] = term if found[i + j] == "0" else f"{found[i + j]}+{term}"
    if len(found) > _MOST_POWER + 1 or max(map(len, found)) > _LONGEST:
        raise ValueError
    return found
