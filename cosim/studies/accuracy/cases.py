"""The scenes of the study, their reference solutions, which were calculated once
(``reference.json``), and participants for them that can repeat a step."""

import json
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np

from cosim.coupling.participants.amplifier import Amplifier
from cosim.coupling.participants.linear import LinearParticipant, regulated_coil
from cosim.coupling.participants.stickslip import FmuMechanics
from cosim.drive.command import command
from cosim.scene import Scene


@dataclass(frozen=True)
class Case:
    """Overrides of the scene ``reference``, its duration (s) and time between samples (s)."""

    name: str
    title: str
    overrides: tuple[str, ...]
    duration: float
    sampled: float = 2.5e-3
    judged: tuple[str, ...] = ("z_part",)
    """Signals that are compared; near impacts velocities would show only the impacts' times."""
    netlist: bool = False
    """Whether the reference includes the leak of the netlist's pole, which low bandwidth shows."""

    @property
    def smooth(self) -> bool:
        """Whether nothing jumps, so that orders can be measured."""
        return self.name.startswith("smooth")

    def times(self) -> list[float]:
        """Times (s) at which signals are compared."""
        count = round(self.duration / self.sampled)
        return [self.duration * k / count for k in range(1, count + 1)]


_SMOOTH = Case(
    "smooth",
    "smooth: sine, slow amplifier, no wall met, the part sticks",
    (
        *("drive.waveform=sine", "drive.frequency=40", "drive.amplitude=1", "drive.offset=0"),
        *("circuit.gain_bandwidth=1e3", "coil.force_factor=3"),
        *("mechanics.travel=1e-2", "friction.normal_force=5"),
    ),
    0.02,
    1e-3,
    ("z_surface", "z_ram", "v_ram", "current"),
)

CASES = {
    case.name: case
    for case in (
        _SMOOTH,
        replace(_SMOOTH, name="smooth, netlist", netlist=True),
        Case(
            "stick-slip",
            "stick-slip: no wall met, the part sticks and slips",
            (
                *("drive.frequency=20", "drive.amplitude=3", "drive.offset=0"),
                *("coil.force_factor=3", "mechanics.travel=2e-2"),
                *("mechanics.suspension_k1=4000", "mechanics.suspension_k3=0"),
            ),
            0.2,
        ),
        Case(
            "impact",
            "impact: rigid walls, the part sticks",
            ("mechanics.contact=rigid", "friction.normal_force=20"),
            0.2,
        ),
        Case("reference", "reference: compliant walls, stick and slip", (), 0.2),
    )
}


@dataclass(frozen=True)
class Reference:
    """A scene's reference solution and how far it can be trusted."""

    signals: np.ndarray
    """Signals × times, SI."""
    other_method: float
    """Error of another integration method against it, over the range."""
    growth: float
    """Change of the path, over its range, per relative change of the normal force."""

    def error(self, found: np.ndarray) -> float:
        """Largest error over time and signals, over the signal's range; inf for NaN or overflow."""
        off = np.abs(found - self.signals).max(axis=1) / np.ptp(self.signals, axis=1)
        return float(off.max()) if np.isfinite(off).all() else np.inf


def reference(name: str) -> Reference:
    """The reference solution of a case of :data:`CASES`, by name."""
    text = (files("cosim.studies.accuracy") / "reference.json").read_text(encoding="utf-8")
    entry = json.loads(text)["cases"][name]
    signals = np.array(list(entry["signals"].values()))
    return Reference(signals, entry["other_method"], entry["growth"])


def participants(scene: Scene) -> tuple[LinearParticipant | Amplifier, FmuMechanics]:
    """The circuit ``amplifier`` and the mechanics of a scene, at rest; both can repeat a step."""
    drive, mechanics = scene.drive, FmuMechanics(scene)
    if drive.waveform == "sine" and drive.offset == 0.0:
        # ``Amplifier`` needs a command of straight lines; for a sine the linear circuit is exact.
        sine = (0.5 * drive.amplitude, drive.frequency)
        return regulated_coil(scene, sine=sine), mechanics
    return Amplifier(scene, command(scene)), mechanics
