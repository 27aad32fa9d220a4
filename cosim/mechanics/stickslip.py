"""The mechanical participant: the FMU with the scene's parameters.

Names of parameters and outputs are those of ``variables.def``. Inputs are linear within a step:
their value at its start and their slope are set before it. An input is the current of one coil (A)
or, where the FMU has the current source too (circuit.model "limited"), the command (V).
"""

from collections.abc import Mapping
from ctypes import c_double, c_int
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import SimulationFailed
from cosim.mechanics.fmi import borrow, give_back
from cosim.mechanics.normal_force import normal_force
from cosim.scene import KEYS, Scene
from cosim.stepper.stepper import RIG, numbers
from cosim.toolchain.libraries import library

STEP_OUTPUTS = (
    *("back_emf", "back_emf_slope", "motional_flux", "time_to_impact"),
    *("a_surface_max", "a_surface_min", "v_surface_max", "v_surface_min"),
    *("z_surface_max", "z_surface_min"),
)
"""Outputs that are read after every interval of the inputs: back-EMF of one coil (V, V/s) and its
integral over time (Wb), and extremes since the inputs were set last."""

SAMPLE_OUTPUTS = (
    *("back_emf", "z_surface", "v_surface", "a_surface", "z_ram", "v_ram"),
    *("z_part", "v_part", "friction_force"),
)
"""Outputs in a row of the waveforms, SI, followed by ``sticking``. Where a second surface moves
independently, its own outputs follow, named with ``_2``; there is one part only."""

TOTALS = (
    *("z_part", "stick_time", "energy_in", "energy_friction", "energy_impact", "energy_damping"),
    "energy_stored",
)
SOURCE_STEP_OUTPUTS = ("coil_current_max", "coil_current_min")
"""Further outputs after an interval where the source is in the FMU: current of one coil, A."""

SOURCE_SAMPLE_OUTPUTS = ("coil_current", "coil_voltage")
"""Further outputs in a row then: current of one coil (A) and voltage across the coils (V)."""

SOURCE_TOTALS = (
    *("output_high_time", "output_low_time", "current_limit_time"),
    *("energy_output", "energy_copper", "energy_magnetic"),
)

INTERNAL = ("internal_steps", "internal_rejected")
COUNTERS = ("impacts", "stick_slip_events", *INTERNAL)

_KEYS = [
    [key for key in KEYS.values() if key.variable and key.kind is kind] for kind in (float, int)
]
_VARIABLES = [
    ([key.variable for key in group], attrgetter(*(key.full for key in group))) for group in _KEYS
]
"""For real and integer parameters: the FMU's variables that are keys, and their getter."""

FMI = 3
"""The FMI version by which the FMU is called; by version 2 it gives the same bits."""

CONTACT_LAWS = {"compliant": 1, "rigid": 2}
SUSPENSIONS = {"cubic": 1, "knee": 2, "repulsion": 3}
"""The FMU's numbers of a scene's choices."""


