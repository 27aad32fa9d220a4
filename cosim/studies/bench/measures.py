"""What the bench measures with: CPU times, and errors of the part's path in the scene `reference`.

Calls take turns, so that changes of the machine's speed cancel in ratios. Errors are those against
the monolithic reference solution (``reference.json``).
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate

BRIEF = ("run.duration=0.2", "run.settle=0.1")
"""Settings that make the scene `reference` as short as the path known of it."""

BRIEF_FULL = ("circuit.model=full", "run.duration=0.1", "run.settle=0.05")
"""The same of the rung `full`, which is thirty times as slow."""


def take_turns(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """CPU seconds of each call in each round, after one round that warms up."""
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(rounds + 1):
        for name, call in calls.items():
            seconds = cpu(call)
            if turn:
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
    """The spread of the ratios of two calls, round by round."""
    return spread([a / b for a, b in zip(over, under, strict=True)])


@cache
def _reference() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("reference.json").read_text(encoding="utf-8"))


def times() -> list[float]:
    """Times of the reference, s."""
    return _reference()["time"]


def brief(*overrides: str) -> Scene:
    """The scene `reference` over the time of its known path, with a row at each of that's times."""
    return load("reference", [*BRIEF, "run.output_step=1e-3", *overrides])


def error(path: npt.NDArray[np.float64], circuit: str = "amplifier") -> float:
    """Largest error of heights (m) at the reference's times, over the path's own range."""
    true = np.array(_reference()[circuit]["z_part"])
    return float(np.abs(path - true).max() / np.ptp(true))


def own_error(model: str, reference: str) -> float:
    """The error of our run on a rung."""
    found = simulate(brief(f"circuit.model={model}")).columns["z_part"]
    return error(found[1 : 1 + len(times())], reference)
