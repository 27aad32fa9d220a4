"""Translates the dialects of LTspice and PSpice to ngspice's.

Each logical line is rewritten before any check, so the checks see what ngspice will see. What
cannot be rewritten stays as it is, and is refused where it is used.

Polynomials and tables become behavioural sources. ngspice has code models for them, but these are
not installed on every machine, take time in each step, and round a table's corners.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import chain, combinations, combinations_with_replacement, count, pairwise
from math import pi
from typing import Any

from cosim.circuit.lint.laplace import without_laplace
from cosim.circuit.lint.lines import COPY, MAX_LINE, Line, refuse, shown, unusable
from cosim.circuit.lint.words import closing, number, split_arguments, word_set, words
from cosim.errors import BadInput

_Key = tuple[Any, ...]  # a scope, and a name in it, perhaps with the kind of element before it


_LETTERS = str.maketrans(
    {"\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00a7": "_"}
)
"""Both micros, both ohms, and the section sign that LTspice puts between a part's kind and name."""
_MOST = 50
"""At most so many coefficients of a polynomial, and so many tables or integrals in a line."""

# The switch's control c, scaled to -0.5 at "off" (f) and 0.5 at "on" (n).
_WAY = "min(max((c-0.5*(n+f))/(n-f),-0.5),0.5)"
FUNCTIONS = {
    "if": ("c,x,y", "ternary_fcn((c)>0.5,x,y)"),
    "limit": ("x,y,z", "min(max(x,min(y,z)),max(y,z))"),
    "uplim": ("x,y,z", "min(x,y-z)+min(max(x-y+z,0),2*z)-min(max(x-y+z,0),2*z)**2/(4*z)"),
    "dnlim": ("x,y,z", "max(x,y+z)-min(max(y+z-x,0),2*z)+min(max(y+z-x,0),2*z)**2/(4*z)"),
    "pow": ("x,y", "ternary_fcn(x<0&&abs(y-2*floor(y/2)-1)<1e-9,-1,1)*(abs(x)+1e-99)**(y)"),
    "pwr": ("x,y", "(abs(x)+1e-99)**(y)"),
    "pwrs": ("x,y", "sgn(x)*(abs(x)+1e-99)**(y)"),
    "arctan": ("x", "atan(x)"),
    "int": ("x", "sgn(x)*floor(abs(x))"),
    "round": ("x", "floor(x+0.5)"),
    "stp": ("x", "u(x)"),
    "buf": ("x", "u(x-0.5)"),
    "inv": ("x", "u(0.5-x)"),
    "mc": ("x,y", "aunif(x,x*(y))"),
    "flat": ("x", "aunif(0,x)"),
    "hypot": ("x,y", "sqrt(x*x+y*y)"),
    "atan2": (
        "y,x",
        "ternary_fcn(x>=0,1,-1)*atan(y/(abs(x)+1e-99))"
        f"+ternary_fcn(x>=0,0,ternary_fcn(y<0,-1,1)*{pi!r})",
    ),
    "fabs": ("x", "abs(x)"),
    "cosim_switch": ("c,n,f,r,q", f"exp(-0.5*ln(r*q)-ln(r/q)*{_WAY}*(1.5-2*{_WAY}**2))"),
    "cosim_diode": ("x,f,b,r,q,d", "x/q+max(x-f,0)*(1/r-1/q)-max(-x-b,0)*(1/d-1/q)"),
}
"""Functions of LTspice and PSpice that ngspice lacks, or defines otherwise in B sources (there
``pwr`` has the sign of x, ``pow`` never a sign): formal parameters, and the body for ngspice. 1e-99
keeps the slope of roots finite at 0. The logarithm of a switch's resistance is a cubic of its
control (Cadence, *PSpice Reference Guide*, voltage-controlled switch)."""
_CALL = re.compile(r"(?<![\w.])([a-z_]\w*)\s*\(")
_DEFINED = re.compile(r"\.func\s+(\w+)|(\w+)\s*(?:\([^()]*\)\s*)?=(?!=)")
_TABLE = re.compile(r"(?<![\w.])(?:table|tbl)\s*\(", re.IGNORECASE)
_DRAWN = re.compile(r"^(i\S*)\s+(\S+)\s+(\S+)\s+(?:tbl|table)\s*=?\s*\(([^()]*)\)", re.I)
"""A source whose current is a table of its own voltage."""
_BY_LAW = re.compile(r"^(b\S*)\s+(\S+)\s+(\S+)\s+r\s*=(?!=)\s*(.*?)(?=\s+\w+\s*=(?!=)|$)", re.I)
"""LTspice's resistor of this law."""
_PI = re.compile(r"(?<![\w.])pi(?!\w|\s*\()")
_CONSTANTS = {"pi": pi, "boltz": 1.380649e-23, "echarge": 1.602176634e-19, "kelvin": -273.15}
"""LTspice's, in J/K, C and degrees Celsius; of ``pi`` B sources know themselves."""
_NATURE = re.compile(r"(?<![\w.])(boltz|echarge|kelvin)(?!\w|\s*\()")

