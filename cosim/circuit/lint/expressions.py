"""The names that a netlist's expressions use, and which of them are defined.

An undefined parameter does not only fail the run: ngspice gives up for the rest of the process.
"""

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from cosim.circuit.dialect.functions import FUNCTIONS
from cosim.circuit.dialect.lines import DEEPEST, Line, refuse, shown
from cosim.circuit.dialect.words import (
    TOKEN,
    Definition,
    arguments_of,
    closing,
    definitions,
    number,
    unbraced,
    word_set,
)
from cosim.circuit.lint.elements import Element, Scope

_RANDOM = {"agauss": 3, "gauss": 3, "aunif": 2, "unif": 2, "limit": 2}
_ONE_ARGUMENT = word_set(
    """abs acos acosh asin asinh atan atanh ceil cos cosh exp floor ln log log10 nint sgn sin sinh
    sqrt tan tanh"""
)
_COMMON = (
    dict.fromkeys(_ONE_ARGUMENT, 1)
    | dict.fromkeys(word_set("max min pow pwr"), 2)
    | {"ternary_fcn": 3, **_RANDOM}
)
PARAMETRIC = _COMMON | dict.fromkeys(word_set("arctan int sqr"), 1)
"""Functions of ngspice 39's parameters, which are numbers before a run, and how many arguments each
takes: with too many or too few ngspice calculates something else in silence."""
BEHAVIOURAL = _COMMON | dict.fromkeys(word_set("ddt eq0 ge0 gt0 le0 lt0 ne0 u u2 uramp"), 1)
"""Functions of ngspice's behavioural sources, except ``pwl``, which takes any number of points.
Random functions are replaced by a number when ngspice reads the netlist."""
MOST_CALLS = 10_000
"""That a call may expand to, at most ``DEEPEST`` deep; ngspice 39 takes 0.15 s."""
CONSTANTS = word_set("time temper hertz")
BEHAVIOURAL_CONSTANTS = word_set("pi e i s")
_TAKEN = (BEHAVIOURAL_CONSTANTS | frozenset(BEHAVIOURAL)) - {"pi"}

_LIMITER = "limit() is no limiter in ngspice; write max(low, min(high, x))"
_MEMORY = (
    "as idt(x), idt(x,start) or delay(x,constant) in a B, E or G source itself; write it there "
    "instead of in a .func"
)
_VARYING = re.compile(r"\b(?:[vi]\s*\(|(?:time|temper|hertz)\b)", re.IGNORECASE)
# A single number or name, perhaps signed, perhaps in braces.
_PLAIN = re.compile(r"\s*\{?\s*[+-]?\s*[\w.]+(?:(?<=\de)[+-]?\d+)?\s*\}?\s*", re.IGNORECASE)
# The same with parentheses around it; of braces nothing but blanks is left by ``unbraced``.
_POINT = re.compile(
    r"(?:[\s(+-]*(?:\{ *\}|[\d.]\w*(?:\.\w*)?(?:(?<=\de)[+-]\d+)?)|[\s(]*[a-z_]\w*)[\s)]*", re.I
)
# KEY=NAME, without a call.
_ASSIGNMENT = re.compile(r"([a-z_]\w*)=([a-z_]\w*)\b(?!\s*\()", re.IGNORECASE)
_DROPPABLE = re.compile(r"\.model ([^\s(]+)|\.param (\w+)\s*\(")
_CALLED = re.compile(r"(\w+)\s*\(")
_BROKEN = re.compile(r"(?:^|[bjp])(?:[ej]|$)|[oe][ob]|u")
"""In the first letters of the groups of TOKEN: a missing operand or operator, or what is none."""
_BODY = re.compile(r"\b[vi]\s*=(?!=)\s*", re.IGNORECASE)
_NEXT_KEY = re.compile(r"(?<=\s)[a-z_]\w*\s*(?<![<>=!])=(?!=)", re.IGNORECASE)
_SOURCE = re.compile(r"\b(?:value|vol|cur)\s*=?\s*$", re.IGNORECASE)


