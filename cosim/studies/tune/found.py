"""What a search has found."""

from dataclasses import dataclass
from math import inf

from cosim.evaluate.point import Number, Outcome
from cosim.scene import Scene

TURNS = (-0.05, -0.01, 0.01, 0.05)
"""How far each key is turned about the best, as shares of its range."""


@dataclass(frozen=True)
class Run:
    """One simulation of a search: its settings (SI), its summary, and the value asked for."""

    values: dict[str, Number]
    outcome: Outcome
    value: float | None


@dataclass(frozen=True)
class Search:
    """What a search has found.

    ``neighbours`` gives for each key the value at each of TURNS about the best run, None beyond the
    end of its range or where the run failed; empty where turning led on to this best run and the
    budget ended there.
    """

    quantity: str
    largest: bool
    ranges: dict[str, tuple[float, float]]
    runs: list[Run]
    best: Run
    neighbours: dict[str, list[float | None]]
    scene: Scene
    """The scene at the best settings."""
    scouts: int
    """Runs on the rung "limited", or with the fast solver, that went ahead."""
    seed: int
    by_fast: float | None = None
    """The value at the best run by the fast solver, where that searched: the FMU has judged."""

    @property
    def failed(self) -> int:
        """How many runs have no value."""
        return sum(run.value is None for run in self.runs)

    def lost(self, turn: float) -> float | None:
        """Greatest loss when one key is turned by ``turn`` of its range either way.

        As a share of the best value; inf where such a run failed; None where there is none.
        """
        assert self.best.value is not None
        losses = []
        for key, values in self.neighbours.items():
            low, high = self.ranges[key]
            for place, value in zip(TURNS, values, strict=True):
                there = self.best.values[key] + place * (high - low)
                if abs(place) == turn and low <= there <= high:
                    change = inf if value is None else self.best.value - value
                    losses.append(change if self.largest or value is None else -change)
        return max(losses) / (abs(self.best.value) or 1.0) if losses else None
