"""Tunes a scene: searches its settings, then turns each key a little about the best."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.evaluator import Evaluator, Settings
from cosim.evaluate.keys import FREQUENCIES, numeric_key
from cosim.evaluate.point import Number, Outcome, periods_made_whole
from cosim.scene import Scene, changed, load
from cosim.scene.loading import Overrides
from cosim.search.climb import POPULATION, Climb
from cosim.search.design import Design
from cosim.search.known import Known
from cosim.search.protocol import Feasible
from cosim.search.turns import TURN, faces
from cosim.simulation.fidelity import Fidelity
from cosim.studies.tune.found import Run, Tuning, write_runs

KNOBS: dict[str, tuple[float, float]] = {
    f"drive.{knob}": (0.0, 1.0) for knob in ("pot_max", "pot_frequency", "pot_offset")
}
"""What is tuned unless told otherwise: the three potentiometers, from end to end."""

SEARCHED = 0.93
"""Most that the search has of the runs; the rest turns one key after another about its best."""

EXPLORED = 0.4
"""Share of the search's runs that fills the whole range, before it climbs."""

STORE = "tune.sqlite"

FEWEST_RUNS, MOST_RUNS = 20, 1_000_000
"""Of the search, and of all."""

SCOUTS = 5
"""Runs without ngspice that go ahead of each run with it: some ten times cheaper each."""

WARM, WARM_APART = 25, 0.02
"""Best scouts that are run again with ngspice, and how far apart, as a share of the ranges."""

FINE = 10**9
"""Steps of a key's range that are told apart."""


def tune(
    scene: Scene | str | os.PathLike[str],
    overrides: Overrides | None = None,
    *,
    maximise: str | None = None,
    minimise: str | None = None,
    over: Mapping[str, tuple[float, float]] | None = None,
    budget: int = 200,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[Run, Run | None], None] = lambda run, best: None,
    scouting: Callable[[Run, Run | None], None] = lambda run, best: None,
) -> Tuning:
    """Search a scene for the largest, or the least, of a number of its summary in ``budget`` runs.

    ``maximise`` or ``minimise`` names the number; ``over`` gives the range of each ``table.key``,
    SI; by default the three knobs. Where the scene needs ngspice, SCOUTS times as many runs on the
    rung "limited" look first where it is worth while. Where its solver is the fast one, that one
    searches, and the FMU judges the best WARM and what follows. After the search each key is turned
    a little about the best, which moves on while that helps and the budget lasts. The same for the
    same ``seed``, whatever the number of ``workers``, local ones or those of the cluster at the
    address ``dask``. ``progress`` is told each run and the best so far, as they finish,
    ``scouting`` each one ahead. Where the frequency is tuned, each run lasts whole periods.

    In the folder ``out`` it leaves what ``Tuning.save`` writes, and takes up what an interrupted
    search has left there.

    Raises BadInput for keys, ranges and quantities that are none; SimulationFailed where every run
    failed.
    """
    quantity, largest = maximise or minimise, minimise is None
    if quantity is None or (maximise and minimise):
        raise BadInput("tune: either maximise or minimise must name a number of the summary.")
    scene = load(scene, overrides)
    if seed < 0:
        raise BadInput(f"--seed {seed}: must be a whole number from 0.")
    if not over and scene.drive.waveform != "sawtooth":
        raise BadInput(
            f'scene {scene.name}: drive.waveform = "{scene.drive.waveform}" has no knobs; name '
            "what to tune with --over table.key=low:high."
        )
    ranges = _checked(over or KNOBS)
    turned = 2 * len(ranges)
    least = FEWEST_RUNS + turned
    if not least <= budget <= MOST_RUNS:
        raise BadInput(
            f"--budget {budget}: must be a whole number from {least}, for these keys, to "
            f"{MOST_RUNS}."
        )
    path = None if out is None else Path(out) / STORE
    whole_periods = any(key in FREQUENCIES for key in ranges)
    heard: list[Run] = []

    def told(run: Run, best: Run | None) -> None:
        heard.append(run)
        progress(run, best)

    with Evaluator(scene, path, whole_periods=whole_periods, workers=workers, dask=dask) as bench:
        try:
            aim = _Aim(bench, quantity, largest, ranges)
            best, neighbours, runs, ahead = _searched(aim, scene, budget, seed, told, scouting)
        except KeyboardInterrupt:
            if out is not None:
                write_runs(Path(out) / "tune.csv", heard, quantity)
            raise
        except BadInput:
            if not bench.resumed:
                bench.forget()  # there is nothing to go on with
            raise
        tuned = changed(scene, {**best.values, **_judge(scene)}, "tune")
        if whole_periods:
            tuned = changed(tuned, periods_made_whole(tuned), "tune")
        scouts, by_fast = 0 if ahead is None else len(ahead.runs), None
        if ahead is not None and _judge(scene):
            by_fast = ahead.value(best.values)
        found = Tuning(
            *(quantity, largest, ranges, runs, best, neighbours, tuned, scouts, seed, by_fast)
        )
        if out is not None:
            found.save(out)
            bench.forget()
    return found