class Names:
    """The parameters and functions that each scope may use, by the scope's ``id``: its own, those
    of enclosing scopes, and, as ngspice looks them up too, those of a subcircuit's callers."""

    def __init__(self, top: Scope) -> None:
        self.parameters: dict[int, set[str]] = {}
        self.functions: dict[int, set[str]] = {}
        scopes = list(top.in_use())
        for scope in scopes:
            chain = list(scope.chain())
            self.parameters[id(scope)] = set().union(*(s.parameters for s in chain))
            self.functions[id(scope)] = set().union(*(s.functions for s in chain))
        lines = [line.text.lower() for s in scopes for line, _ in s.lines]
        self.definitions: dict[str, list[Definition]] = {}
        """The user's functions by name, whatever their scope."""
        for each in (each for s in scopes for line, _ in s.lines for each in definitions(line)):
            if each.formals is not None:
                self.definitions.setdefault(each.name, []).append(each)
        self.checked: set[tuple[str, bool | None]] = set()
        """Names of functions whose bodies have been checked, with ``behavioural``."""
        self.calls: dict[str, int] = {}
        """By a function's name: how many calls ngspice makes of one when it expands it."""
        self.mentioned = {word for s in scopes for e in s.elements for word in [e.model, *e.words]}
        calls = (
            text.partition(")")[2] if text.startswith(".param") and _DROPPABLE.match(text) else text
            for text in lines
        )
        self.called = {name for text in calls for name in _CALLED.findall(text)}
        growing = True
        while growing:
            growing = sum(self._inherit(scope) for scope in scopes) > 0

    def only(self, name: str) -> Definition | None:
        """The function of this name, if there is exactly one."""
        found = self.definitions.get(name, [])
        return found[0] if len(found) == 1 else None

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
        if model:
            return model not in self.mentioned
        return function not in self.called and len(definitions(line)) == 1

    def is_parameter(self, scope: Scope, name: str) -> bool:
        return name in self.parameters[id(scope)] or name in CONSTANTS

    def check_own(
        self, line: Line, name: str, arguments: list[str], behavioural: bool | None, depth: int = 0
    ) -> None:
        """Check a call of the netlist's own function, and, the first time, the calls in its body.
        ``behavioural`` names the parser: of B sources, of parameters, or None for either."""
        function = self.only(name)
        if function is None:  # several have this name
            return
        count = len(function.formals or ())
        if len(arguments) != count:
            wanted = _counted(count)
            refuse(line, f"the function {shown(name)} takes {wanted}, not {len(arguments)}")
        if (name, behavioural) in self.checked:
            return
        self.checked.add((name, behavioural))
        if depth > DEEPEST:
            refuse(line, f"the function {shown(name)} is called more than {DEEPEST} deep")
        calls = [(inner, given) for inner, given in used(function.body) if given is not None]
        for inner, given in calls:
            if inner in self.definitions:
                self.check_own(function.line, inner, given, behavioural, depth + 1)
            elif reason := _misused(inner, given, behavioural):
                added = name in FUNCTIONS and function.line.number == 1  # by the dialect
                where = f"the function {name} works only in B sources" if added else reason
                refuse(line if added else function.line, where)
        # The functions that it calls are counted by now, but for itself, if it is recursive.
        self.calls[name] = 1 + sum(self.calls.get(inner, 0) for inner, _ in calls)
        if self.calls[name] > MOST_CALLS:
            within = [inner for inner in dict(calls) if self.calls.get(inner, 0) > 1]
            refuse(
                function.line,
                f"the function {shown(name)} makes {self.calls[name]} calls, by way of "
                f"{', '.join(map(shown, within[:3]))}; ngspice can write out {MOST_CALLS}",
            )


