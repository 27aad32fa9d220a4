"""What spans several lines: models that are derived from others, switches and diodes of other
programs as behavioural sources, and initial currents."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from cosim.circuit.dialect.lines import COPY, Line, refuse, shown, unusable
from cosim.circuit.dialect.words import MODEL, VALUE, number, taken, word_set, words
from cosim.errors import BadInput

_Key = tuple[Any, ...]  # a scope, and a name in it, perhaps with the kind of element before it
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
_CURRENT = re.compile(rf"\bi\s*\(\s*(l[^\s()]*)\s*\)\s*=\s*{VALUE}[\s,]*", re.IGNORECASE)


def in_ngspice_together(lines: Sequence[Line]) -> list[Line]:
    """Translates what spans several lines: models derived from another (``ako:``), switches and
    diodes of other programs as B sources, and currents of inductors in ``.ic``. Where a model only
    approximates the original, a line ``.told`` says so to the user. Raises BadInput."""
    lines = [*lines]
    _complete(lines)
    known: dict[_Key, str] = {}
    elements = {(line.scope, line.text.split(None, 1)[0].lower()) for line in lines}
    for place, line in enumerate(lines):
        text = line.text.lower()
        if match := _SWITCHING.match(text):
            try:
                law, told = _law(line, match[2])
                key = line.scope, _DEVICES[match[2]], match[1]
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
                if (line.scope, name) not in elements:
                    refuse(line, f"there is no inductor {shown(name)} here")
                known[line.scope, name] = current
            lines[place] = replace(line, text=_CURRENT.sub("", line.text).strip())
    apart = chain.from_iterable(_apart(line, known) for line in lines)
    return [line for line in apart if line.text.lower() not in ("", ".ic")]


def _apart(line: Line, known: Mapping[_Key, str]) -> list[Line]:
    """The lines of an element: a switch or diode as a B source by its model's law, an inductor with
    the initial current that ``known`` has for it, any other as it is."""
    name, *rest = words(line.text) if line.text[:1].lower() in {*"swdl"} else [""]
    count = {"s": 4, "w": 3}.get(name[:1], 2)
    law = _nearest(known, line.scope, name[:1], rest[count]) if len(rest) > count else None
    texts, (plus, minus, *control) = [line.text], rest[:count] if law else ["", ""]
    if (line.scope, name) in known and len(rest) > 2:
        # At the operating point a source of 1 GV per ampere of error holds the current, later 0 V.
        error = f"1e9*(i(v{name}_ic)-({known[line.scope, name]}))"
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


def _complete(lines: list[Line]) -> None:
    """Write out each model derived by ``ako:`` with the parameters that it inherits."""
    own: dict[_Key, int] = {}  # places of models; -1 where a scope has two of the same name
    for place, line in enumerate(lines):
        if MODEL.match(line.text):
            key = line.scope, words(line.text)[1]
            own[key] = -1 if key in own else place

    def complete(place: int, seen: tuple[int, ...] = (-1,)) -> None:
        if (match := _AKO.match(lines[place].text)) is None:
            return
        base = _nearest(own, lines[place].scope, match[1].lower())
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


def _law(line: Line, kind: str) -> tuple[str, str]:
    """The parameters that ``cosim_switch`` or ``cosim_diode`` take for a model that ngspice lacks,
    and a remark for the user. Both are empty where ngspice has the model itself."""
    given = taken(line.text, _CARDS[kind])[1]
    first, second, ron, roff, *rrev = (_CARDS[kind] | given).values()
    odd = {key for key, value in taken(line.text, _ODD)[1].items() if number(value) != 0.0}
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
