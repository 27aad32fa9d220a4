"""What a netlist asks for besides its circuit: ``.meas`` is computed, the rest has no effect.

A measurement is computed on what ngspice recorded. All that it compares or averages is a vector or
an expression of ngspice's, so a limit in braces is one too, constant in time.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array
from cosim.circuit.lint.lines import Line, refuse, shown
from cosim.circuit.lint.words import number, word_set

_TOLD = {
    ".save": "circuit.save names what a run keeps",
    **dict.fromkeys((".probe", ".plot", ".print"), "circuit.save names what a run keeps"),
    **dict.fromkeys((".four", ".fourier"), "cosim export gives the waveforms to a program for it"),
    **dict.fromkeys(
        (".op", ".ac", ".dc", ".tf", ".noise", ".disto", ".pz", ".sens", ".sp"),
        "a run is a transient analysis",
    ),
    ".csparam": "only ngspice's own scripts read it",
}
_REDUCED = word_set("avg rms min max pp integ")
_MEAS = re.compile(
    r"\.meas(?:ure)?\s+(?:(tran|ac|dc|op|tf|noise|sp)\s+)?(\w+)\s+(\w+)\s*(.*)", re.S
)
_CLAUSE = re.compile(r"\b(from|to|at|val|td|cross|rise|fall|when|trig|targ)\b\s*=?\s*")
_FORMS = (
    "AVG, RMS, MIN, MAX, PP or INTEG of an expression with FROM= and TO=, FIND with AT= or WHEN, "
    "WHEN, or TRIG and TARG"
)


@dataclass(frozen=True)
class Event:
    """A time: given, or when an expression crosses another."""

    at: str = ""
    left: str = ""
    right: str = ""
    delay: str = "0"
    edge: str = "cross"
    number: int = 1
    """Which one; 0 is the last."""


@dataclass(frozen=True)
class Measure:
    """A ``.meas`` line: ``what`` is done with ``of``, between two times or at one."""

    line: Line
    name: str
    what: str
    of: str
    first: Event
    last: Event

    @property
    def words(self) -> list[str]:
        """The vectors and expressions that it needs."""
        needed = [self.of]
        for event in (self.first, self.last):
            needed += [event.at, event.left, event.right, event.delay]
        return [each for each in needed if each and number(each) is None]


def told(dropped: Sequence[Line]) -> Iterator[str]:
    """A sentence for each line that was left out and might be missed."""
    for line in dropped:
        word = line.text.split()[0].lower()
        reason = _TOLD.get(word)
        if match := _MEAS.match(line.text.lower()):
            reason = "a run is a transient analysis" if match[1] not in (None, "tran") else None
        elif word == ".tran" and (kind := re.search(r"\b(uic|startup)\b", line.text.lower())):
            word, reason = f".tran's {kind[1]}", "a run begins at the operating point, with .ic"
        if reason:
            yield f"{line.file}:{line.number}: {word} has no effect: {reason}."


def measures(dropped: Sequence[Line]) -> list[Measure]:
    """The measurements of the transient analysis. Raises BadInput for what is none."""
    found: dict[str, Measure] = {}
    for line in dropped:
        text = line.text.lower()
        if not text.startswith(".meas"):
            continue
        match = _MEAS.match(text)
        if match is None:
            refuse(line, f"{shown(line.text)} is no complete .meas; it may be {_FORMS}")
        if match[1] in (None, "tran"):
            if match[2] in found:
                refuse(line, f"there is a second .meas {shown(match[2])}")
            found[match[2]] = _measure(line, match[2], match[3], match[4])
    return list(found.values())


def _measure(line: Line, name: str, what: str, rest: str) -> Measure:
    clauses = _clauses(f"{what} {rest}" if what in ("when", "trig") else rest)
    of = clauses[0][1]
    given = dict(clauses[1:])
    start, end = Event(at=given.get("from", "0")), Event(at=given.get("to", "1e99"))
    if what in _REDUCED and of and not {*given} - {"from", "to"}:
        return Measure(line, name, what, of, start, end)
    if what == "find" and of and [*given] == ["at"]:
        return Measure(line, name, "find", of, Event(at=given["at"]), end)
    if what in ("find", "when") and "when" in given and bool(of) == (what == "find"):
        return Measure(line, name, what, of, _event(line, clauses[1:]), end)
    places = [k for k, (key, _) in enumerate(clauses) if key in ("trig", "targ")]
    if what == "trig" and len(places) == 2 and clauses[places[1]][0] == "targ":
        parts = clauses[places[0] : places[1]], clauses[places[1] :]
        return Measure(line, name, "trig", "", *(_event(line, part) for part in parts))
    refuse(line, f".meas {shown(name)} is nothing known here; it may be {_FORMS}")


def _clauses(text: str) -> list[tuple[str, str]]:
    """What stands before the first keyword, then each keyword with what follows it."""
    depth = 0
    found: list[tuple[str, str]] = []
    key, begin, place = "", 0, 0
    while place < len(text):
        match = _CLAUSE.match(text, place) if depth == 0 else None
        if match and (place == 0 or text[place - 1] in " ,)}'"):
            found.append((key, text[begin:place].strip(" ,")))
            key, begin, place = match[1], match.end(), match.end()
            continue
        depth += (text[place] in "({") - (text[place] in ")}")
        place += 1
    return [(key, _plain(value)) for key, value in [*found, (key, text[begin:].strip(" ,"))]]


def _plain(text: str) -> str:
    """An expression without ``par('…')``, quotes or braces around it."""
    match = re.fullmatch(r"(?:par\s*\(\s*)?(?:'([^']*)'|\{([^{}]*)\})(?:\s*\))?", text)
    return f"({match[1] or match[2]})" if match else text


def _event(line: Line, clauses: Sequence[tuple[str, str]]) -> Event:
    (_, what), *rest = clauses
    given = dict(rest)
    edges = [key for key in ("cross", "rise", "fall") if key in given]
    if "at" in given and not what:
        return Event(at=given["at"])
    left, _, right = what.partition("=")
    right = given.get("val", right).strip()
    count = given[edges[0]] if edges else "1"
    if not left or not right or len(edges) > 1 or not re.fullmatch(r"last|[1-9]\d{0,8}", count):
        refuse(line, "an event of .meas is expression=value with CROSS=, RISE= or FALL= and a "
                     "number or LAST")  # fmt: skip
    edge = edges[0] if edges else "cross"
    which = 0 if count == "last" else int(count)
    return Event("", left.strip(), right, given.get("td", "0"), edge, which)


def measured(each: Measure, time: Array, known: dict[str, Array]) -> float | None:
    """The measurement's value, SI; None where an event does not happen. ``known`` are the values of
    its words at the times (s)."""

    def at(words: str, place: float) -> float:
        value = number(words)
        return value if value is not None else float(np.interp(place, time, known[words]))

    def when(event: Event) -> float | None:
        if event.at:
            return at(event.at, 0.0)
        left, right = (known.get(words, number(words)) for words in (event.left, event.right))
        off = np.zeros(len(time)) + left - right
        return _crossing(time, off, at(event.delay, 0.0), event)

    first, last = when(each.first), when(each.last)
    if first is None or last is None:
        return None
    if each.what == "trig":
        return last - first
    if each.what == "when":
        return first
    if each.what == "find":
        return at(each.of, first)
    first, last = max(first, float(time[0])), min(last, float(time[-1]))
    if not first < last:
        return None
    inside = time[(time > first) & (time < last)]
    t = np.concatenate([[first], inside, [last]])
    return _reduced(each.what, t, np.interp(t, time, known.get(each.of, number(each.of))))


def _reduced(what: str, t: Array, y: Array) -> float:
    """Of straight lines between the points."""
    h, a, b = np.diff(t), y[:-1], y[1:]
    whole = float((h * (a + b)).sum() / 2.0)
    length = float(t[-1] - t[0])
    return {
        "avg": whole / length,
        "integ": whole,
        "rms": float(np.sqrt((h * (a * a + a * b + b * b)).sum() / 3.0 / length)),
        "min": float(y.min()),
        "max": float(y.max()),
        "pp": float(y.max() - y.min()),
    }[what]


def _crossing(time: Array, off: Array, delay: float, event: Event) -> float | None:
    """When ``off`` goes through 0 the right way for the right time, after the delay (s)."""
    rise, fall = (off[:-1] < 0) & (off[1:] >= 0), (off[:-1] > 0) & (off[1:] <= 0)
    found = {"rise": rise, "fall": fall, "cross": rise | fall}[event.edge]
    k = np.flatnonzero(found)
    places = time[k] + (time[k + 1] - time[k]) * off[k] / (off[k] - off[k + 1])
    places = places[places >= delay]
    if len(places) < max(event.number, 1):
        return None
    return float(places[event.number - 1])