def check_names(scope: Scope, names: Names) -> None:
    """Raise BadInput where an expression of the scope's lines uses an undefined name."""
    parameters = names.parameters[id(scope)] | CONSTANTS
    own = names.functions[id(scope)]
    for line, element in scope.lines:
        if names.drops(line):
            continue
        formals = [each.formals for each in definitions(line) if each.formals is not None]
        known = parameters.union(*formals)
        for expression, in_source in _expressions(line, element):
            loose = in_source or (element is not None and element.kind in "beg")
            # A function's definition does not tell which parser will evaluate it.
            behavioural = in_source or (None if formals else False)
            for name, arguments in used(expression):
                if arguments is None:
                    if name not in known and not (loose and name in BEHAVIOURAL_CONSTANTS):
                        refuse(line, f"the parameter {shown(name)} is not defined")
                elif name in own:
                    names.check_own(line, name, arguments, behavioural)
                elif reason := _misused(name, arguments, behavioural):
                    refuse(line, reason)
            if in_source:
                in_b = element is not None and element.kind == "b"  # where {e} is the .param
                _check_words(line, unbraced(expression) if in_b else expression, parameters)
            _check_operators(line, expression)


def _check_words(line: Line, expression: str, parameters: set[str]) -> None:
    """Refuse what ngspice takes for something else, or cannot read, in a behavioural source."""
    if "%" in expression:
        refuse(line, "% is not known in B sources; for x%y write x-y*floor(x/y)")
    for name, arguments in used(expression):
        if arguments is None and name in parameters & _TAKEN:
            refuse(line, f"ngspice takes {name} for its own here; give the .param another name")


def _check_operators(line: Line, expression: str) -> None:
    """Refuse commas outside calls, ? without :, and what lacks an operand or an operator."""
    tokens = [token for token in TOKEN.finditer(expression) if token.lastgroup]
    what = shown(expression.strip())
    broken = f"{what} is no expression that ngspice can read"
    calls = [False]  # whether the brackets around the token are a call's, the innermost last
    for token in tokens:
        if token["begin"]:
            calls.append(token["call"] is not None)
        elif token["end"] and calls[1:]:
            calls.pop()
        elif token[0] == "," and not calls[-1]:
            refuse(line, f"{broken}: its comma parts no arguments; numbers have decimal points")
    texts = [token[0] for token in tokens]
    if texts.count("?") != texts.count(":"):
        refuse(line, f"{what} must have a : for each ?, as in (condition ? yes : no)")
    if tokens and _BROKEN.search("".join(str(token.lastgroup)[0] for token in tokens)):
        refuse(line, broken)


def _misused(name: str, arguments: list[str], behavioural: bool | None) -> str | None:
    """What is wrong with calling one of ngspice's functions like this, if anything; None for
    ``behavioural`` stands for either parser."""
    if behavioural is None:
        reasons = [_misused(name, arguments, parser) for parser in (False, True)]
        return reasons[name not in PARAMETRIC] if all(reasons) else None
    known, other = (BEHAVIOURAL, PARAMETRIC) if behavioural else (PARAMETRIC, BEHAVIOURAL)
    count = len(arguments)
    if name in ("pwl", "table") and behavioural:
        if count >= 5 and count % 2:
            given = arguments[1:]
            if not all(_POINT.fullmatch(unbraced(each)) and not _varies(each) for each in given):
                return f"the points of {name}() must be plain numbers, or expressions in braces"
            points = [number(argument.strip()) for argument in arguments[1::2]]
            for last, x in pairwise(points):
                if last is not None and x is not None and last >= x:
                    return f"the x values of {name}() must rise, {x:g} comes after {last:g}"
            return None
        return f"{name}() takes a value and at least two points, each of two numbers"
    if name == "limit" and count != 2:
        return _LIMITER
    if name not in known:
        if name in FUNCTIONS:
            wanted = len(FUNCTIONS[name][0].split(","))
            return f"the function {name} takes {_counted(wanted)}, not {count}"
        if name in other or name in ("pwl", "table"):
            where = "where all is known before the run" if behavioural else "in B sources"
            return f"the function {name} works only {where}"
        if name in ("idt", "sdt", "delay"):
            return f"{name}() is read {_MEMORY}"
        return f"the function {shown(name)} is not defined"
    if count != known[name]:
        return f"the function {name} takes {_counted(known[name])}, not {count}"
    plain = all(_PLAIN.fullmatch(argument) and not _varies(argument) for argument in arguments)
    if name in _RANDOM and behavioural and not plain:
        plainly = f"in a B source {name}() takes plain numbers only; write it in a .param line"
        return _LIMITER if name == "limit" else plainly
    return None


