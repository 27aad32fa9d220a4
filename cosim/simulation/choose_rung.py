"""``circuit.model = "auto"``: the cheapest circuit that a scene can do with.

``choice.csv``, as ``benchmarks.choice`` has measured it, tells what to expect: where "limited" is
mostly further off than the tolerance, nothing is tried. Else the scene itself decides.

The rungs without ngspice run the whole scene; the behavioural amplifier, which they simplify, runs
only the first part of it, beside the rung "limited". What separates "limited" from the amplifier is
small and always there, so a part shows it; what separates "ideal" from "limited" shows in the whole
runs. "limited" leaves out the amplifier's ringing: its loop has a phase margin of a few degrees, so
each return from a limit is followed by some 0.2 ms of ringing, which matters where a slip begins or
ends in it and nowhere else. Whether it does is seen in the trial alone, roughly: its difference
counts MARGIN times. What the rungs differ in acts on the current: where a ten-thousandth more or
less of it moves v_average much, the motion being chaotic or near another one, no simpler rung can
be relied on.
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
from cosim.toolchain.processes import processors
from cosim.waveforms.quantities import percent
from cosim.waveforms.result import Result

PART = 0.25
"""Share of the run that the amplifier is tried for; averages leave out its first half."""

FEWEST_PERIODS = 4
"""That the trial averages over."""

MARGIN = 2.0
"""By how much the whole run may differ more than the trial."""

TREMBLE = 1e-4
"""Relative perturbation of the coil's force in the test of sensitivity: regular motion answers with
no more than its like."""


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
    """What the table tells of a rung, in words."""
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

    ``run`` runs a scene with ngspice; the others are run at once. Raises what a run raises.
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
            return Choice(
                model, f"at most about {percent(errors[model])} off the amplifier", errors
            )
    why = f"limited may be {percent(errors['limited'])} off, ideal {percent(errors['ideal'])}"
    return Choice(JUDGES, why, errors)


def _v_averages(scene: Scene, settings: Sequence[Mapping[str, float | str]]) -> list[float]:
    """Of a scene without ngspice with each of some settings, m/s."""
    scenes = [partial(changed, scene, values, "auto") for values in settings]
    with ThreadPoolExecutor(processors()) as threads:
        found = threads.map(lambda make: one_run(make(), lambda _: None, alone=True), scenes)
        return [result.summary["v_average"] for result in found]


def _part(scene: Scene) -> dict[str, float | str]:
    """Settings for the first whole periods of a run alone."""
    length = scene.period
    count = max(FEWEST_PERIODS, round(0.5 * PART * scene.run.duration / length))
    if 2 * count * length >= scene.run.duration:
        return {}
    times = {"run.settle": count * length, "run.duration": 2 * count * length}
    return {**times, "run.output_step": count * length}
