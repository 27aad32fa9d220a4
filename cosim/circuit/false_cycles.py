"""False limit cycles: an output that swings from rail to rail only because steps are too coarse.

With a loose tolerance the time stepping of an amplifier with feedback can fall into an oscillation
that the converged solution does not have, and that looks like a result. Its mark is a burst of fast
swings over the output's whole range. A burst can also be real (an unstable loop, a switching
stage), so the run is solved again up to its end with finer steps.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import SimulationFailed
from cosim.files.spill import blocks
from cosim.scene import Scene

BURST = 12
"""Swings in a row that make a burst. A loop with 4° of phase margin, ringing after a flyback, makes
fewer than half as many."""
FAST = 1e-3
"""s; swings further apart are no burst."""

_FINER_TOLERANCE, _FINER_STEP = 100.0, 10.0  # divisors of reltol and of the longest step


def swings(log: dict[str, Array]) -> Array:
    """Times (s) at which the output has crossed from one end of its range to the other."""
    count = len(log["time"])
    low = min(float(log["v(out)"][part].min()) for part in blocks(count))
    high = max(float(log["v(out)"][part].max()) for part in blocks(count))
    edge = 0.15 * (high - low)
    # Between the ends nothing is known; ``last`` carries the end reached last from block to block.
    found, last = [], np.empty(0, np.int64)
    for part in blocks(count):
        out = log["v(out)"][part]
        at_end = np.where(out > high - edge, 1, np.where(out < low + edge, -1, 0))
        known = at_end != 0
        ends = np.concatenate([last, at_end[known]])
        changed = np.flatnonzero(np.diff(ends)) + 1 - len(last)
        found.append(log["time"][part][known][changed])
        last = ends[-1:]
    return np.concatenate(found)


def burst_ends(times: npt.NDArray[np.floating[Any]]) -> float | None:
    """The time (s) of the last of the first BURST swings in fast succession; None without any."""
    if len(times) < BURST:
        return None
    fast = np.diff(times) < FAST
    # BURST swings have BURST - 1 intervals; the sliding sum counts the fast ones among them.
    run = np.convolve(fast, np.ones(BURST - 1), mode="valid") >= BURST - 1
    return float(times[np.argmax(run) + BURST - 1]) if run.any() else None


def refuse_false(
    scene: Scene, log: dict[str, Array], solve: Callable[[Scene], dict[str, Array]]
) -> None:
    """Raise SimulationFailed where finer steps remove at least half of the swings up to a burst.

    ``solve`` runs another scene, circuit and mechanics, and returns its log.
    """
    times = swings(log)
    end = burst_ends(times)
    if end is None:
        return
    circuit, run = scene.circuit, scene.run
    finer = {
        "reltol": max(circuit.reltol / _FINER_TOLERANCE, 1e-9),
        "max_step": circuit.max_step / _FINER_STEP,
    }
    until = {"duration": end, "settle": 0.0, "output_step": min(run.output_step, end / 2)}
    truth = solve(scene.having(circuit=finer, run=until))
    found, true = int((times <= end).sum()), len(swings(truth))
    if true <= found // 2:
        raise SimulationFailed(
            f"A false limit cycle: until t = {end:.4g} s the output swings {found} times over its "
            f"whole range, but only {true} times with finer steps. circuit.reltol = "
            f"{circuit.reltol:g} and circuit.max_step = {circuit.max_step:g} s are too coarse for "
            f"this circuit; try circuit.reltol = {circuit.reltol / 100:g}."
        )