def _checked(over: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    for name, (low, high) in over.items():
        key = numeric_key(name)
        assert key.low is not None and key.high is not None
        if not (isfinite(low) and isfinite(high) and key.low <= low < high <= key.high):
            raise BadInput(f"--over {name}={low:g}:{high:g}: must be a range, of {key.allowed}.")
    return dict(over)


@dataclass(frozen=True)
class _Aim:
    """What is run, and what for."""

    bench: Evaluator
    quantity: str
    largest: bool
    ranges: dict[str, tuple[float, float]]


Progress = Callable[[Run, Run | None], None]


def _judge(scene: Scene) -> Settings:
    """What makes of a scene the one whose numbers count: the FMU judges the fast solver."""
    return {"run.solver": "fmu"} if scene.run.solver == "fast" else {}


def _searched(
    aim: _Aim, scene: Scene, budget: int, seed: int, progress: Progress, scouting: Progress
) -> tuple[Run, dict[str, list[float | None]], list[Run], "_Trial | None"]:
    """The best run, its neighbours, all runs, and the scouts that went ahead."""
    turned = 2 * len(aim.ranges)
    searched = min(round(SEARCHED * budget), budget - turned)
    ahead, warm = None, np.empty((0, len(aim.ranges)))
    simple, judge = Fidelity.of(scene).simple, _judge(scene)
    if judge:
        ahead = _Trial(aim, {}, scouting)
        ahead.search(searched, seed)
    elif simple is not None:
        # Quantities that only the scene's own rung has find no scouts.
        with suppress(BadInput):
            scouts = _Trial(aim, simple, scouting)
            scouts.search(SCOUTS * searched, seed)
            ahead = scouts
    if ahead is not None:
        warm = ahead.known.ranked(0, WARM_APART, WARM)
    trial = _Trial(aim, judge, progress)
    if judge:
        trial.known.rows(warm)  # the search is over
    else:
        trial.search(searched, seed, warm)
    if trial.best is None:
        first = (trial.runs or (ahead or trial).runs)[0]
        raise SimulationFailed(f"No setting could be run; the first one: {first.outcome.failure}")
    best, neighbours = trial.best, trial.neighbours()
    while trial.best is not best and len(trial.runs) + turned <= budget:
        best, neighbours = trial.best, trial.neighbours()
    if trial.best is not best:
        best, neighbours = trial.best, {}
    return best, neighbours, trial.runs, ahead


class _Trial:
    """A search on one circuit model, which ``circuit`` makes of the scene."""

    def __init__(self, aim: _Aim, circuit: Settings, progress: Progress) -> None:
        self._aim, self._circuit, self._progress = aim, circuit, progress
        self.runs: list[Run] = []
        """In the order of the points that are known."""
        self.known = Known(len(aim.ranges), 1, FINE, self._run)

    @property
    def best(self) -> Run | None:
        """The first of the best runs."""
        found = self.known.scores[: len(self.runs), 0]
        return self.runs[int(found.argmax())] if len(found) and found.max() > -inf else None

    def value(self, settings: Mapping[str, Number]) -> float | None:
        """What was found at settings; None where they were not asked for."""
        return next((run.value for run in self.runs if run.values == settings), None)

    def search(self, runs: int, seed: int, warm: Array | None = None) -> None:
        """Run at most ``runs`` points; ``warm`` starts (rows) first, in place of most of the
        exploration."""
        keys, explored = len(self._aim.ranges), round(EXPLORED * runs)
        if warm is not None:
            self.known.rows(warm[:explored])
            explored = max(explored, len(self.runs) + POPULATION)
        design = Design(keys, explored, seed)
        self.known.search({0: design}, explored - len(self.runs))
        self.known.search({0: Climb(keys, seed)}, runs - len(self.runs))

    def neighbours(self) -> dict[str, list[float | None]]:
        """The value asked for with each key turned down and up from the best."""
        keys = list(self._aim.ranges)
        best = self.known.points[int(self.known.scores[:, 0].argmax())]
        turned = faces(best)
        off = np.abs(turned - best).max(axis=1)
        inside = np.isclose(off, TURN)
        rows = iter(self.known.rows(turned[inside]))
        values = [self.runs[next(rows)].value if there else None for there in inside]
        return {key: [values[len(keys) + k], values[k]] for k, key in enumerate(keys)}

    def _run(self, points: Array) -> tuple[Array, Feasible]:
        settings = [self._settings(point.tolist()) for point in points]
        found: dict[int, Run] = {}
        asked = ({**self._circuit, **values} for values in settings)
        for number, outcome in self._aim.bench.run(enumerate(asked)):
            found[number] = Run(settings[number], outcome, self._value(outcome))
            self._progress(found[number], self.best)
        runs = [found[number] for number in range(len(points))]
        self.runs += runs
        scores = np.array([[self._score(run.value)] for run in runs])
        return scores, np.isfinite(scores[:, 0])

    def _settings(self, point: Sequence[float]) -> dict[str, Number]:
        """The keys' values at a point of the unit cube."""
        settings: dict[str, Number] = {}
        for (name, (low, high)), share in zip(self._aim.ranges.items(), point, strict=True):
            value = min(max(low + share * (high - low), low), high)
            settings[name] = round(value) if numeric_key(name).kind is int else value
        return settings

    def _value(self, outcome: Outcome) -> float | None:
        if outcome.failure:
            return None
        if self._aim.quantity not in outcome.numbers:
            names = ", ".join(outcome.numbers)
            raise BadInput(
                f"{self._aim.quantity} is not a number of this scene's summary ({names})."
            )
        value = outcome.numbers[self._aim.quantity]
        return value if isfinite(value) else None

    def _score(self, value: float | None) -> float:
        if value is None:
            return -inf
        return value if self._aim.largest else -value
