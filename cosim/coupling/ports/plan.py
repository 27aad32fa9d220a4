"""A scene's ports, checked against its FMUs and brought into the numbers of ``ports.c``."""

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from cosim.circuit import netlist
from cosim.circuit.joined import Deck, deck, unit
from cosim.coupling.loop.structures import DRIVE, OUTPUT, PROBE, Feed, Origin, Source, Through
from cosim.coupling.ports.sides import Side
from cosim.coupling.ports.strangers import Variable, stranger
from cosim.errors import plain
from cosim.mechanics.package import unpacked
from cosim.mechanics.stickslip import parameters
from cosim.scene import Scene
from cosim.scene.tables import MACHINE, MACHINE_ENDS, Fmu, Port

_HELD, _DIFFERENCE, _KNOWN = range(3)  # slope of an output between communication points
_UNKNOWN = {"1", "?", ""}  # what a variable or an expression has that tells no unit
_FEEDS = {"mean": 0, "line": 1, "end": 2}

_Of = tuple[str, str]
"""Names of an FMU and of one of its variables."""


class Plan:
    """The connections of circuit and FMUs. Raises BadInput, naming file, key and value."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        # The machine, treated like any FMU, has no input for its coil's voltage.
        ports = [port for port in scene.port if port.to not in MACHINE_ENDS[3:]]
        ends = [port.origin or port.to or "" for port in ports]
        self._has_machine = any(end.startswith(f"{MACHINE}.") for end in ends)
        sides = _by_name(scene, self._has_machine)
        self.sides = _in_order(scene, sides)
        """FMUs in the order in which they step: each after those that feed it, where possible."""
        self.probes = tuple(dict.fromkeys(p.probe for p in ports if p.probe is not None))
        self.words = tuple(dict.fromkeys([*self.probes, *(scene.circuit.save or ())]))
        """Quantities that are read from the circuit, first those that lead to FMUs."""
        self.sources: list[Any] = []
        self.names: list[str] = []
        """Names of the sources that ports feed, as the scene spells them."""
        self._from: list[tuple[Side, Any]] = []
        self.told: list[tuple[Side, str, Any]] = []
        """Outputs whose slopes are known, and held against what they do: FMU, port's ``from``, and
        the port's origin."""
        self._fed: list[tuple[int, Side, Variable]] = []  # index of a source, and what feeds it
        self._read: list[tuple[Side, Variable]] = []  # outputs that ports lead on
        self._needs: dict[_Of, set[_Of]] = {}
        """Variables on which each variable depends without delay: by the FMUs' own declaration of
        feedthrough, and by ports from output to input."""
        for side in sides.values():
            for output, inputs in side.of.feedthrough.items():
                self._needs[side.name, output] = {(side.name, name) for name in inputs}
        self.notes: list[str] = []
        for port in ports:
            self._join(port, sides)
        # Each FMU's outputs are a part of one row. Reported slopes lengthen the parts, so the
        # places in the whole row are known only now.
        self.width = 0
        """Length of the row of all outputs."""
        for side in self.sides:
            side.first = self.width
            self.width += side.width
        for side, origin in self._from:
            origin.place += side.first
            origin.slope_place += side.first
        self.backs = {
            origin.place
            for side in self.sides
            for origin in side.origins()
            if origin.kind == OUTPUT and origin.place >= side.first
        }
        """Places of outputs that feed an FMU which steps before their own FMU."""
        needs = self._needs | self._seen()
        self._through = through = self._feedthrough(needs)
        self.circle = _circle(needs)
        """The variables of an algebraic loop of FMUs, in words, or ""."""
        self.method = _method(scene, self.sides, through, self.circle)
        self.notes += _notes(scene, self.sides, self.method, through, self.circle)
        self.throughs = [*self._throughs()] if self.method == "redo" else []
        """Feedthrough from a probe to a source, which the circuit solves itself, and its feed."""

    def late_notes(self) -> Iterator[str]:
        """Sentences on feedthrough that the start of a run did not show, and its end does, as that
        of a diode."""
        known = self.method == "redo" or self._through
        if not known and (through := self._feedthrough(self._needs | self._seen())):
            yield _late(through, self.method, _cure(self.sides))

    def deck(self) -> Deck:
        """The circuit's netlist."""
        circuit, run = self.scene.circuit, self.scene.run
        assert circuit.netlist is not None
        return deck(
            *(Path(circuit.netlist), self.names, self.words, circuit.param or {}),
            *(run.duration, circuit.reltol, circuit.max_step, self.method == "redo"),
            netlist.parameters(self.scene) if self._has_machine else {},
            through=[(self.names[t.source], self.words[t.probe]) for t, _ in self.throughs],
            saved={*(circuit.save or ())} - {*self.probes},
        )

    def outputs(self) -> Iterator[tuple[Side, str, int, bool]]:
        """Each output's FMU, name, place in the row of all, and whether a port reads it."""
        places = {origin.place for _, origin in self._from}
        for side in self.sides:
            for place, (name, *_) in enumerate(side.columns, side.first):
                yield side, name, place, place in places

    @property
    def driven(self) -> bool:
        """Whether a port reads the command of ``[drive]``."""
        return any(port.origin == "drive" for port in self.scene.port)

    def _seen(self) -> dict[_Of, set[_Of]]:
        """Feedthrough of outputs of which FMUs declare none, so that they may depend on all inputs:
        as it is seen at the start."""
        fed = dict.fromkeys((side, output) for side, output in self._read if output.real)
        return {
            (side.name, output.name): {(side.name, name) for name in side.answers(output)}
            for side, output in fed
            if output.name not in side.of.feedthrough
        }

    def _feedthrough(self, needs: dict[_Of, set[_Of]]) -> str:
        """An input from the circuit on which an output to the circuit depends without delay, also
        through other FMUs: in words, or ""."""
        probed = {(side.name, into.name) for side in self.sides for into, _ in side.probed()}
        for _, side, output in self._fed:
            for name, variable in sorted(_behind(needs, (side.name, output.name)) & probed):
                return f"{name}.{variable} to {side.name}.{output.name}"
        return ""

    def _throughs(self) -> Iterator[tuple[Any, Any]]:
        """All possible feedthrough from probes to sources; an output for which the FMU declares no
        dependencies may depend on all inputs."""
        needs = dict(self._needs)
        for side in self.sides:
            inputs = {(side.name, into.name) for into in side.inputs}
            for output in side.outputs:
                needs.setdefault((side.name, output.name), inputs)
        for at, last, output in self._fed:
            origin, behind = self.sources[at].origin, _behind(needs, (last.name, output.name))
            end = self.sides.index(last)
            for first, side in enumerate(self.sides[: end + 1]):
                for into, feed in side.probed():
                    if (side.name, into.name) in behind:
                        scale = origin.scale * feed.origin.scale
                        places = (at, feed.origin.place, first, end, origin.place)
                        yield Through(*places, scale=scale), feed

    def _join(self, port: Port, sides: dict[str, Side]) -> None:
        """Add a port: its origin (probe, drive or output), and what it feeds (source or input)."""
        origin, given, side, output = self._origin(port, sides)
        if port.source is not None:
            self.names.append(port.source)
            taken = "V" if port.source[0] in "vV" else "A"
            self.sources.append(Source(name=port.source.lower().encode(), origin=origin))
            if side is not None and output is not None and output.real:
                self._fed.append((len(self.sources) - 1, side, output))
            kept = self.sources[-1].origin  # a copy of ``origin``, which is adjusted later
        else:
            into, variable, place = _end(port, "to", str(port.to), sides, "input")
            taken = variable.unit
            feed = Feed(origin=origin, feed=_FEEDS[_way(port, into, variable)])
            into.feed(variable, place, feed)
            kept = feed.origin
            if side is not None and output is not None:
                needs = self._needs.setdefault((into.name, variable.name), set())
                needs.add((side.name, output.name))
        if port.scale == 1.0 and _alike(given) != _alike(taken) and not {given, taken} & _UNKNOWN:
            ends = f"{port.origin or port.probe} [{given}] to {port.source or port.to} [{taken}]"
            self.notes.append(f"a [[port]] leads {plain(ends)} without a scale.")
        if side is not None and output is not None:
            self._from.append((side, kept))
            self._read.append((side, output))
            if kept.slope == _KNOWN:
                self.told.append((side, str(port.origin), kept))

    def _origin(
        self, port: Port, sides: dict[str, Side]
    ) -> tuple[Any, str, Side | None, Variable | None]:
        """What a port reads, as ``ports.c`` takes it, its unit, and the FMU and output it is of."""
        origin = Origin(scale=port.scale, offset=port.offset)
        if port.probe is not None:
            origin.kind, origin.place = PROBE, self.words.index(port.probe)
            if self.scene.renamed and port.to == MACHINE_ENDS[2]:
                # Of all coils, as where the machine is none of the FMUs; its input is of one.
                origin.scale /= self.scene.coil.count
                origin.offset /= self.scene.coil.count
            return origin, unit(port.probe), None, None
        if port.origin == "drive":
            origin.kind = DRIVE
            return origin, "V", None, None
        side, output, place = _end(port, "from", str(port.origin), sides, "output")
        origin.kind, origin.place = OUTPUT, side.places[output.name] + place
        _set_slope(origin, port, side, output, place)
        return origin, output.unit, side, output


