"""``circuit.model = "auto"``: the cheapest circuit (rung) that is accurate enough for a scene.

``choice.csv``, measured by ``benchmarks.choice``, has the errors to be expected: if the median
error of "limited" exceeds the tolerance, nothing is tried. Else the scene itself decides.

Rungs without ngspice run the whole scene; the behavioural amplifier, which they simplify, runs only
the first part of it (the trial), and so does "limited" for comparison. The difference between these
two is small but always present, so a part shows it; the difference between "ideal" and "limited" is
taken from the whole runs. "limited" lacks the amplifier's ringing: its loop has a phase margin of a
few degrees, so each return from a limit is followed by some 0.2 ms of ringing, which matters only
if a slip begins or ends within it. The trial shows this only roughly, so its difference counts
MARGIN times. All rungs differ in the current: where 0.01 % more or less force moves v_average much,
the motion being chaotic or near another motion, no simpler rung can be relied on.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from importlib import resources

from cosim.errors import BadInput
from cosim.scene import Scene, changed
from cosim.simulation.elsewhere import one_run
from cosim.simulation.fidelity import COMPLETE, JUDGES, SEARCHES, Fidelity, relative_error
from cosim.simulation.here import few_rows
from cosim.toolchain.threads import processors
from cosim.waveforms.quantities import percent
from cosim.waveforms.result import Result

PART = 0.25
"""Length of the trial, as a share of the run; averages leave out its first half."""

FEWEST_PERIODS = 4
"""Least number of periods over which the trial averages."""

MARGIN = 2.0
"""Factor by which the whole run may differ more than the trial."""

TREMBLE = 1e-4
"""Relative perturbation of the coil's force in the test of sensitivity; v_average of regular motion
changes by about as much."""


@dataclass(frozen=True)
class Choice:
    """The rung to take, why, and the relative error of v_average of each simpler one tried."""

    model: str
    why: str
    errors: dict[str, float]


@cache
def expected() -> dict[str, dict[str, str]]:
    """The row of ``choice.csv`` for each rung with default steps, by column."""
    text = resources.files("cosim.simulation").joinpath("choice.csv").read_text(encoding="utf-8")
    rows = [row for row in csv.DictReader(text.splitlines()) if row["machine"] == "all"]
    return {row["circuit.model"]: row for row in rows if row["steps"] == "default"}


def advice(model: str) -> str:
    """The errors of a rung in ``choice.csv``, in words."""
    row = expected()[model]
    half, most = (
        " and ".join(
            f"{float(row[f'against {m}: {share} [%]']):.2g} % of {m}" for m in (JUDGES, COMPLETE)
        )
        for share in ("median", "90 %")
    )
    return f"of {row['regular settings']} settings half within {half}; nine of ten within {most}"


def choose(scene: Scene, run: Callable[[Scene], Result]) -> Choice:
    """The cheapest rung of a scene whose v_average is within ``run.tolerance`` of the amplifier's.

    ``run`` runs a scene with ngspice; runs of the other rungs are parallel. Raises what a run
    raises.
    """
    tolerance = Fidelity.of(scene).tolerance
    mostly = float(expected()[SEARCHES][f"against {JUDGES}: median [%]"]) / 100.0
    if mostly > tolerance:
        return Choice(JUDGES, f"limited is mostly more than {percent(mostly)} off it", {})
    try:
        limited = few_rows(changed(scene, {"circuit.model": SEARCHES}, "auto"))
    except BadInput:  # too fast a coil
        return Choice(JUDGES, "the rung limited cannot solve this coil", {})
    # Chaos, or another motion near by: what a ten-thousandth moves, another rung moves as well.
    force = scene.coil.force_factor
    near = [{"coil.force_factor": force * (1.0 + change)} for change in (-TREMBLE, TREMBLE)]
    own, *others = _v_averages(limited, [{}, *near])
    moved = max(relative_error(other, own) for other in others)
    if moved > tolerance:
        why = f"a ten-thousandth of the coil's force moves v_average by {percent(moved)}"
        return Choice(JUDGES, why, {"limited": moved, "ideal": moved})
    # The amplifier and "limited" over the first part, "ideal" and "limited" over the whole run.
    part = _part(limited)
    top = changed(limited, {**part, "circuit.model": JUDGES}, "auto")
    judged = run(top).summary["v_average"]
    tried, ideal = _v_averages(limited, [part, {"circuit.model": "ideal"}])
    trial = relative_error(tried, judged)
    errors = {"limited": max(moved, MARGIN * trial)}
    errors["ideal"] = relative_error(ideal, own) + errors["limited"]
    for model in ("ideal", "limited"):
        if errors[model] <= tolerance:
            why = f"at most about {percent(errors[model])} off the amplifier"
            return Choice(model, why, errors)
    why = f"limited may be {percent(errors['limited'])} off, ideal {percent(errors['ideal'])}"
    return Choice(JUDGES, why, errors)


def _v_averages(scene: Scene, settings: Sequence[Mapping[str, float | str]]) -> list[float]:
    """v_average (m/s) of a scene without ngspice with each of ``settings``, in parallel."""
    scenes = [partial(changed, scene, values, "auto") for values in settings]
    with ThreadPoolExecutor(processors()) as threads:
        found = threads.map(lambda make: one_run(make(), lambda _: None, alone=True), scenes)
        return [result.summary["v_average"] for result in found]


def _part(scene: Scene) -> dict[str, float | str]:
    """Settings that shorten a run to the whole periods of the trial; none if it is as short."""
    length = scene.period
    count = max(FEWEST_PERIODS, round(0.5 * PART * scene.run.duration / length))
    if 2 * count * length >= scene.run.duration:
        return {}
    times = {"run.settle": count * length, "run.duration": 2 * count * length}
    return {**times, "run.output_step": count * length}
