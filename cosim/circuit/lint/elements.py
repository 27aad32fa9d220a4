"""A netlist's scopes and elements, as ngspice reads them from its lines.

Nothing is evaluated: what depends on a value stays undecided.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import NamedTuple, NoReturn

from cosim.circuit.dialect.lines import COPY, Line, refuse, shown
from cosim.circuit.dialect.words import definitions, split_assignments, words
from cosim.errors import BadInput

GROUND = "0"


class Kind(NamedTuple):
    """What ngspice 39 takes of the elements with one first letter."""

    nodes: int
    """Right after the name (of E and G without controlling ones), or before the model's name at
    least; X has any number."""
    most: int = 0
    """Of nodes, where their number is known by the place of the model's name only; else 0."""
    models: str = ""
    """Types of the models that it may have."""
    keys: str = ""
    """Keys of its assignments; empty where they are not checked, or by the subcircuit's own."""


_WARM = "m temp dtemp"

KINDS = {
    "b": Kind(2, keys="v i tc1 tc2 temp dtemp reciproctc reciprocm m"),
    "c": Kind(2, 0, "c", f"c q capacitance ic scale w l tc tc1 tc2 {_WARM}"),
    "d": Kind(2, 3, "d", f"area pj w l ic off perim lm wm lp wp thermal {_WARM}"),
    "e": Kind(2, keys="value vol gain tc1 tc2 temp dtemp name"),
    "f": Kind(2, keys="value gain m"),
    "g": Kind(2, keys="value cur gain m tc1 tc2 temp dtemp name"),
    "h": Kind(2, keys="value gain"),
    "i": Kind(2, keys="dc ac m td"),
    "j": Kind(3, 4, "njf pjf", f"area ic off {_WARM}"),
    "k": Kind(0),
    "l": Kind(2, 0, "l", f"l flux inductance ic nt scale tc tc1 tc2 {_WARM}"),
    "m": Kind(3, 7, "nmos pmos vdmos", f"l w ad as pd ps nrd nrs ic off thermal {_WARM}"),
    "o": Kind(4, 0, "ltra", "ic"),
    "q": Kind(3, 5, "npn pnp", f"area areab areac ic off thermal {_WARM}"),
    "r": Kind(2, 0, "r res", f"r resistance ac scale w l tc tc1 tc2 tce noisy noise {_WARM}"),
    "s": Kind(4, 0, "sw"),
    "t": Kind(4, keys="z0 zo td f nl ic"),
    "v": Kind(2, keys="dc ac r td portnum z0 pwr freq phase"),
    "w": Kind(2, 0, "csw"),
    "x": Kind(0),
    "z": Kind(3, 3, "nmf pmf", f"area ic off {_WARM}"),
}
"""The elements that a netlist may have, by first letter. Not A (code models start processes and
read files), N (compiled Verilog-A), U (translated to code models), P and Y (lossy lines, of no use
here)."""

_SPECIAL = {"poly", "table", "laplace", "freq", "value", "vol", "cur", "and", "nand", "or", "nor",
            "vcvs", "vccs"}  # fmt: skip
"""First words of controlled sources that have no controlling nodes."""

_NESTING = re.compile(r"\.(?:subckt|ends|if|else|elseif|endif)\b", re.IGNORECASE)
_FLAG = re.compile("=|^(?:off|thermal)$")
"""What a word behind the model has. ngspice 39 crashes on a bare number there, or drops it."""


@dataclass
class Element:
    """An element; ``words`` follow the nodes, and may begin with controlling nodes or a model."""

    name: str
    nodes: list[str]
    words: list[str]
    line: Line
    conditional: bool
    model: str | None = None
    controls: list[str] = field(default_factory=list)
    """Nodes whose voltage controls the element; no current flows into them."""

    @property
    def kind(self) -> str:
        return self.name[0]

    def refuse(self, reason: str) -> NoReturn:
        """Raise the sentence in which ``reason`` follows the element's name."""
        refuse(self.line, f"{shown(self.name)}{reason}")


