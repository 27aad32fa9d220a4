"""The ladder: cost and error of each circuit model (rung) on a scene; the top rung is 'full'."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, nan
from statistics import median
from typing import Any

from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.point import in_whole_periods
from cosim.evaluate.store import Store, hashed, reported
from cosim.files.picture import Picture
from cosim.scene import Overrides, Scene, changed, load
from cosim.scene.rungs import LADDER
from cosim.simulation.fidelity import relative_error
from cosim.simulation.simulate import simulate
from cosim.studies.plots import GREEN, panels
from cosim.studies.report import Progress, Report, brief, counted, markdown, silent
from cosim.typed import typed

RUNS = [(model, k) for k in range(3) for model in LADDER if not (k and model == "full")]
"""Runs of each scene, in order: model and repetition; three for the median cost, one of "full"."""


@dataclass(frozen=True)
class Rung:
    """One circuit model on one scene. ``cost``: seconds of computing per simulated second (median,
    least, most). ``off_top`` and ``off_amplifier``: relative errors of v_average against "full" and
    "amplifier". ``fall``: the surface's greatest downward acceleration, m/s², NaN with rigid
    walls."""

    model: str
    cost: tuple[float, float, float]
    v_average: float
    fall: float
    off_top: float
    off_amplifier: float


def each_rung(
    scene: Scene, store: Store, progress: Callable[[], object] = lambda: None
) -> list[Rung]:
    """Run a scene on each rung as in RUNS. Raises BadInput, SimulationFailed.

    Averages are over whole periods; few rows are written, so that output adds no cost.
    """
    runs = {model: _on(scene, model) for model in LADDER}
    spent: dict[str, list[float]] = {model: [] for model in LADDER}
    numbers: dict[str, dict[str, Any]] = {}
    own = hashed(scene.as_dict())
    simulate(runs["limited"])  # builds and loads libraries, which would count for the first run

    def once(model: str) -> tuple[float, dict[str, Any]]:
        """Wall time, s, and the needed numbers of the summary."""
        began = time.perf_counter()
        try:
            summary = simulate(runs[model]).summary
        except SimulationFailed as error:
            raise SimulationFailed(f'With circuit.model = "{model}": {error}') from error
        seconds = time.perf_counter() - began
        return seconds, {name: summary[name] for name in ("v_average", "a_surface_min")}

    for model, repeat in RUNS:
        name = f"{own}, {model}, {repeat}"
        seconds, numbers[model] = store.once(name, partial(once, model))
        spent[model].append(seconds / runs[model].run.duration)
        progress()
    averages = {model: found["v_average"] for model, found in numbers.items()}
    return [
        Rung(
            model,
            (median(spent[model]), min(spent[model]), max(spent[model])),
            average,
            nan if (low := numbers[model]["a_surface_min"]) is None else -low,
            *(relative_error(average, averages[against]) for against in ("full", "amplifier")),
        )
        for model, average in averages.items()
    ]


def cheapest(rungs: list[Rung], tolerance: float) -> Rung:
    """The cheapest rung whose v_average is within ``tolerance`` (relative) of the top's."""
    return next(rung for rung in rungs if rung.off_top <= tolerance)


def _on(scene: Scene, model: str) -> Scene:
    """The scene on the rung ``model``, in whole periods, with three rows of output."""
    if not scene.rung.on_ladder:
        raise scene.bad(
            f'circuit.model = "{scene.circuit.model}" is no rung of the '
            f"ladder; it must be one of {', '.join(LADDER)} or auto."
        )
    # The command of "full" is the firmware's staircase; the other rungs follow its smooth ramp.
    staircase = model == "full" and scene.drive.waveform == "sawtooth"
    settings: dict[str, Any] = {"circuit.model": model, "drive.pwm_ripple": False}
    if staircase and not scene.drive.reset_time:
        settings["drive.quantised"] = True
    try:
        run = in_whole_periods(changed(scene, settings, scene.origin))
    except BadInput as error:
        raise BadInput(f"The ladder runs each of {', '.join(LADDER)}. {error}") from error
    return run.having(run={"output_step": run.run.duration / 2.0})


TOP = (
    "The top, full, is the schematic with the data sheet's output stage and, under a sawtooth "
    "without reset_time, the firmware's staircase of codes: what these two make is in every error "
    "against it. The other rungs follow the smooth command"
)

Found = Sequence[tuple[Scene, list[Rung]]]
"""Scenes with their rungs."""


@typed
def ladder(
    scenes: Sequence[Scene | str | os.PathLike[str]] = ("paper",),
    overrides: Overrides | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
) -> Report:
    """Run scenes on each rung of the circuit in turn: the cost of each, and the error of its
    v_average against the top rung "full" and against "amplifier".

    Each of the report's ``rows`` is a rung of a scene: ``scene``, ``circuit.model``, the wall time
    ``computing per simulated second [s]`` with its ``least [s]`` and ``most [s]``,
    ``v_average [mm/s]``, its errors ``off the amplifier [%]`` and ``off the top [%]``, and
    ``peak downward acceleration [m/s²]`` of the surface.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput and SimulationFailed.
    """
    loaded = [load(scene, overrides) for scene in scenes]
    if not loaded:
        raise BadInput("ladder: scenes must name a scene at least.")
    tick = counted(progress, len(RUNS) * len(loaded))
    return reported(
        lambda store: report([(scene, each_rung(scene, store, tick)) for scene in loaded]),
        *(out, "ladder.sqlite", [scene.as_dict() for scene in loaded]),
    )


