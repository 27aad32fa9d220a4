"""``coupling.method = "auto"``: the cheapest method and steps that keep a scene's tolerance.

The error of a run is the greatest error of the part's height over time, over the height's range.
The whole scene is run with finer and finer LEVELS until a run differs from that two levels finer by
at most ``coupling.tolerance``; this difference is the run's error. (One level finer is not enough:
two neighbours may share the tolerance or the longest step that limits them, and so their error.)
Then macro steps are tried at the same level, and taken if they are clearly cheaper and meet the
tolerance, too.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.errors import SimulationFailed
from cosim.scene import Scene
from cosim.waveforms.result import Result

LEVELS = (
    (1e-3, 1e-4),
    (1e-5, 1e-4),
    (1e-6, 3e-5),
    (1e-7, 1e-5),
    (1e-7, 3e-6),
    (1e-8, 1e-6),
    (1e-9, 3e-7),
)
"""circuit.reltol and circuit.max_step (s), from coarse to fine."""

_APART = 2  # levels between a run and the finer one that shows its error

OTHERS: tuple[dict[str, Any], ...] = (
    {"method": "mean-current", "macro_step": 1e-3},
    {"method": "mean-current", "macro_step": 2e-4},
    {"method": "companion", "macro_step": 2e-4},
)
"""Keys of ``[coupling]`` that are tried beside the default method."""

CLEARLY = 0.8
"""Share of the default method's run time below which another one counts as cheaper."""


def simulate_within_tolerance(scene: Scene, run: Callable[[Scene], Result]) -> Result:
    """The cheapest run that meets ``coupling.tolerance``, with the scene as it was then run.

    Its summary also has ``error_estimate`` and ``coupling_taken``; its ``wall_time`` (s) is that of
    all runs. ``run`` runs a scene. Raises SimulationFailed where no level meets the tolerance.
    """
    seconds = 0.0

    def timed(level: tuple[float, float], coupling: dict[str, Any]) -> Result:
        nonlocal seconds
        steps = {"reltol": level[0], "max_step": level[1]}
        result = run(scene.having(circuit=steps, coupling=coupling))
        seconds += result.summary["wall_time"]
        return result

    level, best, finer = _meeting(scene.coupling.tolerance, timed)
    error = difference(best, finer)
    least = CLEARLY * best.summary["wall_time"]
    for other in OTHERS:
        try:
            found = timed(level, other)
        except SimulationFailed:
            continue
        off = difference(found, finer)
        if off <= scene.coupling.tolerance and found.summary["wall_time"] < least:
            best, error, least = found, off, found.summary["wall_time"]
    circuit, coupling = best.scene.circuit, best.scene.coupling
    taken: dict[str, Any] = {"coupling.method": coupling.method}
    taken |= {"circuit.reltol": circuit.reltol, "circuit.max_step": circuit.max_step}
    if coupling.method != "step-locked":
        taken["coupling.macro_step"] = coupling.macro_step
    found = {"wall_time": seconds, "error_estimate": error, "coupling_taken": taken}
    return replace(best, summary=best.summary | found)


def _meeting(
    tolerance: float, run: Callable[..., Result]
) -> tuple[tuple[float, float], Result, Result]:
    """The first level that meets the tolerance, its result, and the result two levels finer."""
    done: list[tuple[tuple[float, float], Result]] = []
    reached, failure = float("inf"), None
    for level in LEVELS:
        try:
            result = run(level, {"method": "step-locked"})
        except SimulationFailed as error:
            done.clear()
            failure = error
            continue
        if len(done) >= _APART:
            coarse = done[-_APART]
            reached = difference(coarse[1], result)
            if reached <= tolerance:
                return *coarse, result
        done.append((level, result))
    if failure is not None and not np.isfinite(reached):
        raise failure
    raise SimulationFailed(
        f"coupling.tolerance = {tolerance:g} is not met: the finest runs still differ by "
        f"{reached:.2g}. Either it is too small, or the scene is chaotic, where no path can be "
        "met; try a shorter run.duration or a larger tolerance."
    )


def difference(result: Result, truth: Result) -> float:
    """Greatest difference of the part's height over time, over the range of ``truth``."""
    path, true = result.columns["z_part"], truth.columns["z_part"]
    off, span = float(np.abs(path - true).max()), float(np.ptp(true))
    return off / span if span else (0.0 if off == 0.0 else np.inf)