@dataclass
class Scope:
    """The top level, or a subcircuit."""

    name: str
    line: Line
    parent: "Scope | None" = None
    conditional: bool = False
    pins: list[str] = field(default_factory=list)
    parameters: set[str] = field(default_factory=set)
    functions: set[str] = field(default_factory=set)
    models: dict[str, set[str]] = field(default_factory=dict)
    model_lines: dict[str, Line] = field(default_factory=dict)
    bad_models: dict[str, BadInput] = field(default_factory=dict)
    """By name: what is wrong with models that cannot be used."""
    broken: BadInput | None = None
    """What is wrong with a line of it; libraries hold subcircuits that nobody needs."""
    names: set[str] = field(default_factory=set)
    elements: list[Element] = field(default_factory=list)
    subcircuits: dict[str, list["Scope"]] = field(default_factory=dict)
    lines: list[tuple[Line, Element | None]] = field(default_factory=list)
    globals: set[str] = field(default_factory=set)
    order: list[tuple[Line, Element | None, "Scope"]] = field(default_factory=list)
    """At the top level: all lines in the file's order, each with its element and its scope."""
    used: bool = False
    free: set[str] = field(default_factory=set)
    """Parameters of a subcircuit that its calls set and its body uses, but no line declares."""

    def chain(self) -> "Iterator[Scope]":
        scope: Scope | None = self
        while scope is not None:
            yield scope
            scope = scope.parent

    def model_types(self, name: str) -> set[str] | None:
        """The types of the model that ``name`` means here, None if there is none."""
        return next((s.models[name] for s in self.chain() if name in s.models), None)

    def refuse_model(self, element: Element, name: str) -> NoReturn:
        """Raise the sentence on a model that ``model_types`` has not found."""
        for scope in self.chain():
            if name in scope.bad_models:
                raise scope.bad_models[name]
        element.refuse(f": no model {shown(name)} is defined here{COPY}")

    def subcircuit(self, name: str) -> "list[Scope] | None":
        return next((s.subcircuits[name] for s in self.chain() if name in s.subcircuits), None)

    def in_use(self) -> "Iterator[Scope]":
        """The scope and the called subcircuits within; ngspice drops the others unread."""
        if self.used:
            yield self
        for alternatives in self.subcircuits.values():
            for scope in alternatives:
                yield from scope.in_use()


def node(name: str) -> str:
    return GROUND if name in ("0", "gnd") else name


def parse(lines: Sequence[Line]) -> Scope:
    """The netlist's scopes. Raises BadInput where lines are incomplete or do not nest."""
    try:
        return _Parser(lines).ended()
    except _Unnested:  # perhaps by a library's subcircuit that nobody needs
        pass
    try:
        return _Parser(lines, flat=True).ended()
    except _Unnested as error:
        raise BadInput(str(error)) from None


class _Unnested(BadInput):
    """Subcircuits do not nest."""


