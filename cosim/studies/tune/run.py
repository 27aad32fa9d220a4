"""Tunes a scene: searches its settings, then turns each key a little about the best."""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.evaluator import Evaluator, Settings
from cosim.evaluate.keys import FREQUENCIES, numeric_key
from cosim.evaluate.point import Number, Outcome, periods_made_whole
from cosim.files.picture import Picture
from cosim.scene import Scene, changed, load
from cosim.scene.loading import Overrides
from cosim.search.climb import POPULATION, Climb, apart
from cosim.simulation.choose_rung import WITHOUT_NGSPICE, without_ngspice
from cosim.studies.tune import files
from cosim.studies.tune.found import TURNS, Run, Search

FMU: Settings = {"run.solver": "fmu"}
"""What makes the scene one that the FMU solves."""

KNOBS: dict[str, tuple[float, float]] = {
    f"drive.{knob}": (0.0, 1.0) for knob in ("pot_max", "pot_frequency", "pot_offset")
}
"""What is tuned unless told otherwise: the three potentiometers, from end to end."""

SEARCHED = 0.93
"""Most that the search has of the runs; the rest turns one key after another about its best."""

STORE = "tune.sqlite"

FEWEST_RUNS = 20
"""Of the search."""

MOST_RUNS = 1_000_000

EXPLORED = 0.4
"""Share of the search's runs that listens to the whole range."""

IDLE = 50
"""Generations without a new point after which whole numbers leave no more to ask for."""

SCOUTS = 5
"""Runs without ngspice that go ahead of each run with it: some ten times cheaper each."""

HINTS, HINTS_APART = 25, 0.02
"""Best scouts that are run again with ngspice, and how far apart, as a share of the ranges."""