def _alike(unit: str) -> str:
    """A unit whose products are written in one of the ways that tools have for them."""
    return re.sub(r"[\s.*·]", "", unit)


def _by_name(scene: Scene, has_machine: bool) -> dict[str, Side]:
    """The scene's FMUs by their names; with them, if it ``has_machine``, the built-in machine like
    a foreign FMU, with the parameters of the scene's tables."""
    sides = {each.name: Side(each, stranger(each.file)) for each in scene.fmu}
    for side in sides.values():
        same = [other.name for other in sides.values() if other.of is side.of]
        if len(same) > 1 and side.of.abilities.canBeInstantiatedOnlyOncePerProcess:
            raise side.of.bad(
                f"[[fmu]] {', '.join(same)} cannot all be of it: it says of itself "
                "canBeInstantiatedOnlyOncePerProcess = true"
            )
    if has_machine:
        reals, wholes = parameters(scene)
        given = {**reals, **wholes, "normal_force": scene.friction.normal_force}
        machine = Fmu(name=MACHINE, file=str(unpacked(2)), parameters=given)
        sides[MACHINE] = Side(machine, stranger(machine.file))
    return sides


def _way(port: Port, into: Side, variable: Variable) -> str:
    """How an input is fed over a step: its "mean", a straight "line", or the value at its "end"."""
    able = into.of.version == 2 and into.of.abilities.canInterpolateInputs and variable.size == 1
    if not variable.real:
        return "end"  # integers and truth values have no mean
    if port.feed == "line" and not able:
        raise into.of.bad(
            f'[[port]] feed = "line" into {into.name}.{variable.name} needs an FMU of FMI '
            '2.0 with canInterpolateInputs; take "mean" or "end"'
        )
    if port.feed == "auto":
        return "line" if able else "mean"
    return port.feed


