"""Runs of a machine: the goals that they score, and the limits of coil and amplifier."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Outcome
from cosim.scene import Scene, changed
from cosim.scene.tables import KNOBS
from cosim.search.known import Evaluate, Feasible
from cosim.search.turns import turned
from cosim.studies.limits.changes import FREE, SMOOTH, Machine, Settings

SETTLE, SPAN = 0.6, 0.6
"""s, left out of averages and averaged over, at least, where many settings are searched."""

OPA548_CURRENT = 5.0
"""A: the OPA548's peak current (data sheet SBOS070D)."""


@dataclass(frozen=True)
class Goal:
    """A number of a run's summary that is to be maximised."""

    name: str
    title: str
    unit: str
    """Unit in tables and figures."""
    scale: float
    """Factor from SI to this unit."""
    of: Callable[[Mapping[str, float]], float]
    """The number from those of the summary, SI."""


GOALS = (
    Goal("v_up", "mean velocity upwards", "mm/s", 1e3, lambda told: told["v_average"]),
    Goal("v_down", "mean velocity downwards", "mm/s", 1e3, lambda told: -told["v_average"]),
    Goal(
        "a_camera", "downward acceleration, as a camera reads it", "m/s²", 1.0,
        lambda told: -told["a_camera_min"],
    ),
)  # fmt: skip

NEEDED = ("v_average", "a_camera_min", "current_max", "current_min", "coil_heat")
"""The numbers of a summary that goals and limits need."""


def scored(outcome: Outcome) -> list[float]:
    """The score of each of GOALS, SI; -inf where the run failed or has no such number."""
    if outcome.failure:
        return [-np.inf] * len(GOALS)
    found = np.array([goal.of(outcome.numbers) for goal in GOALS])
    return np.where(np.isnan(found), -np.inf, found).tolist()


def around(point: Array) -> Array:
    """A point of a machine's cube, then all turns of its knobs (rows)."""
    return turned(point, len(KNOBS))


@dataclass(frozen=True)
class Bench:
    """Runs machines that are changes of ``scene``, the device on a rig."""

    scene: Scene
    evaluator: Evaluator
    only: int | None = None
    """Index of the only goal that is scored, so that no other one is searched; None: all."""

    @staticmethod
    def base(scene: Scene, rig: Settings, told: str) -> Scene:
        """A scene with its knobs free, on a rig; messages name it ``told``. Raises BadInput."""
        return changed(scene, FREE | SMOOTH | {"circuit.model": "limited"} | rig, told)

    def outcomes(self, groups: Sequence[Sequence[Settings]]) -> list[list[Outcome]]:
        """The outcomes of groups of settings, all run at once."""
        found = dict(self.evaluator.groups(groups))
        return [found[number] for number in range(len(groups))]

    def feasible(self, machine: Machine, outcome: Outcome) -> bool:
        """Whether a run stays within the machine's heat and the power amplifier's peak current."""
        if outcome.failure:
            return False
        told = outcome.numbers
        peak = max(told["current_max"], -told["current_min"]) * self.scene.coil.count
        return peak <= OPA548_CURRENT and told["coil_heat"] <= machine.heat

    def once(self, machine: Machine) -> Evaluate:
        """Scores of points of the machine's cube, each in one run."""
        return self._scores(machine, lambda point: point[np.newaxis])

    def over_turns(self, machine: Machine) -> Evaluate:
        """Medians of the scores over the turns of the knobs about points of the machine's cube.
        Only the point itself must be feasible, not its turns: a hand that is off turns back."""
        return self._scores(machine, around)

    def _scores(self, machine: Machine, neighbours: Callable[[Array], Array]) -> Evaluate:
        """Medians of the scores over the ``neighbours`` (rows) of a point, itself the first."""
        settings_at = self._scout(machine)

        def evaluate(points: Array) -> tuple[Array, Feasible]:
            runs = [[settings_at(one) for one in neighbours(point)] for point in points]
            groups = self.outcomes(runs)
            allowed = np.array([self.feasible(machine, group[0]) for group in groups], bool)
            # points × neighbours × goals, reduced to points × goals: a median, since a single turn
            # may fall out of the motion's mode.
            scores = np.median([[*map(scored, group)] for group in groups], axis=1)
            if self.only is not None:
                scores[:, np.arange(len(GOALS)) != self.only] = -np.inf
            return scores, allowed

        return evaluate

    def _scout(self, machine: Machine) -> Callable[[Array], Settings]:
        """A function from a point to its settings, with the fast solver if it can run them."""
        solver = "fast"
        try:
            middle = machine.at(np.full(machine.keys, 0.5), SETTLE, SPAN)
            changed(self.scene, middle | {"run.solver": solver}, solver)
        except BadInput:
            solver = "fmu"
        return lambda point: machine.at(point, SETTLE, SPAN) | {"run.solver": solver}


def command(asked: Sequence[str], scene: Scene, settings: Settings) -> str:
    """The `cosim run` command that repeats a run; ``asked`` are the words that give ``scene``."""
    rows = {"run.output_step": float(settings["run.duration"]) / 2.0}
    own = {key: value for key, value in SMOOTH.items() if scene.value(key) != value}
    return shlex.join(["cosim", "run", *asked, *sets(own | settings | rows)])


def sets(settings: Settings) -> list[str]:
    """The options ``--set`` that give these values."""
    return [word for key, value in settings.items() for word in ("--set", f"{key}={_typed(value)}")]


def _typed(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
