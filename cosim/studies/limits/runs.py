"""What the runs of machines tell: scores, heat, and what coil and power amplifier bear."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Outcome
from cosim.scene import Scene, changed, firmware
from cosim.search.protocol import Feasible
from cosim.simulation.fidelity import SEARCHES, Fidelity
from cosim.studies.limits import aims
from cosim.studies.limits.aims import NEEDED, QUANTITIES, Numbers, scores
from cosim.studies.limits.table import Machine, Settings

SETTLE, SPAN = 0.4, 0.6
"""s, left out of averages and averaged over, at least; made whole periods."""

OPA548_CURRENT = 5.0
"""A: the OPA548's peak current (data sheet SBOS070D)."""


@dataclass(frozen=True)
class Case:
    """A machine on a rig, on a circuit; ``rig`` are the changes of the scene that make it."""

    rig: Settings
    machine: Machine
    rung: str = SEARCHES

    def settings(self, point: Array) -> Settings:
        """All that differs from the scene at a point of the cube; whole periods are run."""
        turned = aims.settings(point, self.machine.reach)
        there = {**self.rig, **self.machine.settings, **turned, "circuit.model": self.rung}
        period = 1.0 / turned["drive.frequency"]
        if there.get("drive.quantised"):
            period = (
                len(firmware.staircase(1, turned["drive.frequency"])) / firmware.STEPS_PER_SECOND
            )
        settle, span = (max(1, ceil(t / period - 1e-9)) for t in (SETTLE, SPAN))
        times = {"run.settle": settle * period, "run.duration": (settle + span) * period}
        return {**there, **times}


class Bench(Evaluator):
    """Runs settings on top of ``scene``; to be used in a ``with`` block.

    ``asked`` are the words after ``cosim run`` that stand for the scene.
    """

    def __init__(
        self,
        scene: Scene,
        asked: str,
        path: Path | None,
        workers: int | None = None,
        dask: str | None = None,
    ) -> None:
        own = aims.FREE | {
            "circuit.model": SEARCHES, "drive.pwm_ripple": False, "drive.quantised": False,
            "run.settle": SETTLE, "run.duration": SETTLE + SPAN,
        }  # fmt: skip
        self.scene = changed(scene, own, f"scene {scene.name}")
        self.fidelity = Fidelity.of(scene)
        tables = scene.as_dict()
        self._unlike: Settings = {
            key: value
            for key, value in own.items()
            if isinstance(value, bool) and tables["drive"][key.split(".")[1]] != value
        }
        self._asked = asked
        super().__init__(self.scene, path, kept=NEEDED, workers=workers, dask=dask)

    def outcomes(self, every: Sequence[Settings]) -> list[Outcome]:
        """What becomes of each settings, on the circuit that they name."""
        found = dict(self.run(enumerate(every)))
        return [found[number] for number in range(len(every))]

    def scores(self, case: Case, points: Array) -> tuple[Array, Feasible]:
        """The scores of points (rows), -inf where a run fails, and which of them are feasible."""
        every = [case.settings(point) for point in points]
        found = np.full((len(every), len(QUANTITIES)), -inf)
        feasible = np.zeros(len(every), bool)
        for row, (settings, outcome) in enumerate(zip(every, self.outcomes(every), strict=True)):
            if not outcome.failure:
                found[row] = scores(outcome.numbers)
                feasible[row] = self.feasible(case, settings, outcome.numbers)
        return found, feasible

    def feasible(self, case: Case, settings: Settings, numbers: Numbers) -> bool:
        """Whether a run keeps within what the coil and the power amplifier bear."""
        current = self.peak(numbers) * case.machine.coil_scale
        return current <= OPA548_CURRENT and self.heat(case, numbers) <= case.machine.heat

    def peak(self, numbers: Numbers) -> float:
        """The greatest current of all coils together of a run, A."""
        return max(numbers["current_max"], -numbers["current_min"]) * self.scene.coil.count

    def judge(self, case: Case, settings: Settings, numbers: Numbers) -> str:
        """The circuit model that judges a run."""
        if case.rung == "ideal":
            return case.rung
        limit = float(settings.get("circuit.current_limit", self.scene.circuit.current_limit))
        return self.fidelity.judge(self.peak(numbers), limit)

    def amperes(self, case: Case) -> float:
        """The knobs' range, A."""
        own = self.scene.circuit.sense_resistance
        changes = {**case.rig, **case.machine.settings}
        sense = changes.get("circuit.sense_resistance", own)
        return case.machine.coil_scale * case.machine.reach * aims.RANGE / float(sense)

    def heat(self, case: Case, numbers: Numbers) -> float:
        """Mean heat, W, of the coil that a case stands for."""
        return numbers["coil_heat"] * case.machine.coil_scale

    def command(self, settings: Settings) -> str:
        """The one command that repeats a run."""
        rows = {"run.output_step": float(settings["run.duration"]) / 2.0}
        every = {**self._unlike, **settings, **rows}
        words = (f"--set {key}={_typed(value)}" for key, value in every.items())
        return f"cosim run {self._asked} {' '.join(words)}"


def _typed(value: float | int | str) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value}"
