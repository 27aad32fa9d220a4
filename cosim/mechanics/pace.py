"""Stops a run whose mechanics would take too many internal steps, judged by its beginning.

Constant stiffness is checked with the scene. How stiff a wall, a hardening suspension or a varying
force factor becomes depends on the motion, and so shows only during the run.
"""

import math

from cosim.errors import SimulationFailed
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import KEYS, Scene

BUDGET = 3e8
"""Internal steps of the FMU that a run may take beside communication steps: some minutes."""

ORDINARY = 1e6
"""Internal steps per simulated second that are always allowed, since a run may be long. The
built-in scenes take some 1e4."""

ENOUGH, BEGINNING = 3e6, 3e7
"""Internal steps from which on a run is judged (some seconds), and from which on it no longer is:
a run that has gone well for so long is not stopped."""


class Pace:
    """Judges one run."""

    def __init__(self, scene: Scene, mechanics: Mechanics) -> None:
        self._scene, self._mechanics = scene, mechanics
        self._spent = 0.0

    def judge(self, time: float, steps: int) -> None:
        """Judge at ``time`` (s), after ``steps`` communication steps of the FMU.

        Raises SimulationFailed if the run is still at its beginning, and would exceed the budget at
        the pace so far.
        """
        if self._spent > BEGINNING:
            return
        duration = self._scene.run.duration
        self._spent = float(self._mechanics.internal_steps() - steps)
        if self._spent < ENOUGH or self._spent < ORDINARY * time:
            return
        expected = self._spent * duration / time
        if expected > BUDGET:
            raise SimulationFailed(
                f"The mechanics are too fast to be solved: they took {self._spent:.2g} internal "
                f"steps until t = {time:.3g} s, and run.duration = {duration:g} s would take about "
                f"{expected:.2g}, more than {BUDGET:.0g}; furthest from its default is "
                f"{_furthest(self._scene)}."
            )


def _furthest(scene: Scene) -> str:
    """The key of coil or mechanics whose value differs most from its default, in decades."""

    def decades(value: float, default: float) -> float:
        if default == 0.0:
            return math.log10(max(abs(value), 1.0))
        return abs(math.log10(abs(value / default))) if value else 1.0

    found = []
    for key in KEYS.values():
        if key.table in ("coil", "mechanics") and key.kind is float and key.default is not None:
            value = getattr(getattr(scene, key.table), key.name)
            shown = f"{key.full} = {value:g}" + ("" if key.unit == "1" else f" {key.unit}")
            found.append((decades(value, float(key.default)), shown))
    return max(found)[1]
