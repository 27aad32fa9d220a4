"""Hints at errors in a recording's file. They are printed, never applied.

Each guess is one change of the file: a power of ten, inches, a sign, exchanged columns, a velocity
in the place of a height, a part measured from the surface or at another time, a wrong frame rate. A
guess becomes a hint if it at least halves the variance that the run does not explain.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from cosim.arrays import Array
from cosim.errors import plain
from cosim.studies.compare.scores import R2, explained
from cosim.trials.camera import velocities
from cosim.trials.recording import Recording
from cosim.waveforms.columns import COLUMNS

# Of a column: powers of ten, millimetres in an inch, and both signs.
SIZES = (*(10.0**power for power in range(-6, 7)), 25.4)
FACTORS = np.array([sign * size for size in SIZES for sign in (1, -1)])
UNCHANGED = int(np.flatnonzero(FACTORS == 1.0)[0])
CLOCKS = np.linspace(0.988, 1.012, 25)
"""Factors of the recording's times."""

ROWS = 4000
"""Most rows of a recording that are examined."""

LAGS = range(-12, 13)
"""Rows by which the part's column may be late."""

WELL = 0.5
"""R² that a guess must reach at least."""

Observe = Callable[[Recording, str, float], Array]
"""A signal of the run at a recording's times, from a time (s) of the run on."""


def hints(recording: Recording, observe: Observe, guide: str, starts: Array) -> Iterator[str]:
    """A sentence for each guess that explains the misfit. ``starts`` (s) are times of the run that
    may correspond to the first row; the first one is in use, chosen by the signal ``guide``."""
    recording = recording.rows(slice(ROWS))
    signals = recording.signals
    laid = [observe(recording, guide, start) for start in starts]

    def heights(*bodies: str) -> float:
        """The lower R² of both heights, means removed, with the columns of ``bodies`` taken for
        surface and part, at the start that agrees best with the first one's velocity."""
        shares = [explained(run, signals[f"v_{bodies[0]}"]) for run in laid]
        first, found = starts[int(np.argmax(shares))], []
        for body, column in zip(("surface", "part"), bodies, strict=True):
            run, wanted = observe(recording, f"z_{body}", first), signals[f"z_{column}"]
            found.append(explained(run - np.nanmean(run), wanted - np.nanmean(wanted)))
        return min(found)

    if {"z_surface", "v_surface", "z_part", "v_part"} <= signals.keys():
        before, after = heights("surface", "part"), heights("part", "surface")
        if hint := _hint("two heights", after, before):
            yield f"{hint} with the columns of surface and part exchanged: which is which?"
            return
    start, fine = starts[0], True  # ``fine``: no guess has explained the misfit yet
    measured = {name: signals[name] for name in (guide, *R2) if name in signals}
    # Where a height has a column besides the velocity's, it has a unit of its own: its differences
    # are examined, too.
    for z in ("z_surface", "z_part"):
        if {z, f"v{z[1:]}"} <= recording.understood.get("columns", {}).keys() & signals.keys():
            measured[z] = velocities(recording.time, signals[z])
    for name, values in measured.items():
        velocity = name.replace("z_", "v_", 1)
        runs = laid if velocity == guide else [observe(recording, velocity, start)]
        shares = np.array([[explained(run, x * values) for x in FACTORS] for run in runs])
        best = int(np.argmax(shares.max(axis=0)))
        hint = _hint(COLUMNS[name].text, *shares[:, [best, UNCHANGED]].max(axis=0))
        if best != UNCHANGED and hint:
            fine = False
            start = starts[int(np.argmax(shares[:, best]))] if name == guide else start
            yield hint + _scaled(recording, name, float(FACTORS[best]))
    for sentence in _of_other_motion(recording, observe, laid, guide, start) if fine else ():
        fine = False
        yield sentence
    if fine:
        # With other times the best start is another one, too, so the nearest 17 are tried.
        near = starts[np.argsort(np.abs(starts - start))[:17]]
        clocks = {}
        for clock in (1.0, *CLOCKS):
            timed = replace(recording, time=recording.time * clock)
            runs = (observe(timed, guide, first) for first in near)
            clocks[clock] = max(explained(run, signals[guide]) for run in runs)
        clock = max(clocks, key=lambda clock: clocks[clock])
        hint = _hint(COLUMNS[guide].text, clocks[clock], clocks[1.0])
        if hint and clocks[clock] - clocks[1.0] > 0.02:
            yield f"{hint} with times multiplied by {clock:.3f}: is its frame rate right?"


def _of_other_motion(
    recording: Recording, observe: Observe, laid: list[Array], guide: str, start: float
) -> Iterator[str]:
    """Hints at height columns that hold velocities, relative heights or delayed ones. ``laid``: the
    run's signal ``guide`` for each possible start; ``start`` (s) as in :class:`Seen`."""
    signals, headers = recording.signals, recording.understood.get("columns", {})
    for body in ("surface", "part"):
        z, v = f"z_{body}", f"v_{body}"
        if z not in headers or not {z, v} <= signals.keys():
            continue
        runs = laid if v == guide else [observe(recording, v, start)]
        before = max(explained(run, signals[v]) for run in runs)
        after = max(explained(run, signals[z]) for run in runs)
        if hint := _hint(f"column {plain(headers[z]['header'], 40)}", after, before):
            yield f"{hint} as a velocity, in {headers[z]['unit']}/s: is it one?"
            return
    if not {"z_surface", "v_surface", "z_part", "v_part"} <= signals.keys():
        return
    if explained(laid[0], signals[guide]) < WELL:  # then the start, and so a delay, is by chance
        return
    row, part = float(np.median(np.diff(recording.time))), signals["v_part"]
    lifted = "with the surface's height added to it: is it measured from the surface?"
    as_it_is = "as it is"
    guesses = {as_it_is: (part, 0), lifted: (part + signals["v_surface"], 0)}
    for lag in filter(None, LAGS):
        where = f"{abs(lag)} rows {'later' if lag > 0 else 'earlier'}"
        guesses[f"{where}: were both filmed at once?"] = part, lag
    shares = {
        words: explained(observe(recording, "v_part", start + lag * row), values)
        for words, (values, lag) in guesses.items()
    }
    words = max(shares, key=lambda words: shares[words])
    if hint := _hint("height of the part", shares[words], shares[as_it_is]):
        yield f"{hint} {words}"


def _hint(what: str, after: float, before: float) -> str:
    """The begin of a hint if a guess halves the unexplained share of R² and reaches WELL, or ""."""
    words = f"the recording's {what} would agree much better (R² {after:.2f}, not {before:.2g})"
    better = after >= WELL and 1.0 - after <= 0.5 * (1.0 - before)
    return f"Hint: {words}" if better else ""


def _scaled(recording: Recording, name: str, factor: float) -> str:
    columns = recording.understood.get("columns", {})
    column = columns.get(name) or columns.get(name.replace("v_", "z_", 1))
    header, unit = (column["header"], column["unit"]) if column else (name, "SI")
    asks = [f"is it in {unit}"] if abs(factor) != 1.0 else []
    if factor < 0.0:
        turned = f"-{unit}".removeprefix("--")
        asks.append(f"is its positive direction the run's ({turned} as its unit turns it)")
    return f" with column {plain(header, 40)} times {factor:g}: {' and '.join(asks)}?"