class _Parser:
    """With ``flat`` a subcircuit that has no .ends ends where the next one begins or its file ends,
    and a library's .ends without .subckt is dropped."""

    def __init__(self, lines: Sequence[Line], flat: bool = False) -> None:
        self.top = self.scope = Scope("", lines[0])
        self.flat = flat
        self.ifs: list[Line] = []
        self.outer_ifs: list[int] = []
        for line in lines[1:]:
            if flat:
                self._leave(line)
            try:
                if line.bad:
                    refuse(line, line.bad)
                _check_brackets(line)
                self._take(line)
            except BadInput as error:
                word, *name = words(line.text)[:2]
                if word == ".model" and name:
                    self.scope.bad_models[name[0]] = error
                elif self.scope is self.top or _NESTING.match(line.text):
                    raise
                else:
                    self.scope.broken = self.scope.broken or error
        if flat:
            self._leave(lines[0])

    def _leave(self, line: Line) -> None:
        """Leave a subcircuit without .ends before a line that begins another one or a file."""
        new = line.file != self.scope.line.file or line.text.lower().startswith(".subckt")
        if new and self.scope.parent is not None:
            self.scope.broken = self.scope.broken or self._open()
            del self.ifs[self.outer_ifs.pop() :]
            self.scope = self.scope.parent

    def _open(self) -> "_Unnested":
        """The error of a subcircuit that is not ended."""
        line, name = self.scope.line, shown(self.scope.name)
        return _Unnested(f"{line.place}: .subckt {name} has no .ends.")

    def ended(self) -> Scope:
        """The top level, its nodes placed. Raises BadInput where something is not closed."""
        if self.scope is not self.top:
            raise self._open()
        if self.ifs:
            refuse(self.ifs[-1], ".if has no .endif")
        self._place_nodes()
        return self.top

    def _take(self, line: Line) -> None:
        found = words(line.text)
        of_library = self.flat and line.file != self.top.line.file
        if of_library and found[0] == ".ends" and self.scope is self.top:
            return  # ngspice would end the run at it
        handlers: dict[str, Callable[[Line, list[str]], None]] = {
            ".subckt": self._subckt,
            ".ends": self._ends,
            **dict.fromkeys((".if", ".elseif", ".else", ".endif"), self._conditional),
            ".param": self._param,
            ".model": self._model,
            ".global": lambda line, found: self.top.globals.update(found[1:]),
        }
        element, holder = None, self.scope
        if not line.text.startswith("."):
            element = Element(found[0], [], found[1:], line, bool(self.ifs))
            holder.elements.append(element)
            holder.names.add(element.name)
        elif handler := handlers.get(re.findall(r"\.\w*", line.text)[0].lower()):
            handler(line, found)
            if self.scope.parent is holder:  # a .subckt line belongs to the scope that it opens
                holder = self.scope
        holder.lines.append((line, element))
        self.top.order.append((line, element, holder))

    def _subckt(self, line: Line, found: list[str]) -> None:
        positional, assigned = split_assignments(found[1:])
        if not positional:
            refuse(line, ".subckt has no name")
        name, *pins = positional
        scope = Scope(name, line, self.scope, bool(self.ifs), [node(pin) for pin in pins])
        scope.parameters = {word.partition("=")[0] for word in assigned}
        self.scope.subcircuits.setdefault(name, []).append(scope)
        self.outer_ifs.append(len(self.ifs))
        self.scope = scope

    def _ends(self, line: Line, found: list[str]) -> None:
        if self.scope.parent is None:
            raise _Unnested(f"{line.place}: .ends has no .subckt.")
        if len(self.ifs) != self.outer_ifs.pop():
            refuse(line, ".if and .endif must stand in the same subcircuit")
        self.scope = self.scope.parent

    def _conditional(self, line: Line, found: list[str]) -> None:
        word = found[0].partition("{")[0].partition("'")[0]
        if word == ".if":
            if not line.text.split("if", 1)[-1].strip(" ()"):
                refuse(line, ".if has no condition")
            self.ifs.append(line)
        elif len(self.ifs) <= (self.outer_ifs[-1] if self.outer_ifs else 0):
            refuse(line, f"{shown(word)} has no .if")
        elif word == ".endif":
            self.ifs.pop()

    def _param(self, line: Line, found: list[str]) -> None:
        given = definitions(line)
        if not given or not all(each.body for each in given):
            refuse(line, ".param gives no name a value; write NAME=VALUE")
        for each in given:
            (self.scope.parameters if each.formals is None else self.scope.functions).add(each.name)

    def _model(self, line: Line, found: list[str]) -> None:
        if len(found) < 3:
            refuse(line, f"{shown(line.text)} is no complete .model line")
        self.scope.models.setdefault(found[1], set()).add(found[2])
        self.scope.model_lines[found[1]] = line

    def _place_nodes(self) -> None:
        """Split the elements of called subcircuits into nodes and words, and find ``free``."""
        calls: list[tuple[Element, set[str], Scope]] = []
        waiting = [self.top]
        while waiting:
            scope = waiting.pop()
            if scope.used:
                continue
            scope.used = True
            if scope.broken:
                raise scope.broken
            for element in scope.elements:
                _place(element, scope)
                if element.kind == "x":
                    given = {word.partition("=")[0] for word in element.words}
                    for called in scope.subcircuit(element.model or "") or ():
                        waiting.append(called)
                        calls.append((element, given, called))
        for _, given, called in calls:
            for key in given - called.parameters - called.free - {"m"}:
                name = re.compile(rf"(?<![\w.]){re.escape(key)}(?![\w.(])")
                if any(name.search(line.text.lower()) for line, _ in called.lines[1:]):
                    called.free.add(key)
        for element, given, called in calls:
            if lacking := called.free - given:
                element.refuse(f" gives {shown(called.name)} no {shown(min(lacking))}; write it")
            called.parameters |= called.free


