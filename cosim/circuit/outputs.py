"""A netlist's output lines: ``.meas`` is computed, all others have no effect.

A measurement is computed from recorded vectors. Each operand is a number, or a vector or expression
that ngspice records over time; even a constant limit in braces.
"""

import ast
import math
import operator
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.dialect.lines import Line, refuse, shown
from cosim.circuit.dialect.words import NUMBER, number, word_set

_SAVING = word_set(".save .probe .probe64 .plot .print .wave")
_ANALYSES = word_set(".op .ac .dc .tf .noise .disto .pz .sens .sp .four .fourier .csparam")
_REDUCED = word_set("avg rms min max pp integ")
_AT = word_set("find deriv")
_MEAS = re.compile(r"\.meas\w*\s+(?:(tran|ac|dc|op|tf|noise|sp)\s+)?(\w+)\s+(\w+)\b(.*)", re.DOTALL)
_CLAUSE = re.compile(r"(?<![^\s,)}'])(from|to|at|val|td|cross|rise|fall|when|trig|targ)\b\s*=?\s*")
_BRACKETS = re.compile(r"\([^()]*\)|\{[^{}]*\}")  # innermost ones
_LONGEST = 2_000  # characters of a .meas line
_FORMS = (
    "it may be AVG, RMS, MIN, MAX, PP or INTEG of an expression with FROM= and TO=, FIND or "
    "DERIV with AT= or WHEN, WHEN, TRIG and TARG, of expression=value, TD=, CROSS=, RISE=, FALL=, "
    "PARAM of .meas"
)
_CALLS = {name: getattr(math, name) for name in word_set("sqrt exp log log10 pow sin cos")}
_CALLS |= {"abs": abs, "min": min, "max": max, "ln": math.log}
_OPERATIONS: dict[type[ast.AST], Any] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: math.pow, ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip
_PIECE = re.compile(rf"{NUMBER.pattern}|[a-z_]\w*|[-+*/^(), ]", re.IGNORECASE)


@dataclass(frozen=True)
class Event:
    """A time ``at`` (s), or the ``which``-th crossing, 0 being the last, of ``left`` and ``right``
    after a ``delay`` (s)."""

    at: str = ""
    left: str = ""
    right: str = ""
    delay: str = "0"
    edge: str = "cross"
    which: int = 1


@dataclass(frozen=True)
class Measure:
    """A ``.meas`` line: operation ``what`` on expression ``of``, between two events or at one."""

    line: Line
    name: str
    what: str
    of: str
    events: tuple[Event, ...]
    others: tuple[str, ...] = ()  # measurements that it may be computed from

    @property
    def words(self) -> list[str]:
        """The vectors and expressions that it needs."""
        if self.what == "param":
            names = dict.fromkeys(re.findall(r"(?<![\w.])[a-z_]\w*", self.of))
            return [name for name in names if name not in self.others and name not in _CALLS]
        needed = [word for e in self.events for word in (e.at, e.left, e.right, e.delay)]
        return [word for word in (self.of, *needed) if word and number(word) is None]


def without_effect(dropped: Sequence[Line]) -> Iterator[str]:
    """A sentence for each line that was left out and might be missed."""
    for line in dropped:
        text = line.text.lower()
        word, match = text.split()[0], _MEAS.match(text)
        without = re.search(r"\b(uic|startup|skipbp)\b", text) if word == ".tran" else None
        if word == ".told":
            yield f"{line.place}: {line.text[6:]}."
        elif word in _SAVING:
            yield f"{line.place}: {word} has no effect; circuit.save keeps vectors."
        elif word == ".step":
            takes = "the values of .param, else the first ones"
            takes = takes if " param " in text else "the netlist's own values; make one a .param"
            several = "cosim sweep --over circuit.param.NAME=START:STOP:COUNT takes several"
            yield f"{line.place}: .step has no effect: a run takes {takes}; {several}."
        elif word in _ANALYSES or without or (match and match[1] not in (None, "tran")):
            what = f"{word} {without[0]}" if without else word
            cure = ", in which .ic v(NODE)=... sets voltages" if without else ""
            yield (
                f"{line.place}: {what} has no effect: a run is a transient analysis "
                f"that begins at the operating point{cure}."
            )


