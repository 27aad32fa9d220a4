"""Whether the mechanics of a run can be solved to its end, judged by what its beginning took.

What acts at every moment is checked with the scene. How stiff a wall, a hardening suspension or a
changing force factor gets depends on the motion, and so shows only when it is solved.
"""

import math

from cosim.errors import SimulationFailed
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, keys

BUDGET = 3e8
"""Internal steps of the FMU that a run may take, beyond one for each step that it is asked for:
some minutes."""

ORDINARY = 1e6
"""Internal steps per simulated second that no budget forbids: a run may be long. The built-in
scenes take some 1e4."""

ENOUGH, BEGINNING = 3e6, 3e7
"""Internal steps after which a run can be judged, some seconds, and after which it no longer is:
what has gone well for so long is not stopped."""


class Pace:
    """Judges one run."""

    def __init__(self, scene: Scene, mechanics: Mechanics) -> None:
        self._scene, self._mechanics = scene, mechanics
        self._spent = 0.0

    def judge(self, time: float, steps: int) -> None:
        """At ``time`` (s), after ``steps`` of the FMU.

        Raises SimulationFailed where the run is only at its beginning, and the rest, at the pace
        so far, would exceed the budget.
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
    for key in keys():
        if key.table in ("coil", "mechanics") and key.kind is float and key.default is not None:
            value = getattr(getattr(scene, key.table), key.name)
            shown = f"{key.full} = {value:g}" + ("" if key.unit == "1" else f" {key.unit}")
            found.append((decades(value, float(key.default)), shown))
    return max(found)[1]