_SIGMA = re.compile(r"(?<![\w.])gauss\s*\(([^(),]*)\)", re.IGNORECASE)
"""LTspice's, of the standard deviation alone."""

_MAKERS = word_set("mfg pn type pppkg iave vpk vceo icrating qg")
_REMARKS = {
    "b": word_set("tripdv tripdt"), "r": word_set("tol pwr"),
    "c": word_set("v irms vrms mtbf") | _MAKERS,
    "l": word_set("ipk irms mtbf") | _MAKERS, "vdmos": word_set("vds ron") | _MAKERS,
}  # fmt: skip
"""Keys of parts and models that do not affect the simulation: ratings, makers, step control."""
_PARASITES = {"c": word_set("rser lser rpar cpar rlshunt"), "l": word_set("rser rpar cpar"),
              "v": word_set("rser cpar"),
              **dict.fromkeys("befghi", word_set("rpar cpar"))}  # fmt: skip
_VALUE = r"(\{[^{}]*\}|'[^']*'|[^\s,()\"{}'=]++)"
# KEY=VALUE, the value in double quotes or as _VALUE, without the latter's group.
_PAIR = re.compile(rf"""(?<!\S)([a-z]\w*)\s*=\s*("[^"]*"|{_VALUE[1:-1]})""", re.IGNORECASE)
_SPLIT = r"(\d+)(meg|[tgkmunpf])(\d+)"  # 4k7 for 4.7k
_SPLIT_NUMBER = re.compile(rf"^{_SPLIT}(?!\S)", re.IGNORECASE)
_WITHIN = re.compile(rf"v\s*\([^()]*\)|(?<![\w.$#]){_SPLIT}(?![\w.])", re.IGNORECASE)
"""4k7 in an expression. Node names within v(…) are matched first, without groups, to be kept."""
_POINT = re.compile(r"^(\d+)r(\d+)(?!\S)", re.IGNORECASE)  # 4r7 for 4.7 ohm
_VALUED = re.compile(r"(?<=\s)value\s*=?\s*(?={)", re.IGNORECASE)
_TC = re.compile(rf"(?:\btc\s*=|(?<=\s)tc\s)\s*{_VALUE}(?:[\s,]+{_VALUE}(?!\s*=))?", re.IGNORECASE)
_TEMP = re.compile(r"\.(?:temp\b[\s=]*|opt\w*\s(?:.*[\s,])?temp\s*=\s*)(\{[^{}]*\}|[^\s,]+)", re.I)
_WARMTH = re.compile(r"(?<![\w.])temp(?!\w|\s*[=(])")
_SYNONYMS = {".params": ".param", ".define": ".param", "cap": "c", "ind": "l"}
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
_KIND = re.compile(r"^([efgh]\S*(?:\s+\S+){2}\s+)[vc]c[vc]s\s+(?!.*\b(?:max|min)\s*=)", re.I)
"""VCVS, CCCS and the like: HSPICE's redundant word for the kind of a source without MAX or MIN."""
_NOISELESS = re.compile(r"\s+noiseless\b", re.IGNORECASE)
# R, C, L, Q or flux = an expression, in braces or bare with an operator, up to the next key.
_LAW = re.compile(
    r"([rclq]|flux)\s*=\s*(?:\{([^{}]*)\}|([^={}']*[*/^()][^={}']*?))(?=\s+\w+\s*=(?!=)|$)", re.I
)
_OWN = re.compile(r"(?<![\w.])x(?![\w.(])", re.IGNORECASE)  # the part's own voltage or current
_CHANGING = re.compile(r"\b(?:[vi]\s*\(|time\b)", re.IGNORECASE)
_MEMORY = re.compile(r"(?<![\w.])(idt|sdt|delay)\s*\(", re.IGNORECASE)
_COILS = re.compile(r"(k\S*)((?:\s+l\S*){3,})\s+(\S+)", re.IGNORECASE)  # K of three or more
_PWL = re.compile(r"(\bpwl\b[\s(]*)([^()]*)", re.IGNORECASE)
# PULSE up to an on-time of 0, with the times of rise and fall as groups.
_NO_WIDTH = re.compile(
    rf"(\bpulse[\s(]+(?:(?:{_VALUE[1:-1]})[\s,]+){{3}}{_VALUE}[\s,]+{_VALUE}[\s,]+)"
    r"0(?:\.0*)?[a-z]*(?![\w.])",
    re.IGNORECASE,
)
_WORD = re.compile(r"[^\s,]+")
# NAME VALUE in a .param line without equals signs.
_UNEQUAL = re.compile(r"(?<=\s)([a-z_]\w*)\s+(?=[{'\d.+-]|[a-z_]\w*\()", re.IGNORECASE)
_MODEL = re.compile(r"\.model\s+\S+\s+(?:ako:\s*\S+\s+)?(\w+)", re.IGNORECASE)
_AKO = re.compile(r"\.model\s+\S+\s+ako:([^\s()]+)", re.IGNORECASE)
_DEVICES = {"vswitch": "s", "sw": "s", "iswitch": "w", "csw": "w", "d": "d"}  # their letters
_SWITCHING = re.compile(rf"\.model\s+(\S+)\s+({'|'.join(_DEVICES)})\b")
_ODD = word_set("lser vser ilimit revilimit epsilon revepsilon")
_CARDS = {
    "vswitch": {"von": "1", "voff": "0", "ron": "1", "roff": "1meg"},
    "iswitch": {"ion": "1m", "ioff": "0", "ron": "1", "roff": "1meg"},
    "sw": {"vt": "0", "vh": "0", "ron": "1", "roff": "1e12"},
    "csw": {"it": "0", "ih": "0", "ron": "1", "roff": "1e12"},
    "d": {"vfwd": "0", "vrev": "1e30", "ron": "1", "roff": "1e12", "rrev": ""},
}
"""Default parameters of these models, in the order in which ``_law`` unpacks them."""
_GATE = {
    "vhigh": "1", "vlow": "0", "ref": "0.5*(vhigh+vlow)", "vt": "0.5", "vh": "0.01", "td": "0",
    "trise": "0", "tfall": "0", "tau": "0", "rout": "1", "cout": "0", "tripdt": "", "tripv": "",
}  # fmt: skip
_CURRENT = re.compile(rf"\bi\s*\(\s*(l[^\s()]*)\s*\)\s*=\s*{_VALUE}[\s,]*", re.IGNORECASE)
# First characters of bases whose powers stay: none, or a positive number (of 1e-3 the 3 is seen).
_UNSIGNED = ("", *"0123456789.")
_NAMING = re.compile(r"[\w.$#]")
# An operator, a sign, and the exponent: group 3 has it if it is even, else it is a name or number.
_POWER = re.compile(r"(\s*(?:\*\*|\^)\s*)([+-]?)(?:(\d*[02468])(?![\w.])|[\w.]*)")
_BEFORE = re.compile(r"(?<=[\w)}])\s*(?:\*\*|\^)\s*[+-]?$")  # powers are computed from the left
_LOGIC = re.compile(r"(?<!&)&(?!&)|(?<!\|)\|(?!\|)|~")
_LOGICAL = {"&": "&&", "|": "||", "~": "!"}
"""LTspice's and, or, not."""
_TRUTH = re.compile(
    r"(?:(?<=[(,{~&|])|(?<=\w=))\s*(v\([^()]*\))(?=\s*(?:&(?!&)|\|(?!\|)))"  # left
    r"|(?:(?<=~)|(?<=(?<!&)&)|(?<=(?<!\|)\|))\s*(v\([^()]*\))(?=\s*(?:[&|)?},;]|$))",  # right
    re.IGNORECASE,
)
"""A bare voltage as their operand: true above 0.5 to LTspice; to ngspice all but 0 is true."""