def measures(dropped: Sequence[Line]) -> list[Measure]:
    """The measurements of the transient analysis. Raises BadInput for a .meas line that is none."""
    found: dict[str, Measure] = {}
    for line in dropped:
        match = _MEAS.match(line.text.lower()) if len(line.text) < _LONGEST else None
        if match is None and line.text.lower().startswith(".meas"):
            refuse(line, f"{shown(line.text)} is no complete .meas; {_FORMS}")
        if match is not None and match[1] in (None, "tran"):
            if match[2] in found:
                refuse(line, f"there is a second .meas {shown(match[2])}")
            found[match[2]] = _measure(line, match[2], match[3], match[4])
    return [replace(each, others=tuple(found)) for each in found.values()]


def _measure(line: Line, name: str, what: str, rest: str) -> Measure:
    if what == "param":
        return Measure(line, name, what, _computed(line, _plain(rest.strip(" ="))), ())
    (_, of), *clauses = _clauses(f"{what}{rest}" if what in ("when", "trig") else rest)
    keys = [key for key, _ in clauses]
    given, events = dict(clauses), [Event()]
    if what in _REDUCED and of and not {*keys} - {"from", "to"}:
        events = [Event(given.get("from", "0")), Event(given.get("to", "1e99"))]
    elif what in _AT and of and keys == ["at"]:
        events = [Event(given["at"])]
    elif keys[:1] == ["when"] and (what == "when" or (what in _AT and of)):
        events = [_event(clauses)]
    elif what == "trig" and "targ" in keys:
        place = keys.index("targ")
        events = [_event(clauses[:place]), _event(clauses[place:])]
    if not all(event.at or (event.left and event.right) for event in events):
        refuse(line, f".meas {shown(name)} is nothing known here; {_FORMS}")
    return Measure(line, name, what, of, tuple(events))


def _computed(line: Line, text: str) -> str:
    """An expression of numbers, names and operators, in Python's syntax. Raises BadInput."""
    pieces = [match[0] for match in _PIECE.finditer(text)]
    plain = [repr(number(each)) if each[0] in ".0123456789" else each for each in pieces]
    found = "".join(plain).replace("^", "**")
    with suppress(SyntaxError, TypeError, RecursionError, MemoryError):
        if "".join(pieces) == text:
            with suppress(ArithmeticError, ValueError):  # these depend on the values of the names
                _value_of(ast.parse(found, mode="eval").body, defaultdict(lambda: math.nan))
            return found
    refuse(line, f"{shown(text)} is no expression of numbers and names")


