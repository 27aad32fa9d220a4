"""``cosim bench``: speed ratios of the rungs, measured in turns in one run.

An absolute time means nothing on another machine. So the compared calls take turns, and ratios are
formed round by round, in which changes of the machine's speed cancel. The errors of the rungs at
these speeds are in ``cosim chart ladder`` and ``accuracy``.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from math import inf
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

from cosim.files.atomic import write_json
from cosim.scene import load
from cosim.scene.rungs import LADDER
from cosim.simulation.simulate import simulate
from cosim.studies.report import Row, machine, markdown
from cosim.toolchain.libraries import compiled
from cosim.toolchain.processes import in_place
from cosim.typed import typed

BRIEF_FULL = ("circuit.model=full", "run.duration=0.1", "run.settle=0.05")
"""Settings that shorten the scene `reference` for the rung `full`, which is thirty times slower."""

LONG_PART = ("run.duration=100", "run.output_step=1e-2")
"""Settings of a run so long, with so few rows, that starting and writing cost almost nothing."""

TITLES = {
    "real_time": "Simulated seconds per second of one core",
    "over_amplifier": "The same, over that of the rung amplifier",
}

Targets = dict[str, tuple[float, float]]
"""Bounds of the median of a number, by its dotted name."""

TARGETS: Targets = {
    "real_time.amplifier": (3.0, inf),
    "real_time.limited": (30.0, inf),
    "real_time.ideal": (60.0, inf),
    "real_time.part": (5000.0, inf),
}


@dataclass(frozen=True, repr=False)
class Bench:
    """The measured ``numbers``, as ``bench.json`` holds them."""

    numbers: dict[str, Any]

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``bench.json``."""
        write_json(Path(folder) / "bench.json", self.numbers)

    def __repr__(self) -> str:
        return table(self.numbers, TITLES)


@typed
def bench(*, quick: bool = False) -> Bench:
    """Speed ratios of this machine, each with its target.

    A ``quick`` bench takes fewer rounds and shorter runs. Of what comes back ``numbers`` is what
    ``bench.json`` holds: ``real_time``, simulated seconds per second of one core by rung and of the
    mechanics alone (``part``), and ``over_amplifier``, the same over that of the rung amplifier,
    each with ``median``, ``low`` and ``high``, some with a ``target`` and whether it ``holds``.
    """
    with in_place():  # no child processes: their CPU time would be missing
        return Bench(judged(measure(quick), TARGETS))


def measure(quick: bool) -> dict[str, Any]:
    """All numbers: each ratio's median, least (``low``) and greatest (``high``) over the rounds."""
    host = {name: machine()[name] for name in ("processor", "cores", "python")}
    host |= {"compiler": compiler_version()}
    return {**real_time(3 if quick else 11), "quick": quick, "machine": host}


def compiler_version() -> str:
    """The C compiler that built the FMU: the first line of its version."""
    return json.loads(compiled("build.json").read_text())["compiler"]


def real_time(rounds: int) -> dict[str, Any]:
    """Simulated seconds per CPU second of whole runs of each rung, and their ratios."""
    scenes = {
        model: load("reference", BRIEF_FULL if model == "full" else {"circuit.model": model})
        for model in reversed(LADDER)
    } | {"part": load("optimal", LONG_PART)}
    taken = take_turns({name: partial(simulate, scene) for name, scene in scenes.items()}, rounds)
    speeds = {
        name: [scene.run.duration / seconds for seconds in taken[name]]
        for name, scene in scenes.items()
    }
    others = [model for model in LADDER if model != "amplifier"]
    return {
        "real_time": {name: spread(found) for name, found in speeds.items()},
        "over_amplifier": {name: ratios(speeds[name], speeds["amplifier"]) for name in others},
    }


def take_turns(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """CPU seconds of each call in each round; a first round, which warms up, is not counted."""
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(rounds + 1):
        for name, call in calls.items():
            seconds = cpu(call)
            if turn:  # round 0 warms up
                taken[name].append(seconds)
    return taken


def cpu(call: Callable[[], object]) -> float:
    """CPU seconds of this process that a call takes."""
    began = process_time()
    call()
    return process_time() - began


def spread(values: Sequence[float]) -> dict[str, float]:
    """Median, ``low`` and ``high``."""
    return {"median": median(values), "low": min(values), "high": max(values)}


def ratios(over: Sequence[float], under: Sequence[float]) -> dict[str, float]:
    """The spread of the ratios ``over``/``under``, formed round by round."""
    return spread([a / b for a, b in zip(over, under, strict=True)])


def judged(numbers: dict[str, Any], targets: Targets) -> dict[str, Any]:
    """The numbers, with ``target`` and ``holds`` (is the median within it?) where there is one."""
    for name, found in _spreads(numbers):
        if name in targets:
            low, high = targets[name]
            one_sided = f"<= {high:g}" if low == -inf else f">= {low:g}"
            found["target"] = one_sided if inf in (-low, high) else f"{low:g} ... {high:g}"
            found["holds"] = low <= found["median"] <= high
    return numbers


def table(numbers: dict[str, Any], titles: Mapping[str, str]) -> str:
    """The printed text: a table for each group of numbers."""
    host = numbers["machine"]
    lines = [f"{host['processor']}, {host['cores']} cores, Python {host['python']}"]
    for group, entries in groupby(_spreads(numbers), lambda entry: entry[0].partition(".")[0]):
        rows = [_row(name.partition(".")[2], found) for name, found in entries]
        lines += ["", f"{titles[group]}:", *markdown(rows)]
    return "\n".join(lines)


def _spreads(numbers: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each innermost dictionary with a median, and its dotted name."""
    for name, value in numbers.items():
        if isinstance(value, dict) and "median" in value:
            yield name, value
        elif isinstance(value, dict):
            yield from ((f"{name}.{key}", found) for key, found in _spreads(value))


def _row(name: str, found: dict[str, Any]) -> Row:
    row: Row = {"": name} | {head: found[head] for head in ("median", "low", "high")}
    row |= {"error": found.get("error"), "theirs": found.get("error_of_peer"), "target": None}
    if "target" in found:
        row["target"] = f"{found['target']}: {'holds' if found['holds'] else 'MISSED'}"
    return row