def _pointed(expression: str) -> str:
    """4k7 as 4.7k throughout an expression, node names kept."""
    return _WITHIN.sub(lambda m: f"{m[1]}.{m[3]}{m[2]}" if m[1] else m[0], expression)


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
        points = ",".join(_WORD.findall(points))
        text = f"b{name} {plus} {minus} i=table(v({plus},{minus}),{points}){text[drawn.end() :]}"
    text = _without_tables(_BY_LAW.sub(r"\1 \2 \3 i=v(\2,\3)/(\4)", text))
    if text[:1].lower() in "beg":
        text = _VALUED.sub("value=", re.sub(r"'([^']*)'", r"{\1}", text))
        head, equals, rest = text.partition("=")  # a name before a blank is no function to ngspice
        text = head + equals + re.sub(r"(?<![\w.])([a-z_]\w*)\s+\(", r"\1(", rest, flags=re.I)
        text = _TRUTH.sub(lambda truth: f"({truth[1] or truth[2]}>0.5)", text)
        if len(parts := [*without_laplace(text)]) > 1:  # B sources, rewritten in their turn
            return [each for part in parts for each in in_ngspice(replace(line, text=part))]
    return [replace(line, text=" ".join(each.split())) for each in _parts_of(_expressed(text))]


def _expressed(text: str) -> str:
    """A line with its operators, numbers and comparisons in ngspice's spelling."""
    kind, word = text[:1].lower(), text[:4].lower()
    if word not in (".inc", ".lib"):  # names of files
        text = _LOGIC.sub(lambda match: _LOGICAL[match[0]], text)
        text = text if word == ".mea" else _powers(text)
    if kind in "brclx" or word in (".par", ".def") or _MODEL.match(text):
        head, equals, rest = text.partition("=")  # behind which no node stands
        text = head + equals + _pointed(rest)
    text = re.sub(r"\{[^{}]*\}", lambda braced: _pointed(braced[0]), text)
    if kind in "beg":
        text = _EQUAL.sub(_compared, text)
        # Only where some braced expression is not already one pair of parentheses.
        if any(each[0] != "(" or closing(each, 0) < len(each) for each in _COMPOUND.findall(text)):
            text = text.replace("{", "{(").replace("}", ")}")
    return text


