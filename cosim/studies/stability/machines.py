"""Machines of the stability study: voice coils on two bodies, as linear participants and as FMU."""

from dataclasses import asdict, dataclass, replace
from math import pi
from typing import Literal

from cosim.coupling.participants.linear import LinearParticipant, coil, regulated_coil
from cosim.scene import Scene, changed, load

Output = Literal["saturated", "regulated"]
Cut = Literal["coil in circuit", "coil in mechanics"]


@dataclass(frozen=True)
class Machine:
    """A voice coil on two bodies, SI; a ``surface_mass`` of infinity would be a clamped frame."""

    name: str
    force_factor: float
    resistance: float
    inductance: float
    ram_mass: float = 0.004
    suspension_k1: float = 40.0
    suspension_damping: float = 0.02
    surface_mass: float = 0.0145
    part_mass: float = 0.009
    flexure_stiffness: float = 560.0
    flexure_damping: float = 0.84
    sense_resistance: float = 4.0

    def carried(self, slips: bool) -> float:
        """Mass that moves with the surface, kg."""
        return self.surface_mass + (0.0 if slips else self.part_mass)

    def mass(self, slips: bool) -> float:
        """The mass that the coil feels at once, kg."""
        return 1.0 / (1.0 / self.ram_mass + 1.0 / self.carried(slips))

    @property
    def loop(self) -> float:
        """Resistance around which the back-EMF drives a current, Ω."""
        return self.resistance + self.sense_resistance

    @property
    def strength(self) -> float:
        """How strongly coil and mechanics are coupled while the part sticks, Bl²/(m R) in 1/s."""
        return self.force_factor**2 / (self.mass(False) * self.loop)


REFERENCE = Machine("reference", 0.6, 7.1, 1.2e-3)
STRONG = Machine("Bl 3 N/A", 3.0, 7.1, 1.2e-3)
DIRECT = Machine(
    "direct drive",
    *(4.38, 4.3, 0.83e-3),
    ram_mass=4.33e-3,
    suspension_k1=1.0 / 1.07e-3,
    suspension_damping=0.474,
    surface_mass=100.0,
    flexure_stiffness=1e6,
    flexure_damping=1e3,
    sense_resistance=1e-3,
)
"""A loudspeaker driver like Dayton's ND91-4 on a voltage, its frame held: Bl 4.38 N/A, 4.3 Ω,
0.83 mH, 4.33 g, 1.07 mm/N, 0.474 kg/s."""
SLOW = replace(DIRECT, name="direct drive, 10 L", inductance=10.0 * DIRECT.inductance)

_OF_MECHANICS = (
    *("ram_mass", "surface_mass", "part_mass", "suspension_k1", "suspension_damping"),
    *("flexure_stiffness", "flexure_damping"),
)
GAIN_BANDWIDTH, OPEN_LOOP_GAIN = 1e6, 10.0 ** (98.0 / 20.0)


@dataclass(frozen=True)
class Regime:
    """A machine at one working state, cut in two."""

    machine: Machine
    output: Output
    slips: bool = False
    cut: Cut = "coil in circuit"


def _bodies(regime: Regime) -> tuple[list[list[float]], list[float]]:
    """States q, dq/dt, z_s, dz_s/dt: their rates, and what 1 A adds to these."""
    m, carried = regime.machine, regime.machine.carried(regime.slips)
    k, c = m.suspension_k1, m.suspension_damping
    kf, cf = m.flexure_stiffness, m.flexure_damping
    both = 1.0 / m.ram_mass + 1.0 / carried
    a = [
        [0.0, 1.0, 0.0, 0.0],
        [-k * both, -c * both, kf / carried, cf / carried],
        [0.0, 0.0, 0.0, 1.0],
        [k / carried, c / carried, -kf / carried, -cf / carried],
    ]
    return a, [0.0, m.force_factor * both, 0.0, -m.force_factor / carried]


def linear_sides(regime: Regime) -> tuple[LinearParticipant, LinearParticipant]:
    """Circuit and mechanics, homogeneous, a little away from rest."""
    m, (a, b) = regime.machine, _bodies(regime)
    if regime.cut == "coil in circuit":
        mechanics = LinearParticipant(a, [[x] for x in b], [[0.0, m.force_factor, 0.0, 0.0]])
        return circuit_of(regime), mechanics
    # Circuit: current in, coil's voltage out; the sense resistor is on its side.
    sense, rate = m.sense_resistance, 2.0 * pi * GAIN_BANDWIDTH
    if regime.output == "saturated":
        leak, driven = 0.0, 0.0
    else:
        leak, driven = -rate / OPEN_LOOP_GAIN, -rate * sense
    circuit = LinearParticipant([[leak]], [[driven]], [[1.0]], [[-sense]], state=[0.0])
    whole = [[*row, x] for row, x in zip(a, b, strict=True)]
    whole.append([0.0, -m.force_factor / m.inductance, 0.0, 0.0, -(m.loop - sense) / m.inductance])
    enters = [[0.0]] * 4 + [[1.0 / m.inductance]]
    out = [[0.0, 0.0, 0.0, 0.0, 1.0]]
    return circuit, LinearParticipant(whole, enters, out, state=[0.0, 0.0, 0.0, 0.0, 1e-3])


def circuit_of(regime: Regime) -> LinearParticipant:
    m = regime.machine
    if regime.output == "saturated":
        return coil(m.loop, m.inductance, 1e-3)
    return regulated_coil(
        m.resistance, m.inductance, m.sense_resistance, GAIN_BANDWIDTH, OPEN_LOOP_GAIN, 1e-3
    )


def scene_of(regime: Regime) -> Scene:
    """A scene whose mechanics are linear: no gravity, no hardening, no wall in reach.

    The part is held, or, if it ``slips``, let go.
    """
    own = asdict(regime.machine)
    settings = {f"mechanics.{key}": own[key] for key in _OF_MECHANICS}
    settings |= {"mechanics.gravity": 0.0, "mechanics.suspension_k3": 0.0, "mechanics.travel": 1e3}
    settings |= (
        {"friction.mu_k": 0.0, "friction.mu_s": 0.0}
        if regime.slips
        else {"friction.mu_s": 1000.0, "friction.normal_force": 1e9}
    )
    settings["coil.force_factor"] = regime.machine.force_factor
    return changed(load("reference"), settings, "stability")