def _end(
    port: Port, key: str, name: str, sides: dict[str, Side], causality: str
) -> tuple[Side, Variable, int]:
    """The FMU and variable that a port's ``key`` names, and the place of an array's element."""
    of, _, variable = name.partition(".")
    found, place = sides[of].of.find(variable, causality, f'[[port]] {key} = "{name}"')
    return sides[of], found, place


def _set_slope(origin: Any, port: Port, side: Side, output: Variable, place: int) -> None:
    """Set how an output is extrapolated between communication points: held, by the difference of
    the last values, or by a known slope (reported by the FMU, or another output)."""
    kind, one = port.slope, output.size == 1
    if kind == "auto":
        tells = output.continuous and one and (side.of.abilities.maxOutputDerivativeOrder or 0) >= 1
        if tells:
            origin.slope, origin.slope_place = _KNOWN, side.slope_place(output)
        elif output.slope in side.places:
            origin.slope, origin.slope_place = _KNOWN, side.places[output.slope] + place
        else:
            origin.slope = _DIFFERENCE if output.continuous else _HELD
    elif kind in ("held", "difference"):
        origin.slope = _HELD if kind == "held" else _DIFFERENCE
    else:
        name = kind.removeprefix(f"{side.name}.")
        known, at = side.of.find(name, "output", f'[[port]] slope = "{kind}"')
        origin.slope, origin.slope_place = _KNOWN, side.places[known.name] + at


