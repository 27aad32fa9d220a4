"""Circuits that have no operating point: floating nodes and loops of ideal voltages.

Subcircuits are expanded. An element of uncertain effect is taken to make the circuit solvable.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from cosim.circuit.dialect.lines import Line, refuse, shown
from cosim.circuit.lint.elements import GROUND, Element, Scope
from cosim.circuit.lint.expressions import body, sensed

MAX_ELEMENTS = 200_000
MAX_DEPTH = 50

_VOLTAGE = "vehl"
"""Elements that are ideal voltages at the operating point, inductors included."""
_LEAF = "rcd"
"""Elements that have no effect with one end free."""
_SHUNT = re.compile(r"\.opt\w*\s.*\brshunt\s*=", re.IGNORECASE)
"""An option that puts a resistor from every node to ground."""


@dataclass(frozen=True)
class Part:
    """An element of the expanded circuit."""

    element: Element
    nodes: tuple[str, ...]
    senses: tuple[str, ...]
    path: str
    """The names of the calls that lead to it, with a point behind each; "" at the top level."""


class _Groups:
    """Disjoint sets of nodes (union-find)."""

    def __init__(self) -> None:
        self.parents: dict[str, str] = {}

    def find(self, name: str) -> str:
        parents = self.parents
        while (parent := parents.setdefault(name, name)) != name:
            parents[name] = parents[parent]
            name = parent
        return name

    def join(self, one: str, other: str) -> bool:
        """Join the sets of two nodes; whether they were different sets."""
        one, other = self.find(one), self.find(other)
        self.parents[one] = other
        return one != other


def check_topology(top: Scope) -> None:
    """Raise BadInput for a circuit that has no operating point, whatever its values."""
    circuit = Expansion(top)
    parts = list(circuit.parts(top, {}))
    held = _held(top)
    terminals = Counter(name for part in parts for name in part.nodes)
    if GROUND not in terminals:
        refuse(top.line, "the netlist has no ground (node 0)")
    _check_ends(parts, terminals, held | circuit.joints)
    if not any(_SHUNT.match(line.text) for line, _ in top.lines):
        _check_paths(parts, held)
    _check_loops(parts)


@dataclass
class Expansion:
    """Expands subcircuits, and collects their pins."""

    top: Scope
    elements: int = 0
    joints: set[str] = field(default_factory=set)
    """Nodes that are pins of subcircuits."""

    def parts(
        self, scope: Scope, pins: dict[str, str], path: str = "", depth: int = 0
    ) -> Iterator[Part]:
        def outer(name: str) -> str:
            if name == GROUND or name in self.top.globals:
                return name
            return pins.get(name) or path + name

        for element in scope.elements:
            self.elements += 1
            if self.elements > MAX_ELEMENTS:
                refuse(element.line, f"the subcircuits expand to more than {MAX_ELEMENTS} elements")
            nodes = tuple(outer(name) for name in element.nodes)
            called = scope.subcircuit(element.model or "") if element.kind == "x" else None
            if called is not None and len(called) == 1:
                if depth >= MAX_DEPTH:
                    name = shown(element.model or "")
                    refuse(element.line, f"{name} is called {MAX_DEPTH} deep, perhaps by itself")
                self.joints.update(nodes)
                inner = dict(zip(called[0].pins, nodes, strict=True))
                yield from self.parts(called[0], inner, f"{path}{element.name}.", depth + 1)
            else:
                read = [*element.controls, *sensed(element.line.text, "v")]
                senses = tuple(outer(GROUND if name == "gnd" else name) for name in read)
                yield Part(element, nodes, senses, path)


def _held(top: Scope) -> set[str]:
    """Nodes with an initial condition, which holds them at the operating point."""
    directives = (".ic", ".nodeset")
    lines = [line.text for line, _ in top.lines if line.text.lower().startswith(directives)]
    return {name for text in lines for name in sensed(text, "v")}


def _check_ends(parts: list[Part], terminals: Counter[str], held: set[str]) -> None:
    seen = Counter(name for part in parts for name in part.senses)
    for part in parts:
        line = part.element.line
        for name in part.senses:
            if name != GROUND and name not in terminals and not re.search(r"[.:]", name):
                refuse(line, f"nothing is connected to the node {shown(name)}")
        for name in part.nodes:
            leaf = not part.path and part.element.kind in _LEAF
            excused = (
                name in seen or name in held or name == GROUND or name.startswith(("nc", "n/c"))
            )
            if leaf and terminals[name] == 1 and not excused:
                refuse(line, f"the node {shown(name)} has no other connection")


def _check_paths(parts: list[Part], held: set[str]) -> None:
    groups = _Groups()
    # Nodes taken as safe: held ones, and those of controlled currents, which feedback may hold.
    loose = set(held)
    first: dict[str, Line] = {}
    for part in parts:
        element = part.element
        for name in part.nodes:
            first.setdefault(name, element.line)
        for one, other in _paths(part):
            groups.join(one, other)
        if element.kind in "gf" or (element.kind == "b" and not _gives_voltage(element)):
            loose.update(part.nodes)
    safe = {groups.find(name) for name in (GROUND, *loose)}
    for name, line in first.items():
        if groups.find(name) not in safe:
            refuse(line, f"the node {shown(name)} has no path for direct current to ground")


def _paths(part: Part) -> Iterator[tuple[str, str]]:
    """Pairs of nodes between which direct current can flow."""
    kind, nodes = part.element.kind, part.nodes
    if kind in "cigfk" or (kind == "b" and not _gives_voltage(part.element)):
        return
    if kind == "m":
        # The gate is insulated.
        nodes = (nodes[0], *nodes[2:])
    yield from pairwise(nodes)


def _gives_voltage(element: Element) -> bool:
    text = element.line.text
    return text[: len(text) - len(body(element.line))].rstrip("= \t")[-1:].lower() == "v"


def _check_loops(parts: list[Part]) -> None:
    # A voltage source whose current is read may be part of a solvable loop.
    read = {name for part in parts for name in sensed(part.element.line.text, "i")}
    read.update(name for part in parts if part.element.kind in "fhw" for name in part.element.words)
    groups = _Groups()
    for part in parts:
        element = part.element
        voltage = element.kind in _VOLTAGE or (element.kind == "b" and _gives_voltage(element))
        if not voltage or element.conditional or element.kind == "h" or len(part.nodes) != 2:
            continue
        if "portnum" in element.words or (element.kind != "l" and element.name in read):
            continue
        if not groups.join(*part.nodes):
            element.refuse(" closes a loop of voltage sources and inductors without resistance")
