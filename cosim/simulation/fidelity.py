"""The policy of fidelity: a simple circuit model searches, a more complete one judges."""

from dataclasses import dataclass

from cosim.errors import BadInput
from cosim.scene import Scene, changed

SEARCHES, JUDGES, COMPLETE = "limited", "amplifier", "full"
"""The model for searches, which needs no ngspice; the model that judges its results; and the model
that judges where the current limit acts, which the amplifier lacks."""

AT_LIMIT = 0.999
"""Share of the current limit from which on the limit counts as acting."""

LEAST = 1e-4
"""Least reference of a relative error, SI; meant for mean velocities, m/s."""


def relative_error(value: float, reference: float) -> float:
    """The error of a number relative to ``reference``, or to LEAST if that is larger."""
    return abs(value - reference) / max(abs(reference), LEAST)


@dataclass(frozen=True)
class Fidelity:
    """Which circuit models search and judge a scene, and how near they must agree."""

    tolerance: float
    """Relative difference up to which the judging model confirms a value."""
    simple: dict[str, str | bool] | None
    """Settings with which the scene needs no ngspice; None if it needs none anyway, or always."""

    @classmethod
    def of(cls, scene: Scene) -> "Fidelity":
        """The policy for a scene: its ``run.tolerance``."""
        simple = None
        if scene.rung.ngspice and not scene.rung.own_netlist:
            simple = {"circuit.model": SEARCHES, "drive.pwm_ripple": False}
            try:
                changed(scene, simple, "limited")
            except BadInput:
                simple = None
        return cls(scene.run.tolerance, simple)

    def agrees(self, value: float | None, judged: float | None) -> bool:
        """Whether a value is within the tolerance of the judging model's; False if one is None."""
        if value is None or judged is None:
            return False
        return relative_error(value, judged) <= self.tolerance

    def judge(self, current: float, limit: float) -> str:
        """The model that judges a run with the largest current ``current`` and a ``limit``, A."""
        return COMPLETE if current > AT_LIMIT * limit else JUDGES