def _in_order(scene: Scene, sides: dict[str, Side]) -> list[Side]:
    """FMUs, each after those that feed it; a cycle is broken at its first FMU in the scene."""
    feeding: dict[str, set[str]] = {name: set() for name in sides}
    for port in scene.port:
        if port.origin not in (None, "drive") and port.to is not None:
            feeding[port.to.partition(".")[0]].add(str(port.origin).partition(".")[0])
    order: list[str] = []
    while len(order) < len(sides):
        rest = [name for name in sides if name not in order]
        free = [name for name in rest if not feeding[name] - {name} - {*order}]
        order.append((free or rest)[0])
    return [sides[name] for name in order]


def _fixed(side: Side) -> bool:
    """Whether an FMU needs steps of one length."""
    return not side.varies or bool(side.of.abilities.fixedInternalStepSize)


def _able(sides: list[Side]) -> bool:
    """Whether all FMUs can repeat steps, and take steps of any length."""
    return all(side.of.abilities.canGetAndSetFMUstate and not _fixed(side) for side in sides)


def _method(scene: Scene, sides: list[Side], through: str, circle: str) -> str:
    """``coupling.method``, with the choice of "auto" made."""
    asked = scene.coupling.method
    if asked == "auto" and any(map(_fixed, sides)):
        return "macro-steps"
    if asked == "redo" or (asked == "auto" and through):
        for side in sides:
            if not side.of.abilities.canGetAndSetFMUstate:
                why = f"{through} is fed through at once, so " if asked == "auto" else ""
                raise side.of.bad(
                    f'{why}coupling.method = "redo" repeats its steps, which needs '
                    'canGetAndSetFMUstate = true; take "step-locked" with small circuit.max_step'
                )
        return "redo"
    if asked == "auto":
        return "redo" if circle and _able(sides) else "step-locked"
    return asked


def _cure(sides: list[Side]) -> str:
    if _able(sides):
        return 'coupling.method = "redo" is as exact as one netlist'
    return f"{'FMUs with ' * any(map(_fixed, sides))}smaller steps err less"


def _late(through: str, method: str, cure: str) -> str:
    return (
        f"an FMU feeds {through} through at once, of which the circuit learns a step late with "
        f'coupling.method = "{method}"; {cure}.'
    )


def _notes(
    scene: Scene, sides: list[Side], method: str, through: str, circle: str
) -> Iterator[str]:
    """Sentences on the errors that the chosen method leaves."""
    cure = _cure(sides)
    if through and method != "redo":
        yield _late(through, method, cure)
    macro = scene.coupling.macro_step
    for side in sides:
        step = side.of.step if side.of.step > 0.0 else macro
        near = max(round(macro / step), 1) * step
        if method != "macro-steps" and not side.varies:
            told = f'coupling.method = "{method}" has others'
            yield f"{side.name} says that it takes steps of one length alone, and {told}."
        elif method == "macro-steps" and abs(near - macro) > 1e-6 * macro:
            told = f"coupling.macro_step = {macro:g} s is no whole multiple; {near:g} s is one"
            yield f"{side.name} says that its steps are of {step:g} s, of which {told}."
    if circle and method != "redo":
        yield (
            f"the FMUs feed each other at once ({circle}); this algebraic loop is not iterated "
            f'with coupling.method = "{method}": one of them is given a value extrapolated from '
            f"earlier steps; {cure}."
        )


def _circle(needs: dict[_Of, set[_Of]]) -> str:
    """The variables of an algebraic loop (mutual dependence without delay), or ""."""
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        return ", ".join(dict.fromkeys(map(".".join, error.args[1])))
    return ""


def _behind(needs: dict[_Of, set[_Of]], start: _Of) -> set[_Of]:
    """All variables on which ``start`` depends without delay, directly or not."""
    found: set[_Of] = set()
    rest = [start]
    while rest:
        new = needs.get(rest.pop(), set()) - found
        found |= new
        rest += new
    return found
