"""Tunes a scene: searches its settings, then turns each key a little from the best ones."""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.heat import DRIVE_RANGE_HEAT, LIFT, heat_limit
from cosim.errors import BadInput, Note, SimulationFailed, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.keys import FREQUENCIES, numeric_key, refuse_unknown
from cosim.evaluate.point import Number, Outcome, Settings, moved
from cosim.scene import Overrides, Scene, changed, firmware, load
from cosim.scene.messages import bad, check_whole, shown, suggestion
from cosim.scene.tables import COMMANDS, MOST_CORNERS
from cosim.search.known import Feasible, Known
from cosim.search.searches import POPULATION, Climb, Design
from cosim.search.turns import TURN, faces, turned
from cosim.simulation.checks import motion
from cosim.simulation.fidelity import Fidelity
from cosim.studies.study import check_seed
from cosim.studies.tune.found import Aim, Run, Tuning, write_runs
from cosim.typed import typed
from cosim.waveforms.quantities import SUMMARY, UNITLESS

KNOBS: dict[str, tuple[float, float]] = {
    f"drive.{knob}": (0.0, 1.0) for knob in ("pot_max", "pot_frequency", "pot_offset")
}
"""The keys that are tuned by default: the three potentiometers, from end to end."""

SEARCHED = 0.93
"""Largest share of the budget for the search; the rest turns the keys of its best point."""

EXPLORED = 0.4
"""Share of the search's runs that a Sobol sequence takes before CMA-ES starts."""

STORE = "tune.sqlite"

FEWEST_RUNS, MOST_RUNS = 20, 1_000_000
"""Bounds of the budget; for each key two more are needed than FEWEST_RUNS."""

SCOUTS = 5
"""Preceding runs without ngspice for each run of the search with it; about ten times cheaper."""

WARM, WARM_APART = 25, 0.02
"""Number of the best preceding points that are run again on the judging model, and their least
distance as a share of the ranges."""

TABLES = ("steps", "pieces")
"""Waveforms with a table of levels."""

FINE = 10**9
"""Steps to which a key's range is rounded: points that round alike are run once."""