def _value_of(node: ast.AST, names: Mapping[str, float]) -> float:
    """The value of an expression of the nodes listed here. Raises TypeError for any other node, and
    ArithmeticError, ValueError or KeyError for values and names."""
    match node:
        case ast.Constant(value=float(value)):
            return value
        case ast.Name(id=name) if name not in _CALLS:
            return names[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATIONS:
            return _OPERATIONS[type(op)](_value_of(operand, names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
            return _OPERATIONS[type(op)](_value_of(left, names), _value_of(right, names))
        case ast.Call(func=ast.Name(id=name), args=[*given], keywords=[]) if name in _CALLS:
            return _CALLS[name](*(_value_of(each, names) for each in given))
    raise TypeError


def _clauses(text: str) -> list[tuple[str, str]]:
    """Pairs of a keyword and the text after it; the first, with "", has the text before them. Text
    in brackets is masked, so that no keyword is found in it."""
    outside, before = text, ""
    while outside != before:
        before, outside = outside, _BRACKETS.sub(lambda match: "_" * len(match[0]), outside)
    starts = [*_CLAUSE.finditer(outside)]
    ends = [*(match.start() for match in starts), len(text)]
    keys = ["", *(match[1] for match in starts)]
    places = [0, *(match.end() for match in starts)]
    return [
        (key, _plain(text[place:end].strip(" ,")))
        for key, place, end in zip(keys, places, ends, strict=True)
    ]


def _plain(text: str) -> str:
    """An expression without ``par('…')``, quotes or braces around it."""
    match = re.fullmatch(r"(?:par\s*\(\s*)?(?:'([^']*)'|\{([^{}]*)\})(?:\s*\))?", text)
    return f"({match[1] or match[2]})" if match else text


def _event(clauses: Sequence[tuple[str, str]]) -> Event:
    """The event of the clauses from WHEN, TRIG or TARG on; an empty one if they are no such."""
    (_, what), *rest = clauses
    given = dict(rest)
    if "at" in given and not what:
        return Event(given["at"])
    left, _, right = what.partition("=")
    edges = [key for key in given if key in ("cross", "rise", "fall")] or ["cross"]
    which = given.get(edges[0], "1")
    if len(edges) > 1 or not re.fullmatch(r"last|[1-9]\d{0,8}", which):
        return Event()
    right, delay = given.get("val", right).strip(), given.get("td", "0")
    return Event("", left.strip(), right, delay, edges[0], 0 if which == "last" else int(which))


def measured(
    every: Sequence[Measure], time: Array, known: Mapping[str, Array]
) -> tuple[dict[str, float], list[str]]:
    """The values of the measurements by their names in a summary, and a sentence for each without
    one. ``known`` are the values of their words at the times (s)."""
    values, notes = {}, []
    for each in sorted(every, key=lambda each: each.what == "param"):
        others = {key.removeprefix("meas."): np.full(1, value) for key, value in values.items()}
        value = _value(each, time, {**known, **others} if each.what == "param" else known)
        if value is not None:
            values[f"meas.{each.name}"] = value
        else:
            why = "its event or interval is not in the run"
            why = "what it needs has none" if each.what == "param" else why
            notes.append(f"{each.line.place}: .meas {each.name} has no value: {why}.")
    return values, notes


def _value(each: Measure, time: Array, known: Mapping[str, Array]) -> float | None:
    """The measurement's value, SI; None where an event does not happen."""
    if each.what == "param":
        try:
            names = {word: float(values[0]) for word, values in known.items()}
            return _value_of(ast.parse(each.of, mode="eval").body, names)
        except (ArithmeticError, KeyError, ValueError):
            return None

    def at(words: str, place: float) -> float:
        return float(np.interp(place, time, values(words)))

    def values(words: str) -> Array:
        return known[words] if words in known else np.full(len(time), number(words))

    def when(event: Event) -> float | None:
        if event.at:
            return at(event.at, 0.0)
        off = values(event.left) - values(event.right)
        return _crossing(time, off, at(event.delay, 0.0), event)

    times = [found for event in each.events if (found := when(event)) is not None]
    if len(times) < len(each.events) or (each.what in _AT and times[0] > time[-1]):
        return None
    if each.what in _REDUCED:
        first, last = max(times[0], float(time[0])), min(times[1], float(time[-1]))
        t = np.concatenate([[first], time[(time > first) & (time < last)], [last]])
        return _reduced(each.what, t, np.interp(t, time, values(each.of))) if first < last else None
    if each.what == "find":
        return at(each.of, times[0])
    if each.what == "deriv":
        return float(np.interp(times[0], time, np.gradient(values(each.of), time)))
    return times[-1] - times[0] if each.what == "trig" else times[0]


def _reduced(what: str, t: Array, y: Array) -> float:
    """A reduction of the straight lines between the points, exact for their integral and square."""
    h, a, b, length = np.diff(t), y[:-1], y[1:], t[-1] - t[0]
    whole, squares = (h * (a + b)).sum() / 2.0, (h * (a * a + a * b + b * b)).sum() / 3.0
    found = {"avg": whole / length, "integ": whole, "rms": np.sqrt(squares / length)}
    found |= {"min": y.min(), "max": y.max(), "pp": np.ptp(y)}
    return float(found[what])


def _crossing(time: Array, off: Array, delay: float, event: Event) -> float | None:
    """The time at which ``off`` crosses 0 as the event has it, after the delay (s), or None."""
    rise, fall = (off[:-1] < 0) & (off[1:] >= 0), (off[:-1] > 0) & (off[1:] <= 0)
    k = np.flatnonzero({"rise": rise, "fall": fall, "cross": rise | fall}[event.edge])
    places = time[k] + (time[k + 1] - time[k]) * off[k] / (off[k] - off[k + 1])
    places = places[places >= delay]
    return float(places[event.which - 1]) if len(places) >= max(event.which, 1) else None