def _check_brackets(line: Line) -> None:
    if line.text.count("'") % 2:
        refuse(line, "a quote is not closed, so the line may be cut short")
    for opening, shutting in ("{}", "()"):
        depths = [*accumulate((char == opening) - (char == shutting) for char in line.text)]
        if min(depths) < 0:
            refuse(line, f"{shutting} closes nothing")
        if depths[-1]:
            refuse(line, f"{opening} is not closed, so the line may be cut short")


def _place(element: Element, scope: Scope) -> None:
    """Split an element's words into nodes, model and the rest."""
    kind, (least, most, *_) = element.kind, KINDS[element.kind]
    if kind == "x":
        positional, assigned = split_assignments(element.words)
        if not positional:
            element.refuse(" names no subcircuit")
        *element.nodes, element.model = positional
        element.words = assigned
    elif most:
        places = range(least, min(most + 1, len(element.words)))
        if not places:
            element.refuse(" has too few nodes or no model")
        known = (i for i in places if scope.model_types(element.words[i]) is not None)
        place = next(known, None)
        if place is None:
            # Which word was to be the model is a guess, for the message alone.
            from_there = element.words[least + (kind == "m" and len(element.words) > 4) :]
            name = next((word for word in from_there if not word[0].isdigit()), from_there[0])
            scope.refuse_model(element, name)
        _split(element, place)
        element.model = element.words.pop(0)
        if kind == "m" and place < 4 and scope.model_types(element.model) != {"vdmos"}:
            element.refuse(" has too few nodes: drain, gate, source and bulk")
        if kind != "m" and element.words and not _FLAG.search(element.words[0]):
            element.words[0] = f"area={element.words[0]}"
        if word := next((word for word in element.words if not _FLAG.search(word)), None):
            element.refuse(f": {shown(word)} behind the model has no name; write name=value")
    else:
        _split(element, least)
    element.nodes = [node(name) for name in element.nodes]
    if kind == "s":
        element.controls, element.nodes = element.nodes[2:], element.nodes[:2]
    if kind in "eg":
        _place_controls(element)


def _split(element: Element, count: int) -> None:
    element.nodes, element.words = element.words[:count], element.words[count:]
    if len(element.nodes) < count or any("=" in name or "{" in name for name in element.nodes):
        element.refuse(" has too few nodes")


def _place_controls(element: Element) -> None:
    """Split off the controlling nodes of a linear voltage-controlled source."""
    first = element.words[0] if element.words else ""
    if not re.fullmatch(r"[^={}']+", first) or first in _SPECIAL:
        return
    found = element.words[:2]
    if len(element.words) <= 2 or any("=" in word for word in found):
        element.refuse(" has too few nodes or no value")
    element.controls = [node(name) for name in found]
    element.words = element.words[2:]
