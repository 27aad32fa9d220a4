"""The names that a netlist's expressions use, and which of them are defined.

An undefined parameter does not only fail the run: ngspice gives up for the rest of the process.
"""

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter

from cosim.circuit.deck import Line, refuse, shown, word_set
from cosim.circuit.elements import Element, Scope
from cosim.circuit.words import closing, definitions

FUNCTIONS = word_set(
    """abs acos acosh agauss arctan asin asinh atan atan2 atanh aunif cbrt ceil cos cosh cot ddt db
    defined div eq0 exp fabs floor fmod gauss ge0 gt0 hypot idt if int le0 limit ln log log10 lt0
    max min mod ne0 nint not pow pwl pwr pwrs sdt sgn sign sin sinh sqr sqrt stp table tan tanh
    ternary_fcn u u2 unif uramp var"""
)
"""Of ngspice's parameters and behavioural sources, of any version."""
CONSTANTS = word_set("time temper hertz and or not div mod")
BEHAVIOURAL_CONSTANTS = word_set("pi e i s")

_TOKEN = re.compile(
    r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?[a-z]*|@[\w.#]+\[\w+\]|[a-z_][\w.$#]*|.", re.S
)
_ASSIGNMENT = re.compile(r"([a-z_]\w*)=([a-z_]\w*)", re.IGNORECASE)
_DROPPABLE = re.compile(r"\.model ([^\s(]+)|\.func (\w+)")
_CALLED = re.compile(r"(\w+)\s*\(")
_KEY = re.compile(r"\s*=(?!=)")
_CALL = re.compile(r"\s*\(")
_BODY = re.compile(r"\b[vi]\s*=(?!=)", re.IGNORECASE)


class Names:
    """What may be used where: ngspice also looks up the parameters of a subcircuit's callers."""

    def __init__(self, top: Scope) -> None:
        self.parameters: dict[int, set[str]] = {}
        self.functions: dict[int, set[str]] = {}
        scopes = list(top.in_use())
        for scope in scopes:
            chain = list(scope.chain())
            self.parameters[id(scope)] = set().union(*(s.parameters for s in chain))
            self.functions[id(scope)] = set().union(*(s.functions for s in chain))
        lines = [line.text.lower() for s in scopes for line, _ in s.lines]
        self.mentioned = {word for s in scopes for e in s.elements for word in [e.model, *e.words]}
        self.called = {
            name
            for text in lines
            for name in _CALLED.findall(
                text.partition(")")[2] if text.startswith(".func") else text
            )
        }
        growing = True
        while growing:
            growing = sum(self._inherit(scope) for scope in scopes) > 0

    def _inherit(self, caller: Scope) -> bool:
        grew = False
        for element in caller.elements:
            for called in caller.subcircuit(element.model or "") or ():
                for table in (self.parameters, self.functions):
                    before = len(table[id(called)])
                    table[id(called)] |= table[id(caller)]
                    grew = grew or len(table[id(called)]) > before
        return grew

    def drops(self, line: Line) -> bool:
        """Whether ngspice drops the line unread: a model or function that nothing mentions."""
        match = _DROPPABLE.match(line.text.lower())
        if match is None:
            return False
        model, function = match.groups()
        return function not in self.called if function else model not in self.mentioned

    def is_parameter(self, scope: Scope, name: str) -> bool:
        return name in self.parameters[id(scope)] or name in CONSTANTS


def check_names(scope: Scope, names: Names) -> None:
    """Raise BadInput where an expression of the scope's lines uses an undefined name."""
    parameters = names.parameters[id(scope)] | CONSTANTS
    functions = FUNCTIONS | names.functions[id(scope)]
    for line, element in scope.lines:
        if names.drops(line):
            continue
        formal = _formal(line)
        known = parameters | formal if formal else parameters
        for expression in _expressions(line, element):
            sensing = re.search(r"\b[vi]\s*\(", expression, re.IGNORECASE) is not None
            loose = sensing or (element is not None and element.kind in "beg")
            for name, called in used(expression):
                if called and name not in functions:
                    refuse(line, f"the function {shown(name)} is not defined")
                if not called and name not in known:
                    if loose and name in BEHAVIOURAL_CONSTANTS:
                        continue
                    refuse(line, f"the parameter {shown(name)} is not defined")


def check_circles(top: Scope) -> None:
    """Raise BadInput where top-level parameters depend on themselves."""
    uses: dict[str, set[str]] = {}
    lines: dict[str, Line] = {}
    if any(line.text.lower().startswith(".if") for line, _ in top.lines):
        return
    for line, _ in top.lines:
        if line.text.lower().startswith(".param"):
            for (name, formal), expression in definitions(line.text):
                if formal is None and name not in uses:
                    uses[name] = {n for n, called in used(expression) if not called}
                    lines[name] = line
    try:
        TopologicalSorter(uses).prepare()
    except CycleError as error:
        name = next(name for name in error.args[1] if name in lines)
        refuse(lines[name], f"the parameter {shown(name)} depends on itself")


def used(expression: str) -> Iterator[tuple[str, bool]]:
    """The names in an expression and whether each is called; nodes and sources are left out."""
    text = expression.lower()
    place = 0
    while match := _TOKEN.match(text, place):
        token, place = match[0], match.end()
        if not (token[0].isalpha() or token[0] == "_"):
            continue
        if _KEY.match(text, place):
            continue
        called = _CALL.match(text, place) is not None
        if called and token in ("v", "i"):
            place = closing(text, text.index("(", place))
            continue
        yield token, called


def sensed(text: str, kind: str) -> Iterator[str]:
    """The nodes (``kind`` v) or sources (i) that expressions in a line's text read."""
    for match in re.finditer(rf"(?<![\w.]){kind}\s*\(([^()]*)\)", text.lower()):
        yield from (name for name in re.split(r"[\s,]+", match[1]) if name)


def body(line: Line) -> str:
    """The expression of a B source."""
    match = _BODY.search(line.text)
    return line.text[match.end() :] if match else ""


def _expressions(line: Line, element: Element | None) -> Iterator[str]:
    text = line.text
    word = text.split()[0].lower()
    if word == ".param":
        for _, expression in definitions(text):
            yield expression
        return
    if word.startswith((".if", ".elseif")):
        yield text[text.lower().index("if") + 2 :]
        return
    place = 0
    while place < len(text):
        if text[place] in "{'":
            end = closing(text, place)
            yield text[place + 1 : end - 1]
            place = end
        else:
            place += 1
    if element is not None and element.kind == "b":
        yield body(line)
    elif element is not None or word in (".model", ".subckt"):
        for _, name in _ASSIGNMENT.findall(re.sub(r"\s*=\s*", "=", _unbraced(text))):
            yield name


def _unbraced(text: str) -> str:
    return re.sub(r"\{[^{}]*\}|'[^']*'", "{}", text)


def _formal(line: Line) -> set[str]:
    """The formal parameters of functions that a line defines."""
    lower = line.text.lower()
    if lower.startswith(".func"):
        match = re.search(r"\(([^()]*)\)", lower)
        return set(re.findall(r"\w+", match[1])) if match else set()
    if lower.startswith(".param"):
        formals = (formal for (_, formal), _ in definitions(lower) if formal)
        return {name for formal in formals for name in re.findall(r"\w+", formal)}
    return set()