@typed
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
    waveform: str | Sequence[str] = (),
    polarity: bool = False,
    robust: bool = False,
    heat: float | str | None = None,
    progress: Callable[[Run, Run | None], None] = lambda run, best: None,
    scouting: Callable[[Run, Run | None], None] = lambda run, best: None,
) -> Tuning:
    """Search a scene for the largest, or the least, of a number of its summary in ``budget`` runs.

    ``maximise`` or ``minimise`` names the number; ``over`` gives the range of each ``table.key``,
    SI; by default the three knobs. Where the scene needs ngspice, a search with SCOUTS times as
    many runs on the rung "limited" precedes and gives the start points. The scene's own setting is
    run first, where the ranges hold it, so that the result is no worse. Where its solver is the
    fast one, that one searches, and the FMU runs the best WARM points and all later ones. After the
    search each key of the best point is turned a little; a turn that is better becomes the best
    point, as long as the budget lasts. Results depend on ``seed``, not on the number of
    ``workers``, local ones or those of the cluster at the address ``dask``. ``progress`` is given
    each run and the best so far, as they finish, ``scouting`` each run of the preceding search.
    Where the frequency is tuned, each run lasts whole periods.

    Each ``waveform``, named as for :func:`family`, is searched by itself over the keys, the numbers
    of its shape, and both polarities of the coil if ``polarity``. The best waveform's search is
    returned; its ``others`` are the rest. The value of a setting in a ``robust`` search is the
    median over all turns of the keys of ``over``, or the worst of them where their signs differ.
    Settings that make more ``heat`` in a coil than :func:`most_heat` gives count as failed.

    Of what comes back ``best.value`` is the number and ``best.values`` the keys' values, SI, and
    ``scene`` is the scene with these. In the folder ``out`` it leaves what ``Tuning.save`` writes,
    and resumes an interrupted search.

    Raises BadInput for bad keys, ranges, quantities; SimulationFailed if all runs failed.
    """
    quantity, largest = maximise or minimise, minimise is None
    if not isinstance(quantity, str) or (maximise and minimise):
        words = "must name a number of the summary, such as v_average"
        raise BadInput(f"tune: either maximise or minimise {words}.")
    scene = load(scene, overrides)
    if scene.has_ports and quantity in SUMMARY and SUMMARY[quantity].unit not in UNITLESS:
        words = "as a scene with ports has NAME.mean, .rms, .least and .greatest of each signal"
        raise scene.bad(f"{quantity} is not a number of its summary, {words}.")
    check_seed(seed)
    shaped = waveform or scene.drive.waveform in COMMANDS
    unheard = scene.has_ports and scene.period == inf  # no port reads the drive
    if not over and (unheard or not (shaped and scene.rung.driven)):
        key = "circuit.model" if shaped else "drive.waveform"
        still = scene.circuit.model if shaped else scene.drive.waveform
        why = 'without a [[port]] from = "drive" it' if unheard else f'{key} = "{still}"'
        raise scene.bad(f"{why} has no knobs; name what to tune with --over table.key=low:high.")
    keys = _checked(over or KNOBS)
    refuse_unknown(scene, keys)
    most = most_heat(scene, heat)
    both = {"coil.polarity": (-1.0, 1.0)} if polarity else {}
    names = [*filter(None, [waveform])] if isinstance(waveform, str) else waveform
    families = {name: family(name) for name in names} or {"": ({}, {})}
    scenes = {name: changed(scene, at, "--waveform") for name, (at, _) in families.items()}
    least = FEWEST_RUNS + 2 * max(len({**keys, **both, **own}) for _, own in families.values())
    check_whole("--budget", budget, least, MOST_RUNS, ", for these keys,")
    whole = any(key in FREQUENCIES for key in keys)
    judge = {"run.solver": "fmu"} if scene.run.solver == "fast" else {}
    tunings, made = list[Tuning](), list[Run]()

    def report(run: Run, best: Run | None) -> None:
        made.append(run)
        progress(run, best)

    path = None if out is None else Path(out) / STORE
    with Evaluator(scene, path, whole_periods=whole, workers=workers, dask=dask) as bench:
        try:
            for name, (shape, own) in families.items():
                ranges, turns = {**keys, **both, **own}, len(keys) if robust else 0
                aim = Aim(quantity, largest, ranges, most, seed, name, turns)
                trial = _Trial(aim, bench, scenes[name], shape, judge, report)
                try:
                    tunings.append(_searched(trial, budget, whole, scouting))
                except SimulationFailed as error:
                    if name == [*families][-1] and not tunings:
                        raise
                    warnings.warn(f"{name}: {error}", Note, stacklevel=3)
        except KeyboardInterrupt:
            if out is not None:
                write_runs(Path(out) / "tune.csv", made, quantity)
            raise
        except BadInput:
            if not bench.resumed:
                bench.forget()  # a refused call leaves nothing to resume
            raise
        tunings.sort(key=lambda tuning: tuning.value, reverse=largest)
        kind = motion(tunings[0].scene, lambda time: None)
        found = replace(tunings[0], motion=kind, others=tuple(tunings[1:]))
        if out is not None:
            found.save(out)
            bench.forget()
    return found


def family(name: str) -> tuple[dict[str, Any], dict[str, tuple[float, float]]]:
    """Values of keys that give a scene the waveform ``name``, and the ranges of the numbers of its
    shape: N levels at even phases of "steps:N" and "pieces:N", the duty of "square". BadInput."""
    shape, _, count = name.partition(":")
    sharp = {"drive.waveform": shape, "drive.reset_time": 0.0, "drive.duty": 0.5}
    few = count.isdecimal() and len(count) < 4
    if shape in TABLES and few and 2 <= int(count) <= MOST_CORNERS:
        phases = [k / int(count) for k in range(int(count))]
        levels = {f"drive.table.{k + 1}": (-0.5, 0.5) for k in range(len(phases))}
        return sharp | {"drive.table": [[phase, 0.5 - phase] for phase in phases]}, levels
    if name not in COMMANDS or name in TABLES:
        alone = ", ".join(each for each in COMMANDS if each not in TABLES)
        raise BadInput(
            f"--waveform {plain(name)}: must be one of {alone}, steps:N and pieces:N with N from "
            f"2 to {MOST_CORNERS}."
        )
    return sharp | {"drive.table": None}, {"drive.duty": (0.02, 0.98)} if name == "square" else {}


