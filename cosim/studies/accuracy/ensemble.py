"""Statistics of runs that differ by next to nothing, for scenes whose single paths say nothing."""

from dataclasses import dataclass
from math import hypot, sqrt
from statistics import mean, stdev


@dataclass(frozen=True)
class Ensemble:
    """Values of each statistic, one a member."""

    name: str
    values: dict[str, list[float]]

    def mean(self, statistic: str) -> tuple[float, float]:
        """Mean and its standard error."""
        found = self.values[statistic]
        return mean(found), stdev(found) / sqrt(len(found))

    def apart(self, other: "Ensemble", statistic: str) -> float:
        """Distance of two means in units of the standard error of their difference."""
        (a, ea), (b, eb) = self.mean(statistic), other.mean(statistic)
        return abs(a - b) / (hypot(ea, eb) or 1.0)