def _parts_of(text: str) -> Sequence[str]:
    """A line as those of which ngspice makes the same: elements with parasitic parts, laws or
    memory, gates and coils taken apart, directives and models spelt as ngspice has them."""
    kind = text[:1].lower()
    if kind == "q":  # the substrate in brackets
        return [re.sub(r"\[([^\s\[\]]+)\]", r"\1", text)]
    if kind in "rclvibefgh":
        *parts, own = _with_parts(text, kind)
        own = _source(own) if kind in "efgh" else own
        split = _with_memory if kind in "beg" else _with_law if kind in "rcl" else lambda own: [own]
        return [*parts, *split(own)]
    if kind == "a":
        return _gate(text)
    if coils := _COILS.fullmatch(text):
        pairs = enumerate(combinations(coils[2].split(), 2))
        return [f"{coils[1]}_{place} {' '.join(pair)} {coils[3]}" for place, pair in pairs]
    if text.lower().startswith((".param", ".define")):
        word, _, rest = text.partition(" ")
        rest = rest if "=" in rest else _UNEQUAL.sub(r"\1=", f" {rest}")
        return [f"{_SYNONYMS.get(word.lower(), word)} {rest}"]
    if text.lower().startswith((".ic", ".nodeset")):
        return [re.sub(r"\)\s+(?=[{'\d.+-])", ")=", text)]
    if model := _MODEL.match(text):
        remarks = _REMARKS["vdmos"] if model[1].lower() == "vdmos" else _MAKERS
        own = _SYNONYMS.get(model[1].lower(), model[1])
        text = text[: model.start(1)] + own + text[model.end(1) :]
        text = re.sub(r"(?i)(?<=\sako:)\s+", "", text)
        return [_taken(text.replace("(", " ( ", 1), remarks)[0]]
    return [text]


