"""The one policy of fidelity: a simple circuit model searches, a more complete one judges."""

from dataclasses import dataclass

from cosim.errors import BadInput
from cosim.scene import Scene, changed

SEARCHES, JUDGES, COMPLETE = "limited", "amplifier", "full"
"""The model that searches, with the mechanics and without ngspice; the one that judges it; and the
one that judges where the current limit acts, which the amplifier does not have."""

AT_LIMIT = 0.999
"""Of the current limit: where the current reaches so far, it acts."""

LEAST = 1e-4
"""SI: errors are relative to no less than this; it is meant for mean velocities, m/s."""


def relative_error(value: float, reference: float) -> float:
    """Of a number relative to ``reference``, or to LEAST."""
    return abs(value - reference) / max(abs(reference), LEAST)


@dataclass(frozen=True)
class Fidelity:
    """Which circuit models search and judge a scene, and how near they must agree."""

    tolerance: float
    """Relative difference up to which the judge confirms."""
    simple: dict[str, str | bool] | None
    """What makes the scene one that ngspice need not run; None where it does not anyway, or where
    it must."""

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
        """Whether a value is near enough to that of the judge; none is near to nothing."""
        if value is None or judged is None:
            return False
        return relative_error(value, judged) <= self.tolerance

    def judge(self, current: float, limit: float) -> str:
        """The model that judges a run whose current reached ``current``, A, of ``limit``."""
        return COMPLETE if current > AT_LIMIT * limit else JUDGES