@cache
def _names(
    has_source: bool, two_surfaces: bool, changing_force: bool
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Names of the inputs from outside (ports), and of all the FMU's variables by role."""
    given = "command" if has_source else "current"
    step_outputs, sampled, totals = STEP_OUTPUTS, SAMPLE_OUTPUTS, TOTALS
    if has_source:
        step_outputs += SOURCE_STEP_OUTPUTS
        sampled += SOURCE_SAMPLE_OUTPUTS
        totals += SOURCE_TOTALS
    wholes, ports = ("sticking",), (given,)
    if two_surfaces:
        sampled += tuple(f"{name}_2" for name in sampled if not name.endswith("_part"))
        wholes += ("sticking_2",)
        ports += (f"{given}_2",)
        totals += ("stick_time_2",)
    inputs = (*ports, "normal_force") if changing_force else ports
    ramps = tuple(part for name in inputs for part in (name, f"{name}_slope"))
    return ports, {
        "inputs": ramps,
        "held_inputs": (*ramps, "inputs_hold_for"),
        "step_outputs": step_outputs,
        "reals": sampled,
        "wholes": wholes,
        "totals": totals,
        "counters": COUNTERS,
        "internal": INTERNAL,
    }


class Mechanics:
    """One instance of the FMU, initialised in static equilibrium at time 0 without current.

    Callers know its variables by their roles: keys of ``places``.
    """

    def __init__(self, scene: Scene) -> None:
        self.normal_force = normal_force(scene)
        """The normal force where it changes in time: an input that is a given function of time."""
        self.has_source = scene.rung.source_in_fmu
        """Whether the input is the command of the FMU's own source, V, and not a current, A."""
        two, changing = scene.drive.phase_deg is not None, self.normal_force is not None
        self.ports, names = _names(self.has_source, two, changing)
        self.columns, self.total_names = names["reals"] + names["wholes"], names["totals"]
        """``ports`` are the names of the inputs from outside, ``columns`` those of a row (reals,
        then whole numbers), ``total_names`` those of the totals."""
        self.instance = borrow(FMI)
        places = self.instance.places
        self.places: dict[str, Any] = {role: places(of) for role, of in names.items()}
        """Value references by role."""
        self.inputs = (c_double * len(self.places["inputs"]))()
        """Value and slope of each input, as set last."""
        self.step_outputs = (c_double * len(self.places["step_outputs"]))()
        """Values of STEP_OUTPUTS, and SOURCE_STEP_OUTPUTS, as read last."""
        self._slope_place, self._current_place = places(("back_emf_slope",)), places(("current",))
        self._gain = (c_double * 1)()
        reals, integers = parameters(scene)
        try:
            self.instance.set_reals(places(reals), (c_double * len(reals))(*reals.values()))
            self.instance.set_integers(
                places(integers), (c_int * len(integers))(*integers.values())
            )
            if self.normal_force is not None:
                force = (c_double * 1)(self.normal_force.value(0.0))
                self.instance.set_reals(places(("normal_force",)), force)
            self.instance.initialise()
            self.instance.get_reals(self.places["step_outputs"], self.step_outputs)
        except Exception as error:
            self.instance.close()
            raise self.failed(error, 0.0) from error

    def sample(self) -> dict[str, float]:
        """Values of ``columns`` now; sticking is 1, slipping 0."""
        return dict(zip(self.columns, self._read("reals", "wholes"), strict=True))

    def totals(self) -> dict[str, float]:
        """Values of TOTALS (and SOURCE_TOTALS) and COUNTERS now, counted from the start."""
        names = (*self.total_names, *COUNTERS)
        return dict(zip(names, self._read("totals", "counters"), strict=True))

    def internal_steps(self) -> int:
        """Internal steps of the FMU so far, taken and rejected."""
        return sum(self._wholes("internal"))

    def _read(self, reals: str, wholes: str) -> list[float]:
        numbers = (c_double * len(self.places[reals]))()
        self.instance.get_reals(self.places[reals], numbers)
        return [*numbers, *self._wholes(wholes)]

    def _wholes(self, role: str) -> list[int]:
        counts = (c_int * len(self.places[role]))()
        self.instance.get_integers(self.places[role], counts)
        return list(counts)

    def inertial_gain(self, time: float) -> float:
        """d(back-EMF slope)/d(current) now, at ``time`` (s), V/(A s): Bl² over the mass that the
        coil feels, as the part sticks or slips and the ram is free or rests on a wall."""
        try:
            self.instance.derivative(self._slope_place, self._current_place, self._gain)
        except Exception as error:
            raise self.failed(error, time) from error
        return self._gain[0]

    def close(self) -> None:
        """End the use of the instance."""
        give_back(self.instance)

    def failed(self, error: Exception, time: float) -> SimulationFailed:
        """What to raise for a call at ``time`` (s) that gave ``error``, in the FMU's words."""
        said = self.instance.messages[-1] if self.instance.messages else str(error)
        current, beyond, _ = said.partition(": current = ")[2].partition(" is outside")
        if beyond:  # the FMU refuses the current, to which circuit or coupling steps drove it
            return SimulationFailed(
                f"The run diverges: the coil's current has grown to {current} by t = {time:.6g} s; "
                "look for signs and positive feedback in the netlist, if it is your own, or take "
                "a smaller coupling.macro_step or circuit.max_step."
            )
        return SimulationFailed(f"The mechanics failed at t = {time:.6g} s: {said}")


def parameters(scene: Scene) -> tuple[dict[str, float], dict[str, int]]:
    """Real and integer parameters of the FMU, with the scene's normal force."""
    reals: dict[str, float] = {}
    integers = {
        "contact": CONTACT_LAWS[scene.mechanics.contact],
        "suspension": SUSPENSIONS[scene.mechanics.suspension],
        "ram_fixed": int(not scene.mechanics.free_ram),
        "independent": int(scene.drive.phase_deg is not None),
        "source": int(scene.rung.source_in_fmu),
    }
    for group, (names, values) in zip((reals, integers), _VARIABLES, strict=True):
        pairs = zip(names, values(scene), strict=True)
        group.update([pair for pair in pairs if pair[1] is not None])
    reals["force_factor"] *= scene.coil.polarity
    if scene.rung.source_in_fmu:
        circuit = scene.circuit
        reals["output_high"] = circuit.supply - circuit.swing_loss_high
        reals["output_low"] = circuit.swing_loss_low - circuit.supply
    return reals, integers


def numbers_of(scene: Scene) -> dict[str, float]:
    """The stepper's numbers of a scene's rig, as far as the FMU has them."""
    reals, integers = parameters(scene)
    return numbers(reals | integers)


def suspension_force(known: Mapping[str, float], places: Array) -> Array:
    """Force (N) of a rig's suspension on a ram at rest at ``places`` (q, m)."""
    rig, force_at = _rig(known), library("stepper").stepper_suspension
    return np.array([force_at(rig, q) for q in places.tolist()])


def rests_of(known: Mapping[str, float]) -> list[float]:
    """Positions (q, m), rising, of a ram at rest without current; also in a compliant wall."""
    found = (c_double * 4)()
    count = library("stepper").stepper_rests(_rig(known), found)
    return [*found][:count]


def _rig(known: Mapping[str, float]) -> Any:
    return (c_double * len(RIG))(*(known.get(name, 0.0) for name in RIG))