def prelude(lines: Sequence[Line]) -> list[Line]:
    """Definitions of the foreign functions and constants that the lines use but do not define."""
    called: dict[str, set[int]] = {}  # numbers of arguments by name
    defined, temperature = set[str](), "27"
    for line in lines:
        text = line.text.lower()
        if text.startswith((".func", ".param")):
            defined.update(*_DEFINED.findall(text))
        if ("{" in text or "'" in text or text.startswith(".param")) and _PI.search(text):
            called["pi"] = {0}
        called |= {key: {0} for key in _NATURE.findall(text)}
        if temp := _TEMP.match(text):
            temperature = temp[1]
        elif _WARMTH.search(text):
            called["temp"] = {0}
        for match in _CALL.finditer(text):
            if match[1] in FUNCTIONS:
                inside = text[match.end() : closing(text, match.end() - 1) - 1]
                called.setdefault(match[1], set()).add(len(split_arguments(inside)))
    found = [
        f".func {name}({formals}) {{{body}}}"
        for name, (formals, body) in FUNCTIONS.items()
        if name not in defined and len(formals.split(",")) in called.get(name, ())
    ]
    wanted = (name for name in _CONSTANTS if name in called and name not in defined)
    found += [f".param {name}={_CONSTANTS[name]!r}" for name in wanted]
    if "temp" in called and "temp" not in defined:
        found.append(f".param temp={temperature}")
    return [Line(text, lines[0].file, 1) for text in found]


def in_ngspice_together(lines: Sequence[Line]) -> list[Line]:
    """Translates what spans several lines: models derived from another (``ako:``), switches and
    diodes of other programs as B sources, and currents of inductors in ``.ic``. Where a model only
    approximates the original, a line ``.told`` says so to the user. Raises BadInput."""
    scopes, lines = [*_scopes(lines)], [*lines]
    _complete(lines, scopes)
    known: dict[_Key, str] = {}
    firsts = (line.text.split(None, 1)[0].lower() for line in lines)
    elements = {*zip(scopes, firsts, strict=True)}
    for place, (line, scope) in enumerate(zip(lines, scopes, strict=True)):
        text = line.text.lower()
        if match := _SWITCHING.match(text):
            try:
                law, told = _law(line, match[2])
                key = scope, _DEVICES[match[2]], match[1]
                if known.setdefault(key, law) != law:
                    known[key] = ""
                    refuse(
                        line, f"there is a second model {shown(match[1])}, so this cannot be read"
                    )
                if law:
                    lines[place] = replace(line, text=told and f".told {told}")
            except BadInput as error:
                lines[place] = unusable(line, error, f".model {words(line.text)[1]}")
        elif text.startswith(".ic"):
            for name, current in _CURRENT.findall(text):
                if (scope, name) not in elements:
                    refuse(line, f"there is no inductor {shown(name)} here")
                known[scope, name] = current
            lines[place] = replace(line, text=_CURRENT.sub("", line.text).strip())
    apart = (_apart(*each, known) for each in zip(lines, scopes, strict=True))
    return [line for line in chain(*apart) if line.text.lower() not in ("", ".ic")]


