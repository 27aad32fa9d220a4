"""One point of a study: the scene with some keys changed, run for the numbers of its summary."""

import hashlib
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isfinite, isinf, nan
from pathlib import Path
from typing import Any

from cosim.circuit.lint.deck import named as netlist_files
from cosim.errors import CosimError
from cosim.scene import Scene, changed
from cosim.scene.model import periods_for
from cosim.toolchain.processes import TRIES
from cosim.toolchain.threads import Progress
from cosim.toolchain.worker import ProcessLost

Number = float | int
Settings = Mapping[str, Number | str]
"""``table.key`` and value, SI."""

UNREPEATABLE = ("wall_time",)
"""Numbers of a summary that differ from run to run of the same scene."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a point: the numbers of its summary (SI; NaN: no value), or its failure."""

    numbers: dict[str, float]
    failure: str = ""
    machine: bool = False
    """Whether the machine, not the point, may have caused the failure: worth another try."""

    def only(self, names: Collection[str]) -> "Outcome":
        """This outcome with some of its numbers only."""
        kept = {name: value for name, value in self.numbers.items() if name in names}
        return replace(self, numbers=kept)


def evaluate(
    base: Scene, values: Settings, whole_periods: bool, progress: Progress = lambda _: None
) -> Outcome:
    """Run ``base`` with ``values``. A failure is an outcome, too.

    Waveforms are not made: the rows of a run are communication points too, so the numbers agree
    with those of `cosim run` within rounding, and the run is several times as fast.
    """
    from cosim.simulation.simulate import summary

    found = Outcome({})
    for _ in range(TRIES):
        try:
            return outcome(summary(point(base, values, whole_periods), progress))
        except CosimError as error:
            found = failed(error)
            if not isinstance(error, ProcessLost):
                break
    return found


def evaluate_all(
    base: Scene,
    points: Sequence[tuple[str, Settings]],
    progress: Progress = lambda _: None,
    *,
    whole_periods: bool,
) -> list[Outcome]:
    """Run several points (key, values), side by side if the fast solver runs all of them."""
    if not all(is_fast(base, values) for _, values in points):
        return [evaluate(base, values, whole_periods, progress) for _, values in points]
    from cosim.simulation.fast import LOST, summaries

    outcomes: list[Outcome] = [Outcome({})] * len(points)
    scenes: dict[int, Scene] = {}
    for place, (_, values) in enumerate(points):
        try:
            scenes[place] = point(base, values, whole_periods)
        except CosimError as error:
            outcomes[place] = failed(error)
    for place, found in zip(scenes, summaries([*scenes.values()]), strict=True):
        outcomes[place] = outcome(found) if isfinite(found["v_average"]) else Outcome({}, LOST)
    return outcomes


def is_fast(base: Scene, values: Settings) -> bool:
    """Whether the fast solver runs a point."""
    return values.get("run.solver", base.run.solver) == "fast"


def point(base: Scene, values: Settings, whole_periods: bool) -> Scene:
    """The scene of a point. Raises BadInput."""
    given = "run.output_step" in values
    few_rows = float(values.get("run.duration", base.run.duration)) / 2.0
    if few_rows != base.run.output_step:
        values = {"run.output_step": few_rows, **values}
    scene = moved(base, values, whole_periods)
    if given or not whole_periods:
        return scene
    # Whole periods end elsewhere, and the last row is to be the end, which at_wall is about.
    return scene.having(run={"output_step": scene.run.duration / 2.0})


def moved(base: Scene, values: Settings, whole_periods: bool) -> Scene:
    """The scene with other values; in whole periods, it settles no shorter than ``base`` unless its
    duration is another. Raises BadInput."""
    if whole_periods and "run.duration" not in values:
        values = {"run.settle": base.run.settle, **values}
    scene = changed(base, values, "--over")
    return in_whole_periods(scene) if whole_periods else scene


def inputs(scene: Scene) -> dict[str, Any]:
    """All inputs of a run: the scene's keys, hashes of the files that keys and netlist name."""
    files = [Path(file) for file in scene.files.values()]
    if netlist := scene.circuit.netlist:
        files += netlist_files(Path(netlist))[1:]
    every = [one for file in files for one in (file.rglob("*") if file.is_dir() else [file])]
    hashes = {}
    for path in every:
        with suppress(OSError):  # the runs report it
            if path.is_file():
                with path.open("rb") as file:
                    hashes[str(path)] = hashlib.file_digest(file, "sha256").hexdigest()
    return scene.as_dict() | {"files": hashes}


def outcome(summary: Mapping[str, Any]) -> Outcome:
    """The numbers of a summary."""
    numbers = {
        name: nan if value is None else float(value)
        for name, value in summary.items()
        if name not in UNREPEATABLE and (value is None or isinstance(value, int | float))
    }
    return Outcome(numbers)


def failed(error: Exception) -> Outcome:
    """The outcome of a point that raised ``error``."""
    # An exception other than CosimError is a defect: its type is named, the other points go on.
    kind = "" if isinstance(error, CosimError) else f"{type(error).__name__}: "
    met = MemoryError | OSError | ProcessLost
    machine = any(isinstance(e, met) for e in (error, error.__cause__))
    return Outcome({}, " ".join(f"{kind}{error}".split()), machine)


def outcome_of(record: Any) -> Outcome | None:
    """The outcome from a ``record`` of JSON; None if it is invalid, or a failure of the machine."""
    try:
        numbers, failure, machine = record["numbers"], record["failure"], record["machine"]
        named = all(name.isprintable() and 0 < len(name) < 300 for name in numbers)
        values = [float(value) for value in numbers.values() if type(value) in (int, float)]
    except (TypeError, KeyError, AttributeError, OverflowError):
        return None
    told = type(failure) is str and failure.isprintable() and machine is False
    if not (named and told and len(values) == len(numbers)):
        return None
    return Outcome(dict(zip(numbers, values, strict=True)), failure)


def in_whole_periods(scene: Scene) -> Scene:
    """The scene with ``run.settle`` and ``run.duration`` at least as long and whole periods apart.

    The mean over a fraction of a period is wrong by per cents that vary with the frequency. Scenes
    without a period stay as they are.
    """
    if isinf(length := scene.period):
        return scene
    times = scene.run.settle, scene.run.duration - scene.run.settle
    settle, span = periods_for(length, *times)
    return scene.having(run={"settle": settle * length, "duration": (settle + span) * length})
