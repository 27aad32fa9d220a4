"""What an identification has found."""

from dataclasses import dataclass
from typing import Any

from cosim.arrays import Array
from cosim.studies.identify.problem.space import Space
from cosim.studies.identify.problem.targets import Measured
from cosim.studies.identify.report.verdicts import Rig, Verdict
from cosim.studies.identify.search.plan import Searched
from cosim.studies.identify.search.search import Found


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A trial on a rig that was found without it: its own numbers fitted to its surface alone, and
    to surface and part, whose heights count twice there."""

    trial: Measured
    fold: int
    place: Array
    surface: Array
    both: Array


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """``numbers`` is what ``identify.json`` holds."""

    space: Space
    """Of the law whose best solution is reported."""
    trials: list[Measured]
    apart: list[Measured]
    """Trials that were not fitted."""
    best: Found
    apart_own: Array
    laws: list[Searched]
    meant: list[Rig]
    """The rigs that may be meant, the best first."""
    fold_rigs: list[Found]
    held_out: list[HeldOut]
    verdicts: list[Verdict]
    made_up: Rig
    """The rig of the scene keys' defaults, with its best drives."""
    numbers: dict[str, Any]

    @property
    def rig(self) -> dict[str, Any]:
        """The identified rig by the keys of a scene, SI."""
        return self.space.settings(self.best.place)
