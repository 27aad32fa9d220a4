"""One FMU of a scene during a run: its instance, and its variables as ``ports.c`` takes them."""

import ctypes
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from ctypes import c_double, c_uint32, c_void_p
from functools import cached_property
from itertools import accumulate, product
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.coupling.loop.structures import PROBE, Feed, Fmu, Group, StrangerState, loop
from cosim.coupling.ports.strangers import FUNCTIONS, Stranger, Variable
from cosim.mechanics.fmi import Interface
from cosim.scene import tables
from cosim.toolchain.serving import used

_ERROR = 3
"""Status of a call, in both FMI versions, from which on the instance must not be used."""

_NUDGE = 1e-6
"""Of an input, or of 1 if that is more."""


class Side:
    """An FMU with buffers for its inputs; its outputs are a part of the one row of all outputs."""

    def __init__(self, about: tables.Fmu, of: Stranger) -> None:
        self.name, self.of = about.name, of
        self.outputs = _grouped([v for v in of.variables.values() if v.causality == "output"])
        """Outputs that are numbers, in the order of the row."""
        self.columns = [
            (f"{self.name}.{v.name}" + (f"[{k}]" if v.size > 1 else ""), v.unit, v.continuous)
            for v in self.outputs
            for k in range(v.size)
        ]
        if len(dict(each[:2] for each in self.columns)) < len(self.columns):
            raise of.bad("two of its outputs have one name")
        """Name, unit, and whether it is continuous, of each number of the row."""
        self.slopes: list[Variable] = []
        """Outputs whose derivative the FMU reports; these derivatives follow in the row."""
        self.places = _places(self.outputs)
        """Place of each output in this FMU's part of the row."""
        self.first = 0
        """Place of that part in the row of all outputs; the plan sets it."""
        self.inputs: list[Variable] = []
        self._feeds: list[tuple[Variable, int, Any]] = []
        self._kept: list[Any] = []
        self._values: Any = ()
        self._parameters = about.parameters
        self.fmu = Fmu()
        self.saved: int | None = None
        """The address of its saved state, to be freed."""

    @property
    def varies(self) -> bool:
        """Whether its steps may differ in length."""
        return bool(self.of.abilities.canHandleVariableCommunicationStepSize)

    @property
    def width(self) -> int:
        return len(self.columns) + len(self.slopes)

    def slope_place(self, output: Variable) -> int:
        """The place in the row of an output's derivative, which the FMU reports."""
        if output not in self.slopes:
            self.slopes.append(output)
        return len(self.columns) + self.slopes.index(output)

    def feed(self, into: Variable, place: int, feed: Any) -> None:
        """Connect ``feed`` to an input, or to the element ``place`` of it."""
        for other in self.inputs:
            if into is not other and into.one == other.one:
                raise self.of.bad(f"{into.name} and {other.name} are one input, and have two ports")
        if into not in self.inputs:
            self.inputs.append(into)
        self._feeds.append((into, place, feed))

    def origins(self) -> Iterator[Any]:
        """The origins of all feeds of this FMU."""
        for *_, feed in self._feeds:
            yield feed.origin

    def probed(self) -> Iterator[tuple[Variable, Any]]:
        """The feeds from the circuit into real inputs."""
        for into, _, feed in self._feeds:
            if into.real and feed.origin.kind == PROBE:
                yield into, feed

    @cached_property
    def instance(self) -> Interface:
        """The instance, ready to run."""
        made = self.of.instance(self._parameters, self.name)
        used.append(self._close)
        return made

    def answers(self, output: Variable) -> set[str]:
        """The inputs with ports to which an output answers at once, seen by a nudge of each: before
        a run from the start values, after it from the last ones."""
        raw = self.instance.raw

        def get() -> Array:
            size = () if self.of.version == 2 else (output.size,)
            return np.array(getattr(raw, f"get{output.type}")([output.reference], *size))

        def put(into: Variable, values: Array) -> None:
            getattr(raw, f"set{into.type}")([into.reference], values.tolist())

        found: set[str] = set()
        reals = [each for each in self.inputs if each.real]
        with suppress(Exception):  # what fails here fails again in the run, which tells it
            before = get()
            # Both ways, as max(0, -u) does not answer to more of u; each on those that were moved
            # before it, as a product of inputs at zero answers to none alone.
            for way, into in product((1.0, 0.0, -1.0, 0.0), reals):
                start = np.array(self._now(into))  # an FMU may not let an input be read
                put(into, start + way * _NUDGE * np.maximum(np.abs(start), 1.0))
                if not np.array_equal(now := get(), before, equal_nan=True):
                    found.add(into.name)
                before = now
        return found

    def _now(self, into: Variable) -> list[float]:
        """The values of an input: in a run those that were set last."""
        if not self._values:
            return self._start(into)
        place = _places(_grouped(self.inputs))[into.name]
        return [*self._values[place : place + into.size]]

    def _start(self, into: Variable) -> list[float]:
        """The start values of an input."""
        names = [into.name if into.size == 1 else f"{into.name}[{k}]" for k in range(into.size)]
        pairs = zip(names, into.start, strict=True)
        return [float(self._parameters.get(name, value)) for name, value in pairs]

    def state(self, row: int, repeats: bool) -> Any:
        """The instance as ``ports.c`` takes it; its part of the row is at the address ``row``. With
        ``repeats`` it can save and restore its state."""
        names = {"set_reals": "SetReal", "get_reals": "GetReal", "do_step": "DoStep"}
        if self.of.version == 3:
            names |= {"set_reals": "SetFloat64", "get_reals": "GetFloat64"}
        calls = {key: self.of.address(name) for key, name in names.items()}
        self.fmu = Fmu(instance=self.instance.raw.component, goes_back=int(repeats), **calls)
        loop().fmu_bind(ctypes.byref(self.fmu), self.of.version)
        inputs = _grouped(self.inputs)
        starts = [value for each in inputs for value in self._start(each)]
        self._values = (c_double * max(len(starts), 1))(*starts)
        at, first = _places(inputs), ctypes.addressof(self._values)
        lines = [each for each in self._feeds if each[2].feed == 1]
        rates = self._keep((c_double * max(len(lines), 1))())
        for into, place, feed in self._feeds:
            feed.input = first + 8 * (at[into.name] + place)
        for k, (_, _, feed) in enumerate(lines):
            feed.slope = ctypes.addressof(rates) + 8 * k
        feeds = self._keep((Feed * max(len(self._feeds), 1))(*(f for _, _, f in self._feeds)))
        sets, gets = (
            self._groups("Set", inputs, first),
            self._groups("Get", self.outputs, row),
        )
        state = StrangerState(
            fmu=ctypes.addressof(self.fmu),
            **{"inputs": ctypes.addressof(sets), "n_inputs": sets.used},
            **{"outputs": ctypes.addressof(gets), "n_outputs": gets.used},
            **{"feeds": ctypes.addressof(feeds), "n_feeds": len(self._feeds)},
            **{"row": row, "width": self.width},
        )
        if lines:
            state.set_slopes = self.of.address("SetRealInputDerivatives")
            state.input_slopes = self._references([into for into, _, _ in lines])
            state.n_input_slopes, state.input_rates = len(lines), ctypes.addressof(rates)
        if self.slopes:
            name = "GetRealOutputDerivatives" if self.of.version == 2 else "GetOutputDerivatives"
            state.get_slopes = self.of.address(name)
            state.output_slopes = self._references(self.slopes)
            state.n_output_slopes = len(self.slopes)
            state.output_rates = row + 8 * len(self.columns)
        if repeats:
            word = "FMUstate" if self.of.version == 2 else "FMUState"
            state.save, state.restore = (self.of.address(f"{do}{word}") for do in ("Get", "Set"))
        return state

    def _keep(self, array: Any) -> Any:
        """Keep an array alive of which the structures hold only the address."""
        self._kept.append(array)
        return array

    def _references(self, variables: Sequence[Variable]) -> int:
        """The address of an array with the variables' value references."""
        numbers = self._keep((c_uint32 * len(variables))(*(v.reference for v in variables)))
        return ctypes.addressof(numbers)

    def _groups(self, do: str, variables: Sequence[Variable], values: int) -> Any:
        """An array with a group for each type, set or read by one call each; the values of all
        groups lie one after another from the address ``values`` on."""
        groups: list[Any] = []
        types: dict[str, list[Variable]] = defaultdict(list)
        for each in variables:
            types[each.type].append(each)
        for kind, members in types.items():
            size = sum(each.size for each in members)
            raw = self._keep((c_double * size)())  # large enough: no type has more bytes
            groups.append(
                Group(
                    call=self.of.address(do + FUNCTIONS[self.of.version].get(kind, kind)),
                    places=self._references(members),
                    **{"n": len(members), "size": size, "kind": members[0].kind},
                    **{"values": values, "raw": ctypes.addressof(raw)},
                )
            )
            values += 8 * size
        array = self._keep((Group * max(len(groups), 1))(*groups))
        array.used = len(groups)
        return array

    def _close(self) -> None:
        """Free the instance and its saved state. After an error FMI allows no further calls, so the
        instance is then left as it is."""
        if self.fmu.status < _ERROR:
            with suppress(Exception):
                if self.saved:
                    self.instance.free_state(c_void_p(self.saved))
                self.instance.close()


def _places(variables: Sequence[Variable]) -> dict[str, int]:
    """The place of each variable's first value, where all values lie one after another."""
    names, sizes = [each.name for each in variables], [each.size for each in variables]
    return dict(zip(names, accumulate(sizes, initial=0), strict=False))


def _grouped(variables: Sequence[Variable]) -> list[Variable]:
    """The variables sorted by type, so that those of a type are neighbours."""
    order = list(dict.fromkeys(each.type for each in variables))
    return sorted(variables, key=lambda each: order.index(each.type))