def _counted(count: int) -> str:
    return f"{count} argument{'' if count == 1 else 's'}"


def check_circles(top: Scope, names: Names) -> None:
    """Raise BadInput where functions or top-level parameters depend on themselves."""
    single = {name: only for name in names.definitions if (only := names.only(name))}
    calls = {
        name: {inner for inner, arguments in used(function.body) if arguments is not None}
        for name, function in single.items()
    }
    try:
        TopologicalSorter(calls).prepare()
    except CycleError as error:
        name = error.args[1][0]
        refuse(single[name].line, f"the function {shown(name)} calls itself; ngspice has no end")
    uses: dict[str, set[str]] = {}
    lines: dict[str, Line] = {}
    if any(line.text.lower().startswith(".if") for line, _ in top.lines):
        return
    for line, _ in top.lines:
        for name, formals, expression, _ in definitions(line):
            if formals is None and name not in uses:
                uses[name] = {n for n, arguments in used(expression) if arguments is None}
                lines[name] = line
    try:
        TopologicalSorter(uses).prepare()
    except CycleError as error:
        name = next(name for name in error.args[1] if name in lines)
        refuse(lines[name], f"the parameter {shown(name)} depends on itself")


def used(expression: str) -> Iterator[tuple[str, list[str] | None]]:
    """The names in an expression except nodes and sources: with their arguments if called, else
    with None."""
    text = expression.lower()
    for token in TOKEN.finditer(text):
        if name := token["call"]:
            yield name, arguments_of(text, token.end() - 1)[0]
        elif token["name"]:
            yield token[0], None


def sensed(text: str, kind: str) -> Iterator[str]:
    """The nodes (``kind`` v) or sources (i) that expressions in a line's text read."""
    for match in re.finditer(rf"(?<![\w.]){kind}\s*\(([^()]*)\)", text.lower()):
        yield from (name for name in re.split(r"[\s,]+", match[1]) if name)


def body(line: Line) -> str:
    """The expression of a B source."""
    match = _BODY.search(line.text)
    return line.text[match.end() :] if match else ""


def _expressions(line: Line, element: Element | None) -> Iterator[tuple[str, bool]]:
    """The expressions of a line, and whether ngspice's parser of behavioural sources evaluates
    each: outside B sources it does where the expression varies during a run."""
    text = line.text
    word = text.split()[0].lower()
    if word == ".param":
        for each in definitions(line):
            yield each.body, _varies(each.body)
        return
    if word.startswith((".if", ".elseif")):
        condition = text[text.lower().index("if") + 2 :]
        yield condition, _varies(condition)
        return
    end = 0
    if element is not None and element.kind == "b":
        # Braces make no difference there, up to the next key; "=" behind the first name compares.
        start = len(text) - len(body(line))
        key = _NEXT_KEY.search(unbraced(text), start + 1)
        end = key.start() if key else len(text)
        yield text[start:end], True
    place = end
    while place < len(text):
        if text[place] in "{'":
            after = closing(text, place)
            inside = text[place + 1 : after - 1]
            source = element is not None and _SOURCE.search(text[:place]) is not None
            yield inside, source or _varies(inside)
            place = after
        else:
            place += 1
    if element is None and word not in (".model", ".subckt"):
        return
    if element is None or element.kind != "b":
        for _, name in _ASSIGNMENT.findall(re.sub(r"\s*=\s*", "=", unbraced(text))):
            yield name, _varies(name)


def _varies(expression: str) -> bool:
    return _VARYING.search(expression) is not None