def _apart(line: Line, scope: tuple[int, ...], known: Mapping[_Key, str]) -> list[Line]:
    """The lines of an element: a switch or diode as a B source by its model's law, an inductor with
    the initial current that ``known`` has for it, any other as it is."""
    name, *rest = words(line.text) if line.text[:1].lower() in {*"swdl"} else [""]
    count = {"s": 4, "w": 3}.get(name[:1], 2)
    law = _nearest(known, scope, name[:1], rest[count]) if len(rest) > count else None
    texts, (plus, minus, *control) = [line.text], rest[:count] if law else ["", ""]
    if (scope, name) in known and len(rest) > 2:
        # At the operating point a source of 1 GV per ampere of error holds the current, later 0 V.
        error = f"1e9*(i(v{name}_ic)-({known[scope, name]}))"
        texts = [
            " ".join([name, rest[0], f"{name}_ic", *rest[2:]]),
            f"v{name}_ic {name}_ic {name}_at 0",
            f"b{name}_ic {name}_at {rest[1]} v=time > 0 ? 0 : {error}",
        ]
    elif law and name[0] == "d":
        if rest[3:] not in ([], ["off"]):
            refuse(line, f"{shown(rest[3])} of an ideal diode is not read; leave it out")
        texts = [f"b{name} {plus} {minus} i=cosim_diode(v({plus},{minus}),{law})"]
    elif law:
        by = f"{'i' if name[0] == 'w' else 'v'}({','.join(control)})"
        texts = [f"b{name} {plus} {minus} i=v({plus},{minus})*cosim_switch({by},{law})"]
    return [replace(line, text=text) for text in texts]


def _nearest(known: Mapping[_Key, Any], scope: tuple[int, ...], *key: str) -> Any:
    """The value of a key in the innermost enclosing scope that has it; None without any."""
    about = ((scope[:depth], *key) for depth in range(len(scope), -1, -1))
    return next((known[each] for each in about if each in known), None)


def _complete(lines: list[Line], scopes: Sequence[tuple[int, ...]]) -> None:
    """Write out each model derived by ``ako:`` with the parameters that it inherits."""
    own: dict[_Key, int] = {}  # places of models; -1 where a scope has two of the same name
    for place, (line, scope) in enumerate(zip(lines, scopes, strict=True)):
        if _MODEL.match(line.text):
            key = scope, words(line.text)[1]
            own[key] = -1 if key in own else place

    def complete(place: int, seen: tuple[int, ...] = (-1,)) -> None:
        if (match := _AKO.match(lines[place].text)) is None:
            return
        base = _nearest(own, scopes[place], match[1].lower())
        if base is None or base in (place, *seen):
            refuse(lines[place], f"no model {shown(match[1])} is defined here{COPY}")
        complete(base, (place, *seen))
        kind, *given = words(lines[base].text)[2:] or [""]
        name, _, *rest = words(lines[place].text)[1:]
        if rest and "=" not in rest[0] and rest.pop(0) != kind:
            refuse(lines[place], f"{shown(match[1])} is of type {kind}; write all of the model")
        keys = {word.partition("=")[0] for word in rest}
        inherited = (word for word in given if word.partition("=")[0] not in keys)
        text = " ".join([".model", name, kind, *inherited, *rest])
        lines[place] = replace(lines[place], text=text)

    for place, line in enumerate(lines):
        try:
            complete(place)
        except BadInput as error:
            lines[place] = unusable(line, error, f".model {words(line.text)[1]}")


def _scopes(lines: Sequence[Line]) -> Iterator[tuple[int, ...]]:
    """For each line the places of the .subckt lines that enclose it, the outermost first."""
    scope: tuple[int, ...] = ()
    for place, line in enumerate(lines):
        word = line.text.split(None, 1)[0].lower()
        if word == ".subckt":
            scope = (*scope, place)
        elif word == ".ends":
            scope = scope[:-1]
        yield scope


