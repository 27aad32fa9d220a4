"""The ladder: what each rung of a circuit costs on a scene, and how far it is from the top."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from statistics import median
from typing import Any

from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.point import periods_made_whole
from cosim.evaluate.store import Store, hashed
from cosim.scene import Scene, changed
from cosim.simulation.fidelity import relative_error
from cosim.simulation.simulate import simulate

RUNGS = ("ideal", "limited", "amplifier", "full")
"""Cheapest first. "full" has the data sheet's output stage and the firmware's staircase besides."""

MOST, REPEATS = 3, {"full": 1}
"""Runs of a rung, for the median of its cost, and of those that take long."""


@dataclass(frozen=True)
class Rung:
    """One circuit on one scene. ``cost`` are seconds of computing per simulated second: median,
    least, most. Errors are of v_average, relative; ``fall`` is the surface's greatest downward
    acceleration, m/s², NaN with rigid walls."""

    model: str
    cost: tuple[float, float, float]
    v_average: float
    fall: float
    off_top: float
    off_amplifier: float


def runs_in_all() -> int:
    """How many runs a ladder takes."""
    return sum(REPEATS.get(model, MOST) for model in RUNGS)


def ladder(scene: Scene, store: Store, progress: Callable[[], object] = lambda: None) -> list[Rung]:
    """Run a scene on each rung in turn, and again for the cost. Raises BadInput, SimulationFailed.

    Averages are over whole periods; few rows are written, so that the cost is the rung's own.
    """
    runs = {model: _on(scene, model) for model in RUNGS}
    spent: dict[str, list[float]] = {model: [] for model in RUNGS}
    numbers: dict[str, dict[str, Any]] = {}
    own = hashed(scene.as_dict())
    simulate(runs["limited"])  # loads and builds what the first run would wait for

    def once(model: str) -> tuple[float, dict[str, Any]]:
        """Seconds, and what is needed of the summary."""
        began = time.perf_counter()
        try:
            summary = simulate(runs[model]).summary
        except SimulationFailed as error:
            raise SimulationFailed(f'With circuit.model = "{model}": {error}') from error
        seconds = time.perf_counter() - began
        return seconds, {name: summary[name] for name in ("v_average", "a_surface_min")}

    for repeat in range(MOST):
        for model in (model for model in RUNGS if repeat < REPEATS.get(model, MOST)):
            name = f"{own}, {model}, {repeat}"
            seconds, numbers[model] = store.once(name, lambda model=model: once(model))
            spent[model].append(seconds / runs[model].run.duration)
            progress()
    averages = {model: found["v_average"] for model, found in numbers.items()}
    return [
        Rung(
            model,
            (median(spent[model]), min(spent[model]), max(spent[model])),
            average,
            nan if (low := numbers[model]["a_surface_min"]) is None else -low,
            *(relative_error(average, averages[other]) for other in ("full", "amplifier")),
        )
        for model, average in averages.items()
    ]


def cheapest(rungs: list[Rung], tolerance: float) -> Rung:
    """The cheapest one whose v_average is within ``tolerance`` (relative) of the top's."""
    return next(rung for rung in rungs if rung.off_top <= tolerance)


def _on(scene: Scene, model: str) -> Scene:
    if not scene.rung.on_ladder:
        raise BadInput(
            f'scene {scene.name}: circuit.model = "{scene.circuit.model}" is no rung of the '
            f"ladder; it must be one of {', '.join(RUNGS)} or auto."
        )
    # The schematic's command is the firmware's staircase; the others follow the same one smoothed.
    staircase = model == "full" and scene.drive.waveform == "sawtooth"
    settings: dict[str, Any] = {"circuit.model": model, "drive.pwm_ripple": False}
    if staircase and not scene.drive.reset_time:
        settings["drive.quantised"] = True
    there = changed(scene, settings, f"scene {scene.name}")
    times = periods_made_whole(there)
    return changed(there, times | {"run.output_step": times["run.duration"] / 2.0}, "ladder")
