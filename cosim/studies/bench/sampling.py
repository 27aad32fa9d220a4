"""Times of calls that take turns, so that changes of the machine's speed cancel in ratios."""

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from time import process_time


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
