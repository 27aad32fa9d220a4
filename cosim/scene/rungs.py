"""The rungs and the coupling methods: each value of ``circuit.model`` and of ``coupling.method``,
declared once.

What a rung computes is in ``cosim/simulation``, a method in ``cosim/coupling``; here is what
scenes, messages and reports need.
"""

from collections.abc import Set
from dataclasses import dataclass

_SOLVER = {"reltol", "max_step"}
_SUPPLY = {"supply", "sense_resistance"}
_SWING = {"swing_loss_high", "swing_loss_low"}
_LIMIT = {"current_limit"}
_SNUBBER = {"snubber_resistance", "snubber_capacitance"}
_DYNAMICS = {"gain_bandwidth", "open_loop_gain", "slew_rate", "output_resistance"} | _SNUBBER
_OWN = {"netlist", "save", "param"}
_OF_NGSPICE = _SOLVER | _SUPPLY | _SWING | _LIMIT | _DYNAMICS


@dataclass(frozen=True)
class Rung:
    """One value of ``circuit.model``."""

    name: str
    text: str
    keys: Set[str]
    """The keys of ``[circuit]`` that act, besides ``model``."""
    ngspice: bool = False
    """Whether ngspice solves the circuit and leads the coupling."""
    driven: bool = True
    """Whether a command drives a coil; else ``[drive]`` can only give the surface's velocity."""
    source_in_fmu: bool = False
    """Whether the FMU solves the current source together with the mechanics."""
    firmware: bool = False
    """Whether the circuit has the DAC and the offset pin of the device's firmware."""
    automatic: bool = False
    """Whether the run takes another rung, the cheapest that suffices."""

    @property
    def own_netlist(self) -> bool:
        """Whether the user gives the netlist."""
        return "netlist" in self.keys

    @property
    def has_limits(self) -> bool:
        """Whether the output of the amplifier is limited by its supply."""
        return "supply" in self.keys

    @property
    def on_ladder(self) -> bool:
        """Whether it models the device's amplifier, and other rungs do the same."""
        return self.driven and not self.own_netlist


_ALL = (
    Rung(
        "full",
        "schematic with its difference amplifier",
        _SOLVER | _SUPPLY | _LIMIT | _DYNAMICS,
        ngspice=True,
        firmware=True,
    ),
    Rung(
        "amplifier",
        "behavioural current source",
        _SOLVER | _SUPPLY | _SWING | _DYNAMICS,
        ngspice=True,
    ),
    Rung(
        "limited",
        "current source reduced to its limits and the coil",
        _SUPPLY | _SWING | _LIMIT,
        source_in_fmu=True,
    ),
    Rung("ideal", "current = command", {"sense_resistance"}),
    Rung(
        "auto",
        "cheapest of amplifier, limited and ideal within run.tolerance",
        _OF_NGSPICE,
        ngspice=True,
        automatic=True,
    ),
    Rung("none", "no coil", frozenset(), driven=False),
    Rung("file", "netlist named in circuit.netlist", _OF_NGSPICE | _OWN, ngspice=True),
)

RUNGS = {rung.name: rung for rung in _ALL}
"""Every rung by its name, in the order in which messages list them: of the ladder from its top."""

LADDER = tuple(
    name for name in reversed(RUNGS) if RUNGS[name].on_ladder and not RUNGS[name].automatic
)
"""The rungs that studies compare, cheapest first; "full" alone has the data sheet's output stage
and the firmware's staircase."""


@dataclass(frozen=True)
class CouplingMethod:
    """One value of ``coupling.method``."""

    name: str
    text: str
    keys: Set[str] = frozenset()
    """The keys of ``[coupling]`` that act, besides ``method``."""
    chooses: Set[str] = frozenset()
    """The keys of ``[circuit]`` that the method chooses itself."""


_STEP = {"macro_step"}
_SHAPE = _STEP | {"order"}

_METHODS = (
    CouplingMethod("step-locked", "mechanics follow each accepted step of ngspice"),
    CouplingMethod("jacobi", "macro steps, both sides extrapolated", _SHAPE),
    CouplingMethod("gauss-seidel", "macro steps, mechanics take the current as a line", _SHAPE),
    CouplingMethod("mean-current", "macro steps, mechanics take the mean current", _SHAPE),
    CouplingMethod("companion", "macro steps, circuit carries the inertia of the mechanics", _STEP),
    CouplingMethod("macro-steps", "explicit macro steps of the scene's own FMUs", _STEP),
    CouplingMethod("redo", "own FMUs and ngspice repeat each step until they agree"),
    CouplingMethod(
        "auto",
        "cheapest method and steps of ngspice within coupling.tolerance",
        {"tolerance"},
        chooses={"reltol", "max_step"},
    ),
)

OF_PORTS = ("auto", "step-locked", "macro-steps", "redo")
"""Methods for a scene with its own ports; the last two are for such scenes only."""

METHODS = {method.name: method for method in _METHODS}
"""Every method by its name; the order is that in which messages list them."""
