"""What a user may have written wrong in a recording's file: told, never applied.

Each guess is one change of the file: a power of ten, a sign, exchanged columns, a clock. It is
worth a sentence where it leaves at most half of what the run does not explain without it.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import log10

import numpy as np

from cosim.arrays import Array
from cosim.errors import plain
from cosim.studies.compare.scores import R2, explained
from cosim.trials.recording import Recording
from cosim.waveforms.columns import COLUMNS

POWERS = 10.0 ** np.array([0, *range(-6, 0), *range(1, 7)])
"""Factors between units, and 1."""

CLOCKS = np.linspace(0.988, 1.012, 25)
"""Factors of the recording's times."""

ROWS = 4000
"""Of a recording, as many as are looked at."""

WELL = 0.5
"""R² that a guess must reach at least."""

Observe = Callable[[Recording, str, float], Array]
"""A signal of the run at a recording's times, from a time (s) of the run on."""


def hints(recording: Recording, observe: Observe, guide: str, starts: Array) -> Iterator[str]:
    """A sentence for each guess that explains the misfit. ``starts`` (s) are the times at which the
    run may meet the first row, the first of them that at which it does; ``guide`` tells which."""
    signals = {name: values[:ROWS] for name, values in recording.signals.items()}
    recording = replace(recording, time=recording.time[:ROWS], signals=signals)
    laid = np.array([observe(recording, guide, start) for start in starts])
    if exchanged := _exchanged(recording, observe, laid, starts):
        yield exchanged
        return
    as_it_is, best, factor, k = _scaled(laid, signals[guide])
    told = _sentence(recording, guide, as_it_is, best, factor)
    start = starts[k] if told else starts[0]
    yield from told
    for name in R2.keys() & signals.keys() - {guide}:
        there = observe(recording, name, start)[np.newaxis]
        told += (more := _sentence(recording, name, *_scaled(there, signals[name])[:3]))
        yield from more
    if not told:
        yield from _clock(recording, observe, guide, starts)


def _better(after: float, before: float) -> bool:
    return after >= WELL and 1.0 - after <= 0.5 * (1.0 - before)


def _scaled(laid: Array, wanted: Array) -> tuple[float, float, float, int]:
    """The best R² of the rows of ``laid``; the best with ``wanted`` times ± a power of ten, with
    that factor and the row."""
    known = np.isfinite(wanted) & np.isfinite(laid).all(axis=0)
    laid, wanted = laid[:, known], wanted[known]
    factors = np.concatenate([POWERS, -POWERS])[:, np.newaxis]
    # Sums of squares of laid - factor * wanted, over the variance of factor * wanted.
    apart = (laid**2).sum(axis=1) - 2 * factors * (laid @ wanted) + factors**2 * (wanted @ wanted)
    shares = 1.0 - apart / (factors**2 * np.sum((wanted - wanted.mean()) ** 2))
    row, column = np.unravel_index(int(np.argmax(shares)), shares.shape)
    return float(shares[0].max()), float(shares[row, column]), float(factors[row, 0]), int(column)


def _sentence(
    recording: Recording, name: str, before: float, after: float, factor: float
) -> list[str]:
    if factor == 1.0 or not _better(after, before):
        return []
    columns = recording.understood.get("columns", {})
    body = name.removeprefix("v_")
    column = columns.get(f"z_{body}") or columns.get(name) or {"header": name, "unit": "it"}
    asks = []
    if abs(factor) != 1.0:
        asks.append(f"is it in {column['unit']}")
    if factor < 0.0:
        asks.append("is up, or the current's direction, positive")
    return [
        f"Hint: the {COLUMNS[name].long_name} would agree much better (R² {after:.2f}, not "
        f"{before:.2g}) with the column {plain(column['header'], 40)} times {factor:g}: "
        f"{' and '.join(asks)}?"
    ]


def _exchanged(recording: Recording, observe: Observe, laid: Array, starts: Array) -> str:
    """The sentence on surface and part that stand in each other's columns."""
    signals = recording.signals
    if not {"z_surface", "z_part", "v_surface", "v_part"} <= signals.keys():
        return ""

    def agree(bodies: tuple[str, str]) -> float:
        shares = [explained(one, signals[f"v_{bodies[0]}"]) for one in laid]
        start = starts[int(np.argmax(shares))]
        found = []
        for body, other in zip(("surface", "part"), bodies, strict=True):
            run, wanted = observe(recording, f"z_{body}", start), signals[f"z_{other}"]
            found.append(explained(run - np.nanmean(run), wanted - np.nanmean(wanted)))
        return min(found)

    before, after = agree(("surface", "part")), agree(("part", "surface"))
    if not _better(after, before):
        return ""
    return (
        f"Hint: both heights would agree much better (R² at least {after:.2f}, not {before:.2g}) "
        "with the columns of surface and part exchanged: which is which?"
    )


def _clock(recording: Recording, observe: Observe, guide: str, starts: Array) -> Iterator[str]:
    """The sentence on a clock that is off."""
    wanted = recording.signals[guide]

    def agrees(clock: float, start: float) -> float:
        slower = replace(recording, time=recording.time * clock)
        return explained(observe(slower, guide, start), wanted)

    near = starts[np.argsort(np.abs(starts - starts[0]))[:17]]
    before = agrees(1.0, starts[0])
    after, clock = max((agrees(clock, start), clock) for clock in CLOCKS for start in near)
    if _better(after, before) and after - before > 0.02:
        yield (
            f"Hint: the {COLUMNS[guide].long_name} would agree much better (R² {after:.2f}, not "
            f"{before:.2g}) with the recording's times multiplied by {clock:.3f}: is its frame "
            "rate right, or drive.frequency?"
        )


def time_hint(ratio: float) -> str:
    """The sentence on a recording that repeats ``ratio`` times as often as the run is driven."""
    power = round(log10(ratio))
    if not power or abs(ratio / 10.0**power - 1.0) > 0.05:
        return ""
    return f"Hint: the two would repeat alike with the times multiplied by {10.0**power:g}."