class Tuning(Search):
    """A finished search: ``best`` and ``runs``, and ``scene``, which is the one at the best."""

    def plot(self) -> Picture:
        """The path of the search, where it listened, and what a small turn costs."""
        from cosim.studies.tune import figure

        return figure.draw(self)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``tune.json``, ``tune.csv``, ``best.toml`` and ``figure.png``."""
        files.write(Path(folder), self)
        self.plot().write(Path(folder) / "figure.png")

    def __repr__(self) -> str:
        return files.table(self)


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
    searches, and the FMU judges the best HINTS and what follows. After the search each key is
    turned a little about the best, which moves on while that helps and the budget lasts. The same
    for the same ``seed``, whatever the number of ``workers``, local ones or those of the cluster at
    the address ``dask``. ``progress`` is told each run and the best so far,
    as they finish, ``scouting`` each one ahead. Where the frequency is tuned, each run lasts whole
    periods.

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
    turned = len(TURNS) * len(ranges)
    least = FEWEST_RUNS + turned
    if not least <= budget <= MOST_RUNS:
        raise BadInput(
            f"--budget {budget}: must be a whole number from {least}, for these keys, to "
            f"{MOST_RUNS}."
        )
    path = None if out is None else Path(out) / STORE
    whole_periods = any(key in FREQUENCIES for key in ranges)
    aim = quantity, largest, ranges, budget, seed, whole_periods
    with Evaluator(scene, path, whole_periods=whole_periods, workers=workers, dask=dask) as bench:
        try:
            found = _tuned(scene, *aim, bench, progress, scouting)
        except BadInput:
            if not bench.resumed:
                bench.forget()  # there is nothing to go on with
            raise
        if out is not None:
            found.save(out)
            bench.forget()
    return found


def _tuned(
    scene: Scene,
    quantity: str,
    largest: bool,
    ranges: dict[str, tuple[float, float]],
    budget: int,
    seed: int,
    whole_periods: bool,
    bench: Evaluator,
    progress: Callable[[Run, Run | None], None],
    scouting: Callable[[Run, Run | None], None],
) -> Tuning:
    turned = len(TURNS) * len(ranges)
    searched = min(round(SEARCHED * budget), budget - turned)
    scouts, hints = 0, np.empty((0, len(ranges)))
    # Quantities that only the scene's own rung has find no scouts.
    with suppress(BadInput):
        if without_ngspice(scene) is not None:
            trial = _Trial(bench, WITHOUT_NGSPICE, quantity, largest, ranges, scouting)
            trial.search(SCOUTS * searched, seed)
            ranked = trial.ranked()
            scouts, hints = len(trial.known), ranked[apart(ranked, HINTS_APART, HINTS)]
    scout, judge = None, {}
    if scene.run.solver == "fast":
        scout, judge = _Trial(bench, {}, quantity, largest, ranges, scouting), FMU
        scout.search(searched, seed)
        ranked = scout.ranked()
        scouts, hints = len(scout.known), ranked[apart(ranked, HINTS_APART, HINTS)]
    trial = _Trial(bench, judge, quantity, largest, ranges, progress)
    if scout is None:
        trial.search(searched, seed, hints)
    elif len(hints):
        trial.costs(hints)  # the FMU judges what the fast solver has found
    if trial.best is None:
        reason = next(iter((trial.known or (scout or trial).known).values())).outcome.failure
        raise SimulationFailed(f"No setting could be run; the first one: {reason}")
    best, neighbours = trial.best, _turned(trial, trial.best)
    while trial.best is not best and len(trial.known) + turned <= budget:
        best, neighbours = trial.best, _turned(trial, trial.best)
    if trial.best is not best:
        best, neighbours = trial.best, {}
    runs = list(trial.known.values())
    tuned = changed(scene, {**best.values, **judge}, "tune")
    if whole_periods:
        tuned = changed(tuned, periods_made_whole(tuned), "tune")
    found = quantity, largest, ranges, runs, best, neighbours, tuned, scouts, seed
    return Tuning(*found, None if scout is None else scout.value(best.values))


def _checked(over: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    for name, (low, high) in over.items():
        key = numeric_key(name)
        assert key.low is not None and key.high is not None
        if not (isfinite(low) and isfinite(high) and key.low <= low < high <= key.high):
            raise BadInput(f"--over {name}={low:g}:{high:g}: must be a range, of {key.allowed}.")
    return dict(over)


@dataclass
class _Trial:
    """Runs settings, each once, and remembers them in the order in which they were asked for."""

    bench: Evaluator
    circuit: Settings
    """What makes the scene one of the circuit that is run."""
    quantity: str
    largest: bool
    ranges: dict[str, tuple[float, float]]
    progress: Callable[[Run, Run | None], None]
    known: dict[tuple[float, ...], Run] = field(default_factory=dict)

    @property
    def best(self) -> Run | None:
        """The first of the best runs."""
        found = [run for run in self.known.values() if run.value is not None]
        return min(found, key=lambda run: self._cost(run.value), default=None)

    def value(self, settings: Mapping[str, Number]) -> float | None:
        """What was found at settings; None where they were not asked for."""
        found = (run.value for run in self.known.values() if run.values == settings)
        return next(found, None)

    def ranked(self) -> Array:
        """Points of the unit cube that have a value, the best first."""
        found = [place for place, run in self.known.items() if run.value is not None]
        found.sort(key=lambda place: self._cost(self.known[place].value))
        return np.array(found).reshape(-1, len(self.ranges))

    def search(self, runs: int, seed: int, hints: Array | None = None) -> None:
        """Ask for at most ``runs`` points; for ``hints`` (rows) first, in place of most of the
        exploration."""
        explored = round(EXPLORED * runs)
        hints = np.empty((0, len(self.ranges))) if hints is None else hints[:explored]
        climb = Climb(len(self.ranges), max(explored, len(hints) + POPULATION), seed)
        left, idle = runs, 0
        points = hints if len(hints) else climb.ask(left)
        while len(points) and idle < IDLE:
            found, taken = self.costs(points)
            climb.tell(points, found)
            left, idle = left - taken, 0 if taken else idle + 1
            points = climb.ask(left)

    def costs(self, points: Array) -> tuple[Array, int]:
        """The cost of each point of the unit cube (rows), and how many of them were run for it."""
        # The search comes back with what it has heard, but for rounding.
        places = [tuple(float(x) for x in np.round(row, 9)) for row in points]
        new = [place for place in dict.fromkeys(places) if place not in self.known]
        runs: dict[int, Run] = {}
        settings = [self.settings(place) for place in new]
        asked = ({**self.circuit, **values} for values in settings)
        for number, outcome in self.bench.run(enumerate(asked)):
            runs[number] = Run(settings[number], outcome, self._value(outcome))
            self.progress(runs[number], self.best)
        for number, place in enumerate(new):
            self.known[place] = runs[number]
        return np.array([self._cost(self.known[place].value) for place in places]), len(new)

    def settings(self, place: tuple[float, ...]) -> dict[str, Number]:
        """The keys' values at a point of the unit cube."""
        settings: dict[str, Number] = {}
        for (name, (low, high)), share in zip(self.ranges.items(), place, strict=True):
            value = min(max(low + share * (high - low), low), high)
            settings[name] = round(value) if numeric_key(name).kind is int else value
        return settings

    def _value(self, outcome: Outcome) -> float | None:
        if outcome.failure:
            return None
        if self.quantity not in outcome.numbers:
            names = ", ".join(outcome.numbers)
            raise BadInput(f"{self.quantity} is not a number of this scene's summary ({names}).")
        value = outcome.numbers[self.quantity]
        return value if isfinite(value) else None

    def _cost(self, value: float | None) -> float:
        if value is None:
            return inf
        return -value if self.largest else value


def _turned(trial: _Trial, best: Run) -> dict[str, list[float | None]]:
    """The value asked for with each key turned about the best."""
    place = next(place for place, run in trial.known.items() if run is best)
    found: dict[str, list[float | None]] = {}
    for k, key in enumerate(trial.ranges):
        row = [(*place[:k], round(place[k] + turn, 9), *place[k + 1 :]) for turn in TURNS]
        inside = [point for point in row if 0.0 <= point[k] <= 1.0]
        if inside:
            trial.costs(np.array(inside))
        found[key] = [trial.known[point].value if point in inside else None for point in row]
    return found
