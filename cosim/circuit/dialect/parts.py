"""An element of LTspice or PSpice as several of ngspice's: with parasitic parts, with a law in the
place of a value, with integrals and delays in its expression."""

import re
from collections.abc import Iterator

from cosim.circuit.dialect.lines import MAX_LINE, MOST
from cosim.circuit.dialect.operators import SPLIT
from cosim.circuit.dialect.words import VALUE, WORD, arguments_of, number, taken, word_set

MAKERS = word_set("mfg pn type pppkg iave vpk vceo icrating qg")
REMARKS = {
    "b": word_set("tripdv tripdt"), "r": word_set("tol pwr"),
    "c": word_set("v irms vrms mtbf") | MAKERS,
    "l": word_set("ipk irms mtbf") | MAKERS, "vdmos": word_set("vds ron") | MAKERS,
}  # fmt: skip
"""Keys of parts and models that do not affect the simulation: ratings, makers, step control."""
_PARASITES = {"c": word_set("rser lser rpar cpar rlshunt"), "l": word_set("rser rpar cpar"),
              "v": word_set("rser cpar"),
              **dict.fromkeys("befghi", word_set("rpar cpar"))}  # fmt: skip
_SPLIT_NUMBER = re.compile(rf"^{SPLIT}(?!\S)", re.IGNORECASE)
_POINT = re.compile(r"^(\d+)r(\d+)(?!\S)", re.IGNORECASE)  # 4r7 for 4.7 ohm
_TC = re.compile(rf"(?:\btc\s*=|(?<=\s)tc\s)\s*{VALUE}(?:[\s,]+{VALUE}(?!\s*=))?", re.IGNORECASE)
# R, C, L, Q or flux = an expression, in braces or bare with an operator, up to the next key.
_LAW = re.compile(
    r"([rclq]|flux)\s*=\s*(?:\{([^{}]*)\}|([^={}']*[*/^()][^={}']*?))(?=\s+\w+\s*=(?!=)|$)", re.I
)
_OWN = re.compile(r"(?<![\w.])x(?![\w.(])", re.IGNORECASE)  # the part's own voltage or current
_CHANGING = re.compile(r"\b(?:[vi]\s*\(|time\b)", re.IGNORECASE)
_MEMORY = re.compile(r"(?<![\w.])(idt|sdt|delay)\s*\(", re.IGNORECASE)
_PWL = re.compile(r"(\bpwl\b[\s(]*)([^()]*)", re.IGNORECASE)
# PULSE up to an on-time of 0, with the times of rise and fall as groups.
_NO_WIDTH = re.compile(
    rf"(\bpulse[\s(]+(?:(?:{VALUE[1:-1]})[\s,]+){{3}}{VALUE}[\s,]+{VALUE}[\s,]+)"
    r"0(?:\.0*)?[a-z]*(?![\w.])",
    re.IGNORECASE,
)


def with_parts(text: str, kind: str) -> Iterator[str]:
    """The parasitic parts of an element as elements of their own, then the element without them
    and without ratings."""
    parts = _PARASITES.get(kind, frozenset())
    less, given = taken(text, parts | REMARKS.get(kind, frozenset()))
    given = {key: value for key, value in given.items() if key in parts and number(value) != 0.0}
    found = less.split(None, 3)
    if len(found) < 4 or (given and re.search(r"(?i)\bm\s*=", less)):
        yield text
        return
    name, plus, minus, rest = found
    if kind in "vi":
        rest = re.sub(r"(?i)\bsine\b", "sin", rest)
        # An on-time of 0 lasts to the end of the run in ngspice.
        rest = _NO_WIDTH.sub(_with_width, rest)
        rest = _PWL.sub(lambda pwl: pwl[1] + since_the_start(WORD.findall(pwl[2])), rest)
    elif kind in "rcl":
        rest = _SPLIT_NUMBER.sub(r"\1.\3\2", rest)
        rest = _POINT.sub(r"\1.\2", rest) if kind == "r" else rest
        rest = _TC.sub(lambda tc: f"tc1={tc[1]} tc2={tc[2] or 0}", rest)
    at = plus  # the node to which the next part in series is connected
    for key in ("rser", "lser"):
        if key in given:
            yield f"{key[0]}{name}_{key} {at} {name}_{key} {given[key]}"
            if key == "lser" and "rlshunt" in given:
                yield f"r{name}_rlshunt {at} {name}_{key} {given['rlshunt']}"
            at = f"{name}_{key}"
    for key in ("rpar", "cpar"):
        if key in given:
            yield f"{key[0]}{name}_{key} {plus} {minus} {given[key]}"
    yield f"{name} {at} {minus} {rest}"


