"""Machines of the stability study: voice coils on two bodies, as linear participants and as FMU."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Literal

from cosim.coupling.participants.linear import LinearParticipant, coil, regulated_coil
from cosim.scene import Scene, changed, load

Output = Literal["saturated", "regulated"]
Cut = Literal["coil in circuit", "coil in mechanics"]
Table = Mapping[str, float]

_LINEAR: Table = {"mechanics.gravity": 0.0, "mechanics.suspension_k3": 0.0, "mechanics.travel": 1e3}
"""No gravity, no hardening, no wall in reach."""


@dataclass(frozen=True, eq=False)
class Machine:
    """A voice coil on two bodies, with linear mechanics: what differs from scene `reference`."""

    name: str
    settings: Table

    @cached_property
    def scene(self) -> Scene:
        return changed(load("reference"), {**_LINEAR, **self.settings}, "stability")

    @property
    def strength(self) -> float:
        """How strongly coil and mechanics are coupled while the part sticks, Bl²/(m R) in 1/s; m
        is the mass that the coil feels at once, R around what the back-EMF drives a current."""
        m, coil = self.scene.mechanics, self.scene.coil
        mass = 1.0 / (1.0 / m.ram_mass + 1.0 / (m.surface_mass + m.part_mass))
        around = coil.resistance + self.scene.circuit.sense_resistance
        return coil.force_factor**2 / (mass * around)

    def but(self, name: str, settings: Table) -> "Machine":
        """One that differs in some settings."""
        return Machine(name, {**self.settings, **settings})


REFERENCE = Machine("reference", {})
STRONG = Machine("Bl 3 N/A", {"coil.force_factor": 3.0})
DIRECT = Machine(
    "direct drive",
    {
        "coil.force_factor": 4.38,
        "coil.resistance": 4.3,
        "coil.inductance": 0.83e-3,
        "circuit.sense_resistance": 1e-3,
        "mechanics.ram_mass": 4.33e-3,
        "mechanics.suspension_k1": 1.0 / 1.07e-3,
        "mechanics.suspension_damping": 0.474,
        "mechanics.surface_mass": 100.0,
        "mechanics.flexure_stiffness": 1e6,
        "mechanics.flexure_damping": 1e3,
    },
)
"""A loudspeaker driver like Dayton's ND91-4 on a voltage, its frame held: Bl 4.38 N/A, 4.3 Ω,
0.83 mH, 4.33 g, 1.07 mm/N, 0.474 kg/s."""
SLOW = DIRECT.but("direct drive, 10 L", {"coil.inductance": 8.3e-3})


@dataclass(frozen=True)
class Regime:
    """A machine at one working state, cut in two."""

    machine: Machine
    output: Output
    slips: bool = False
    cut: Cut = "coil in circuit"

    @property
    def scene(self) -> Scene:
        """The part is held, or, if it ``slips``, let go."""
        free = {"friction.mu_k": 0.0, "friction.mu_s": 0.0}
        held = {"friction.mu_s": 1000.0, "friction.normal_force": 1e9}
        return changed(self.machine.scene, free if self.slips else held, "stability")


def _bodies(regime: Regime) -> tuple[list[list[float]], list[float]]:
    """States q, dq/dt, z_s, dz_s/dt: their rates, and what 1 A adds to these."""
    m, bl = regime.machine.scene.mechanics, regime.machine.scene.coil.force_factor
    carried = m.surface_mass + (0.0 if regime.slips else m.part_mass)
    k, c = m.suspension_k1, m.suspension_damping
    kf, cf = m.flexure_stiffness, m.flexure_damping
    both = 1.0 / m.ram_mass + 1.0 / carried
    a = [
        [0.0, 1.0, 0.0, 0.0],
        [-k * both, -c * both, kf / carried, cf / carried],
        [0.0, 0.0, 0.0, 1.0],
        [k / carried, c / carried, -kf / carried, -cf / carried],
    ]
    return a, [0.0, bl * both, 0.0, -bl / carried]


def linear_sides(regime: Regime) -> tuple[LinearParticipant, LinearParticipant]:
    """Circuit and mechanics, homogeneous, a little away from rest."""
    scene, (a, b) = regime.machine.scene, _bodies(regime)
    bl, inductance = scene.coil.force_factor, scene.coil.inductance
    if regime.cut == "coil in circuit":
        mechanics = LinearParticipant(a, [[x] for x in b], [[0.0, bl, 0.0, 0.0]])
        return circuit_of(regime), mechanics
    # Circuit: current in, coil's voltage out; the sense resistor is on its side.
    sense, rate, gain = _amplifier(scene)
    leak, driven = (0.0, 0.0) if regime.output == "saturated" else (-rate / gain, -rate * sense)
    circuit = LinearParticipant([[leak]], [[driven]], [[1.0]], [[-sense]], state=[0.0])
    whole = [[*row, x] for row, x in zip(a, b, strict=True)]
    whole.append([0.0, -bl / inductance, 0.0, 0.0, -scene.coil.resistance / inductance])
    enters = [[0.0]] * 4 + [[1.0 / inductance]]
    out = [[0.0, 0.0, 0.0, 0.0, 1.0]]
    return circuit, LinearParticipant(whole, enters, out, state=[0.0, 0.0, 0.0, 0.0, 1e-3])


def circuit_of(regime: Regime) -> LinearParticipant:
    """The circuit with the coil in it, and a milliampere."""
    scene = regime.machine.scene
    resistance, inductance = scene.coil.resistance, scene.coil.inductance
    sense, rate, gain = _amplifier(scene)
    if regime.output == "saturated":
        return coil(resistance + sense, inductance, 1e-3)
    return regulated_coil(resistance, inductance, sense, rate / (2.0 * pi), gain, 1e-3)


def _amplifier(scene: Scene) -> tuple[float, float, float]:
    """Sense resistance (Ω), gain-bandwidth (rad/s), open-loop gain (a plain number)."""
    circuit = scene.circuit
    rate = 2.0 * pi * circuit.gain_bandwidth
    return circuit.sense_resistance, rate, 10.0 ** (circuit.open_loop_gain / 20.0)