def report(found: Found) -> Report:
    """The report: each scene's cheapest sufficient rung, and the cost and error of all rungs."""
    said = [words(scene, rungs) for scene, rungs in found]
    table = [
        {
            "scene": scene.name,
            "circuit.model": rung.model,
            "computing per simulated second [s]": rung.cost[0],
            "least [s]": rung.cost[1],
            "most [s]": rung.cost[2],
            "v_average [mm/s]": rung.v_average * 1e3,
            "off the amplifier [%]": 100.0 * rung.off_amplifier,
            "off the top [%]": 100.0 * rung.off_top,
            "peak downward acceleration [m/s²]": rung.fall,
        }
        for scene, rungs in found
        for rung in rungs
    ]
    top = f"{TOP}{_but(found)}."
    notes, figures = [f"{message(found)}.", *said, top], {"": partial(draw, found)}
    return Report(
        "ladder", "The ladder of circuits", table, notes, {"Each rung": table}, figures,
        "\n".join([*said, top, "", *markdown(table)]),
    )  # fmt: skip


def _but(found: Found) -> str:
    """Words on the scenes that have the staircase on every rung."""
    names = " and ".join(scene.name for scene, _ in found if scene.drive.quantised)
    return names and f", but in {names} the staircase, too (drive.quantised)"


def words(scene: Scene, rungs: list[Rung]) -> str:
    """A sentence on the cheapest rung within the scene's tolerance."""
    tolerance, top = scene.run.tolerance, rungs[-1]
    taken = cheapest(rungs, tolerance)
    return (
        f"{scene.name}: within {tolerance:.2g} of the top the cheapest rung is {taken.model}, at "
        f"{taken.cost[0]:.2g} s a simulated second where the top takes {top.cost[0]:.2g} s."
    )


def draw(found: Found) -> Picture:
    """Draw error over cost, a panel a scene, and mark the cheapest rung within the tolerance."""
    wide = 2 if len(found) == 4 else min(len(found), 3)
    errors = [rung.off_top for _, rungs in found for rung in rungs]
    top = 200.0 * max(*errors, *(scene.run.tolerance for scene, _ in found))
    costs = [rung.cost[0] for _, rungs in found for rung in rungs]
    ends = min(costs) / 6.0, max(costs) * 6.0  # with room for the rungs' names
    size = (max(3.8 * wide, 6.0), 3.4 * ceil(len(found) / wide) + 0.6)
    note = (
        "Green: the cheapest rung within run.tolerance, which is shaded. Under a sawtooth “full” "
        f"has the firmware's staircase, the others the smooth ramp{_but(found)}."
    )
    figure, axes = panels(message(found), note, size, len(found), wide, sharex=True, sharey=True)
    for axis, (scene, rungs) in zip(axes, found, strict=True):
        tolerance, taken = scene.run.tolerance, cheapest(rungs, scene.run.tolerance)
        axis.axhspan(0.0, 100.0 * tolerance, color=GREEN, alpha=0.12, lw=0)
        for rung in rungs:
            place = (rung.cost[0], 100.0 * rung.off_top)
            color, size, weight = (GREEN, 9, "bold") if rung is taken else ("0.45", 6, "normal")
            off, side = ((-8, 0), "right") if rung is rungs[0] else ((7, 6), "left")
            look: dict[str, Any] = {"color": color, "ha": side, "fontweight": weight}
            axis.plot(*place, "o", color=color, ms=size)
            axis.annotate(rung.model, place, off, textcoords="offset points", **look)
        axis.set_title(scene.name, loc="left")
        axis.set_xscale("log")
        axis.set_yscale("symlog", linthresh=0.1)
        axis.set(xlabel="computing per simulated second [s]", xlim=ends, ylim=(-0.03, top))
        axis.tick_params(labelbottom=True)
    for axis in axes[::wide]:
        axis.set_ylabel("error of v_average against “full” [%]")
    return figure


def message(found: Found) -> str:
    """The title of the figure: the cheapest sufficient rung of each scene."""
    by_model: dict[str, list[str]] = {}
    for scene, rungs in found:
        taken = cheapest(rungs, scene.run.tolerance)
        less = f" ({brief(rungs[-1].cost[0] / taken.cost[0])} times cheaper)"
        said = scene.name + (less if taken is not rungs[-1] else "")
        by_model.setdefault(taken.model, []).append(said)
    needed = [f"{' and '.join(scenes)} on {model}" for model, scenes in by_model.items()]
    return f"The cheapest rung that keeps the tolerance: {', '.join(needed)}"