def _with_width(match: re.Match[str]) -> str:
    """A match of ``_NO_WIDTH`` with an on-time that is short beside its edges."""
    rise, fall = (value.strip("{}'") for value in match.groups()[1:])
    return f"{match[1]}{{1e-6*max({rise}+{fall},1n)}}"


def since_the_start(points: list[str]) -> str:
    """The points of PWL, with times relative to the last point (``+1u``) made absolute."""
    found, last = [*points], 0.0
    for place, text in enumerate(points):
        if (value := number(text)) is None:
            break  # an expression, or what follows the points
        if place % 2 == 0:
            if text.startswith("+"):
                value += last
                found[place] = repr(value)
            last = value
    return " ".join(found)


def with_law(text: str) -> Iterator[str]:
    """An R, C or L whose value is an expression: in braces, and with its own voltage or current,
    which LTspice calls x, written out."""
    name, plus, minus, rest = [*text.strip().split(None, 3), "", "", ""][:4]
    law = _LAW.match(rest)
    if law is None:
        yield text
    elif (key := law[1].lower()) == "flux" and name[0] in "lL":
        # A gyrator: the voltage of NAME_i is the current, the charge of a capacitor there the flux.
        yield f"g{name}_flux {plus} {minus} {name}_i 0 1"
        yield f"g{name}_x 0 {name}_i {plus} {minus} 1"
        value = _OWN.sub(f"v({name}_i)", law[2] or law[3])
        yield f"c{name}_flux {name}_i 0 q={{{value}}} {rest[law.end() :]}"
    else:
        value = law[2] or law[3]
        value = _OWN.sub(f"v({plus},{minus})", value) if key == "q" else value
        yield f"{name} {plus} {minus} {key}={{{value}}} {rest[law.end() :]}"


def with_memory(text: str) -> Iterator[str]:
    """A source whose idt, sdt and delay are computed by elements before it: each integral by a
    capacitor of 1 F, each delay by a matched line of 1 Ohm."""
    for place in range(MOST):
        match = [*_MEMORY.finditer(text, text.find("=") + 1)][-1:]  # the last: inner calls first
        if not match or len(text) > MAX_LINE // 2 or "=" not in text:
            break
        start, what = match[0].start(), match[0][1].lower()
        given, end = arguments_of(text, match[0].end() - 1)
        x, *more = (each.strip() for each in given or [""])
        node = f"{text.split()[0]}_{what}{place}"
        if what == "delay" and len(more) == 1 and not _CHANGING.search(more[0]):
            yield f"b{node} {node}_in 0 v=2*({x})"
            yield f"r{node}_in {node}_in {node}_at 1"
            yield f"t{node} {node}_at 0 {node} 0 z0=1 td={{{more[0].strip('{}')}}}"
            yield f"r{node} {node} 0 1"
        elif what != "delay" and len(more) < 2:
            start_at = more[0] if more else "0"
            yield f"b{node} 0 {node} i=time > 0 ? {x} : 1e9*(({start_at})-v({node}))"
            yield f"c{node} {node} 0 1"
        else:
            break
        text = f"{text[:start]}v({node}){text[end:]}"
    yield text