def most_heat(scene: Scene, limit: float | str | None) -> float:
    """The limit of the heat in a coil, W, from a number in W, "K:DUTY" or "K:DUTY:SECONDS"
    (K, 1, s). None means that of the Carlton's range of drives in a scene with such an actuator,
    else no limit. Raises BadInput."""
    if limit is None:
        return DRIVE_RANGE_HEAT if scene.mechanics.free_ram else float("inf")
    try:
        watts, *cycle = (float(part) for part in str(limit).split(":"))
        found = heat_limit(scene.coil, watts, *cycle) if cycle else watts
    except BadInput as error:
        raise BadInput(f"--heat {plain(limit)}: {error}") from None
    except (ValueError, TypeError):
        found = float("nan")
    if not found > 0.0:
        raise BadInput(
            f"--heat {plain(limit)}: must be a number above 0 W, or K:DUTY or "
            f"K:DUTY:SECONDS, a rise in K (without a time: {LIFT:g} s)."
        )
    return found


def _checked(over: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    for name, ends in over.items():
        key = numeric_key(str(name))
        try:
            low, high = ends
            sound = key.holds(low) and key.holds(high) and low < high
        except (TypeError, ValueError):  # not two, or no numbers
            sound = False
        if not sound:
            words = f"must be LOW and HIGH, LOW below HIGH, each {key.allowed}"
            raise BadInput(f"--over {name}: {shown(ends)} {words}.")
    return dict(over)


Progress = Callable[[Run, Run | None], None]


@dataclass(eq=False)
class _Trial:
    """A search with one solver and one circuit model."""

    aim: Aim
    bench: Evaluator
    scene: Scene
    """With the waveform that is searched."""
    shape: Mapping[str, Any]
    """Settings that give the evaluator's scene this waveform."""
    circuit: Settings
    """Settings that select the circuit model, or the FMU as the solver; empty: the scene's own."""
    progress: Progress

    def __post_init__(self) -> None:
        self.runs: list[Run] = []
        """The run of each row of ``known.points``."""
        self.known = Known(len(self.aim.ranges), 1, FINE, self._run)

    @property
    def best(self) -> Run | None:
        """The first of the best runs."""
        found = self.known.scores[: len(self.runs), 0]
        return self.runs[int(found.argmax())] if len(found) and found.max() > -inf else None

    def search(self, runs: int, warm: Array) -> None:
        """Run at most ``runs`` points; ``warm`` (rows) come first and replace most exploration."""
        keys, seed, explored = len(self.aim.ranges), self.aim.seed, round(EXPLORED * runs)
        self.known.rows(warm[:explored])
        explored = max(explored, len(self.runs) + POPULATION)
        design = Design(keys, explored, seed)
        self.known.search({0: design}, explored - len(self.runs))
        self.known.search({0: Climb(keys, seed)}, runs - len(self.runs))

    def own(self) -> Array:
        """The scene's own setting as a point of the unit cube (one row), its drive by the nearest
        turns of the knobs; no row where it lies beyond the ranges or a key has no value."""
        drive = self.scene.drive
        knobs = firmware.knobs(drive.amplitude, drive.frequency, drive.offset)
        point = []
        for name, (low, high) in self.aim.ranges.items():
            table, _, bare = name.partition(".")
            value = getattr(getattr(self.scene, table), bare, None)
            value = knobs.get(bare) if value is None else value
            if value is None or not low <= value <= high:
                return np.empty((0, len(self.aim.ranges)))
            point.append((value - low) / (high - low))
        return np.array([point])

    def neighbours(self) -> dict[str, list[float | None]]:
        """The values with each key turned down and up from the best point; None if out of range."""
        keys = list(self.aim.ranges)
        best = self.known.points[int(self.known.scores[:, 0].argmax())]
        # 2 n rows: all keys turned up one by one, then down; those beyond an end are clipped to it.
        turns = faces(best)
        inside = np.isclose(np.abs(turns - best).max(axis=1), TURN)
        rows = iter(self.known.rows(turns[inside]))
        values = [self.runs[next(rows)].value if known else None for known in inside]
        return {key: [values[len(keys) + k], values[k]] for k, key in enumerate(keys)}

    def _run(self, points: Array) -> tuple[Array, Feasible]:
        """Scores (points × 1) and feasibility of points (rows). Each point is a group of settings:
        its own, then its turns; groups are judged as they complete, and kept in order."""
        each = [
            [self._settings(near.tolist()) for near in turned(point, self.aim.turned)]
            for point in points
        ]
        asked = [[{**self.shape, **self.circuit, **one} for one in around] for around in each]
        found: dict[int, Run] = {}
        for number, outcomes in self.bench.groups(asked):
            found[number] = self._judged(each[number][0], outcomes)
            self.progress(found[number], self.best)
        runs = [found[number] for number in range(len(points))]
        self.runs += runs
        scores = np.array([[self._score(run.value)] for run in runs])
        return scores, np.isfinite(scores[:, 0])

    def _judged(self, settings: dict[str, Number], outcomes: Sequence[Outcome]) -> Run:
        """The run of a setting, from its own outcome (the first) and those of its turns. The heat
        limit applies to its own only, as an operator who is off turns the knob back."""
        own, most = outcomes[0], self.aim.heat
        if (heat := own.numbers.get("coil_heat", 0.0)) > most:
            words = f"the heat of {heat:.3g} W in a coil is above --heat, {most:.3g} W"
            own = replace(own, failure=words)
            return Run(settings, own, None)
        values = [value for each in outcomes if (value := self._value(each)) is not None]
        if len(values) < len(outcomes):
            return Run(settings, own, None)
        alike = min(values) > 0.0 or max(values) < 0.0
        value = float(np.median(values)) if alike else min(values, key=self._score)
        return Run(settings, own, value)

    def _settings(self, point: Sequence[float]) -> dict[str, Number]:
        """The keys' values at a point of the unit cube."""
        settings: dict[str, Number] = {}
        for (name, (low, high)), share in zip(self.aim.ranges.items(), point, strict=True):
            value = min(max(low + share * (high - low), low), high)
            key = numeric_key(name)
            if key.choices:
                value = min(map(int, key.choices), key=lambda choice: abs(choice - value))
            settings[name] = round(value) if key.kind is int else value
        return settings

    def _value(self, outcome: Outcome) -> float | None:
        if outcome.failure:
            return None
        if self.aim.quantity not in outcome.numbers:
            asked, names = self.aim.quantity, ", ".join(outcome.numbers)
            hint = suggestion(asked, outcome.numbers) or f" ({names})"
            raise bad(f"{plain(asked)} is not a number of this scene's summary{hint}")
        value = outcome.numbers[self.aim.quantity]
        return value if isfinite(value) else None

    def _score(self, value: float | None) -> float:
        if value is None:
            return -inf
        return value if self.aim.largest else -value


def _searched(trial: _Trial, budget: int, whole_periods: bool, scouting: Progress) -> Tuning:
    """The result of a search, with a cheaper one before it where there is a simpler model."""
    aim = trial.aim
    faces_each = 2 * len(aim.ranges)
    searched = min(round(SEARCHED * budget), budget - faces_each)
    ahead: list[Run] = []
    warm = trial.own()
    fast = trial.scene.run.solver == "fast"
    circuit = {} if fast else Fidelity.of(trial.scene).simple
    if circuit is not None:
        # BadInput: the simple model's summary lacks the quantity, so no search precedes.
        with nullcontext() if fast else suppress(BadInput):
            scouts = replace(trial, circuit=circuit, progress=scouting)
            scouts.search((1 if fast else SCOUTS) * searched, warm)
            ahead = scouts.runs
            warm = np.vstack([warm, scouts.known.ranked(0, WARM_APART, WARM)])
    if fast:
        trial.known.rows(warm)  # with the FMU; the fast solver has used the search's runs
    else:
        trial.search(searched, warm)
    if trial.best is None:
        failures = [run.outcome.failure for run in trial.runs or ahead]
        if not any(failures):  # as the peak of an acceleration at a rigid wall
            raise trial.scene.bad(f"{aim.quantity} has no value at any setting that was run.")
        first = next(filter(None, failures))
        raise SimulationFailed(f"No setting could be run; the first one: {first}")
    best, neighbours = trial.best, trial.neighbours()
    # A turn that is better becomes the best run; its own turns are run while the budget lasts.
    while trial.best is not best and len(trial.runs) + faces_each <= budget:
        best, neighbours = trial.best, trial.neighbours()
    scene = moved(trial.scene, {**trial.best.values, **trial.circuit}, whole_periods)
    by_fast = (run.value for run in ahead if fast and run.values == trial.best.values)
    return Tuning(
        **vars(aim),
        runs=trial.runs,
        best=trial.best,
        neighbours=neighbours if trial.best is best else {},
        scene=scene,
        scouts=len(ahead),
        by_fast=next(by_fast, None),
    )