def _law(line: Line, kind: str) -> tuple[str, str]:
    """The parameters that ``cosim_switch`` or ``cosim_diode`` take for a model that ngspice lacks,
    and a remark for the user. Both are empty where ngspice has the model itself."""
    given = _taken(line.text, _CARDS[kind])[1]
    first, second, ron, roff, *rrev = (_CARDS[kind] | given).values()
    odd = {key for key, value in _taken(line.text, _ODD)[1].items() if number(value) != 0.0}
    # Chained: both thresholds are plain numbers, and equal.
    told, same = "", number(first) == number(second) is not None
    if kind == "d":
        if not given or odd - {"epsilon", "revepsilon"}:
            return "", ""
        told, same = "epsilon has no effect: the ideal diode has corners here" * bool(odd), False
    elif kind in ("sw", "csw"):
        if odd or (number(second) or 0.0) >= 0.0:
            return "", ""
        told = "between off and on this switch is PSpice's, as LTspice's curve is not published"
        same = False
        first, second = f"({first})-({second})", f"({first})+({second})"
    if same or 0.0 in map(number, (ron, roff, *rrev)):
        refuse(line, f"ron and roff must be above 0, {' and '.join([*_CARDS[kind]][:2])} apart")
    values = (first, second, ron, roff, *(value or ron for value in rrev))
    return ",".join(f"({value})" for value in values), told


def _taken(text: str, keys: Collection[str]) -> tuple[str, dict[str, str]]:
    """The text without the assignments to these keys, and their values."""
    given = {match[1].lower(): match[2] for match in _PAIR.finditer(text)}
    less = _PAIR.sub(lambda match: "" if match[1].lower() in keys else match[0], text)
    return less, {key: value for key, value in given.items() if key in keys}


def _without_tables(text: str) -> str:
    """Calls of ``table`` rewritten as ``pwl``, the last one first, so inner before outer calls."""
    if text[:1].lower() in "eg":
        text = re.sub(r"(?i)(?<=\s)table\s*=\s*", "table ", text)  # the source's own, see below
    for match in [*_TABLE.finditer(text)][:_MOST][::-1]:
        end = closing(text, match.end() - 1)
        x, *points = split_arguments(text[match.end() : end - 1]) or [""]
        call = _lines(x, points)
        if call is not None and len(text) + len(call) < MAX_LINE:
            text = text[: match.start()] + call + text[end:]
    return text


def _with_width(match: re.Match[str]) -> str:
    """A match of ``_NO_WIDTH`` with an on-time that is short beside its edges."""
    rise, fall = (value.strip("{}'") for value in match.groups()[1:])
    return f"{match[1]}{{1e-6*max({rise}+{fall},1n)}}"


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


def _with_parts(text: str, kind: str) -> Iterator[str]:
    """The parasitic parts of an element as elements of their own, then the element without them
    and without ratings."""
    parts = _PARASITES.get(kind, frozenset())
    less, given = _taken(text, parts | _REMARKS.get(kind, frozenset()))
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
        rest = _PWL.sub(lambda pwl: pwl[1] + since_the_start(_WORD.findall(pwl[2])), rest)
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


def _with_law(text: str) -> Iterator[str]:
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


def _with_memory(text: str) -> Iterator[str]:
    """A source whose idt, sdt and delay are computed by elements before it: each integral by a
    capacitor of 1 F, each delay by a matched line of 1 Ohm."""
    for place in range(_MOST):
        match = [*_MEMORY.finditer(text, text.find("=") + 1)][-1:]  # the last: inner calls first
        if not match or len(text) > MAX_LINE // 2 or "=" not in text:
            break
        start, what, after = match[0].start(), match[0][1].lower(), match[0].end()
        end = closing(text, after - 1)
        x, *more = (each.strip() for each in split_arguments(text[after : end - 1]) or [""])
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


def _gate(text: str) -> list[str]:
    """LTspice's gate, Schmitt trigger or flip-flop, as a chain: a switch with hysteresis, closed
    while the control is above the middle (an AND's control is its lowest input), a delay, an edge
    of 1 ns or more, and a source for each output. A clocked flip-flop stores its state on two
    capacitors. Inputs at the common node count as not connected."""
    less, given = _taken(text, _GATE)
    name, *nodes = less.lower().split()
    if len(nodes) != 9:
        return [text]
    *inputs, below, above, common, kind = nodes
    law = {key: "(" + value.strip("{}'") + ")" for key, value in (_GATE | given).items()}
    ref = re.sub("v(?:high|low)", lambda match: law[match[0]], law["ref"])
    x = [f"v({each},{common})" for each in inputs if each != common]
    # Control y of the switch, middle and half width of its hysteresis.
    middle, half, y = ref, "0", x[0] if x else ""
    first: list[str] = []
    if kind in ("and", "or") and x:
        y = reduce(lambda a, b: f"{'min' if kind == 'and' else 'max'}({a},{b})", x)
    elif kind == "xor" and len(x) == 2:
        y, middle = f"-({x[0]}-{ref})*({x[1]}-{ref})", "0"
    elif kind == "schmitt" and (len(x) == 1 or (len(x) == 2 and common not in inputs[:2])):
        y, middle, half = "-".join(x), law["vt"], law["vh"]
    elif kind == "srflop" and len(x) == 2 and common not in inputs[:2]:
        y, middle, half = "-".join(x), "0", ref
    elif kind == "dflop" and inputs[1] == common not in (inputs[0], inputs[2]):
        data, preset, clear = (
            f"v({inputs[place]},{common})>{ref}" if inputs[place] != common else "0>1"
            for place in (0, 3, 4)
        )
        # Master w follows the data while the clock is low, slave s follows w while it is high. Each
        # holds its voltage by no current: comparing it with a half instead has two solutions.
        up, master, y = f"v({name}_c_p)>0.5", f"v({name}_w)>0.5", f"v({name}_s)"
        first = _held(f"{name}_c", f"v({inputs[2]},{common})", ref, "0")
        for each, taken, follows in (("w", f"1-({up})", data), ("s", up, master)):
            own = f"v({name}_{each})"
            aim = f"({taken}) ? (({follows}) ? 1 : 0)-{own} : 0"
            aim = f"{clear} ? 0-{own} : ({preset} ? 1-{own} : ({aim}))"
            first.append(f"b{name}_{each} 0 {name}_{each} i={aim}")
            first += [f"c{name}_{each} {name}_{each} 0 1n", f"r{name}_{each} {name}_{each} 0 1e12"]
        middle = "0.5"
    elif kind != "buf" or len(x) != 1:
        return [text]
    # The switch of 1 Ohm and its load of 1 kOhm divide 1 V by 1.001.
    state, td = f"1.001*v({name}_p)", law["td"][1:-1]
    state = state if number(td) == 0.0 else f"delay({state},{{{td}}})"
    found = [
        *first,
        *_held(name, y, middle, half),
        *_with_memory(f"b{name}_d {name}_d 0 v={state}"),
        f"r{name}_q {name}_d {name}_q 1",
        f"c{name}_q {name}_q 0 {{max(max(1n,{law['trise']})/2.2,{law['tau']})}}",
    ]
    for pin, out, share in ((6, below, f"(1-v({name}_q))"), (7, above, f"v({name}_q)")):
        if out != common:
            level = f"{law['vlow']}+({law['vhigh']}-{law['vlow']})*{share}"
            found.append(f"b{name}_{pin} {name}_{pin} {common} v={level}")
            found.append(f"r{name}_{pin} {name}_{pin} {out} {{{law['rout']}}}")
            found.append(f"c{name}_{pin} {out} {common} {{{law['cout']}}}")
    return found


def _held(name: str, y: str, middle: str, half: str) -> list[str]:
    """Elements of a node NAME_p that goes to 1 V where y rises through ``middle`` + ``half``, and
    to 0 where it falls through ``middle`` - ``half``."""
    return [
        f"b{name}_x {name}_x 0 v={y}",
        f"s{name} {name}_1 {name}_p {name}_x 0 {name}_m",
        f".model {name}_m sw vt={{{middle}}} vh={{{half}}} ron=1 roff=1e9",
        f"v{name}_1 {name}_1 0 1",
        f"r{name}_p {name}_p 0 1k",
    ]


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


def _source(text: str) -> str:
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
    if any("=" in word for word in found) or not least <= len(factors) <= _MOST:
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
