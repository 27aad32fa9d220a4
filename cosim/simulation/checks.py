"""The error that a run's steps leave, and the kind of its motion.

Both come from other runs of the same scene, on other processors while the scene itself runs.

The error of v_average is the difference to a run with all steps COARSER times as long. The run's
own history cannot show it, since it satisfies the solver's equations; nor can a run with a looser
tolerance alone, since errors of steps of fixed length would be the same in both. Where the motion
repeats, its first such periods show it, and the other run ends with them.

The kind of motion is found with the circuit "limited", which is much cheaper, from several starts:
the scene's own, one with a height 1e-9 m aside, and those with the drive's phase 1/4, 1/2 and 3/4
of a period later. If the first two diverge and neither repeats, the motion is chaotic: no path and
no mean over a given time is right by itself. If others reach another motion, the start decides
between several. Motion that repeats within short runs needs no longer ones.

Not detected: several motions that these starts do not separate; a kind of motion that differs on
the simpler circuit, near a border between two kinds; chaos that dies out before the averages begin.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.folded import ROUNDED
from cosim.errors import BadInput, CosimError, plain
from cosim.mechanics.fmi import load
from cosim.mechanics.normal_force import normal_force
from cosim.scene import KEYS, Scene, changed
from cosim.simulation.elsewhere import one_run
from cosim.simulation.fidelity import LEAST, Fidelity, relative_error
from cosim.simulation.here import few_rows, simulate_here
from cosim.toolchain.threads import Progress, threads
from cosim.waveforms.report import asked_for
from cosim.waveforms.result import Result

COARSER = 3.5
"""Ratio of the steps of the run that shows the error to the scene's own steps."""

LOOSER = 1e-6
"""``mechanics.tolerance`` of that run where the scene has no steps of ngspice."""

LEAST_TOLD = 5e-5
"""Least relative error of v_average, or of a port's mean, with ngspice, as seen: two runs may err
alike by chance."""

BRIEF = 8
"""Least periods that the coarser run averages over where the motion repeats: errors of single steps
differ from period to period, and over 4 periods the told error was too small once in 73 settings.
"""

ROWS = 50
"""Rows in a period from which on it averages from row to row: they are whole periods but for a
hundredth of one."""

HARDLY = 0.7
"""Share of a run's steps from which on those of its coarser run are hardly fewer: edges of the
netlist's own sources rule them, and both runs err alike there. A run shows this whose tolerance is
smaller, and whose longest step is the mean step, since an FMU's lag grows with the step; where
edges rule, that costs few more steps."""

FAR = 0.05
"""Difference of a user's netlist in its coarser run, over v_average or a port's rms, from which on
that run tells nothing: its steps pass over what the circuit does, as a smooth comparator between
two edges of its carrier, and the scene's own may, too."""

WRONG = 0.2
"""Twice the error of v_average, relative, above which a note says what to do."""

STRICT = 2.4
"""Factor by which steps of the first finer run of a strict check are shorter; squared: second."""

PERIODS, LONG = 60, 2.0
"""Least length of a run that shows chaos, periods and s; averages are over its second half."""

SHARES = (0.5, 1.0, 4.0)
"""Lengths of the runs in units of that, tried in turn until the motion is periodic or chaotic."""

AHEAD = (0.25, 0.5, 0.75)
"""Shifts of the drive's phase in the other starts, as shares of a period."""

LONGEST = 10.0
"""Limit of the runs' length, over the scene's own duration: LONG is shortened to it, and where even
PERIODS exceed it, no run is made."""

ASIDE = 1e-9
"""m, shift of the initial height: far above rounding, far below any effect on regular motion."""

PARTED = 1e-5
"""Relative difference of v_average by the shift ASIDE above which motion is not regular."""

SAME = 1e-3
"""Relative difference below which mean velocities, or displacements in a period, are equal."""

MOST_PERIODS = 8
"""Most periods of the drive after which motion is recognised to repeat."""


def checked(
    scene: Scene, run: Callable[[], Result], progress: Progress, strict: bool = False
) -> Result:
    """The result of ``run``, which runs ``scene``, with two additions to its summary: the error of
    v_average, m/s, and the kind of motion. ``progress`` is that of runs after it.

    With ``strict`` the error comes from two finer runs, and v_average of three more starts is
    added, all on the scene's own circuit, which costs ten times as much. Raises what ``run``
    raises.
    """
    load(3)
    with threads(2) as (pool, going):

        def one(of: Scene | None) -> dict[str, Any]:
            return {} if of is None else _numbers(few_rows(of), going)

        kind = pool.submit(motion, scene, going)
        if strict:
            asked = [_steps(scene, 1.0 / STRICT**k) for k in (1, 2)]
            asked += [_started(scene, ahead) for ahead in AHEAD]
            others = [pool.submit(one, each) for each in asked]
        else:
            others = [pool.submit(lambda: one(_coarser(scene, kind.result())))]
        result = run()
        own, found = result.summary, kind.result()
        told = [other.result() for other in others]
        scale = max(abs(own["v_average"]), LEAST)
        if scene.rung.own_netlist and not strict:
            told = _judges(scene, own, told[0], {"v_average": scale}, progress)
    judged = own
    if strict:
        told, starts = told[:2], told[2:]
        found["v_average_other_starts"] = [each["v_average"] for each in starts if each]
    elif (rows := _repeated(scene, found)) is not None:
        judged = {"v_average": _average(result, *rows)}
    least = LEAST_TOLD if scene.rung.ngspice and not strict else 0.0
    error = _errors(judged, told, ["v_average"], least).get("v_average")
    if scene.rung.own_netlist and error is not None and 2.0 * error > WRONG * scale:
        words = f"v_average by {2e3 * error:.2g} mm/s, more than a fifth of it"
        found["notes"] = [*own["notes"], _too_long(scene, words)]
    return replace(result, summary=own | {"v_average_error": error, **found})


def _too_long(scene: Scene, moved: str, method: str = "") -> str:
    """A note on what the steps of the user's netlist may have ``moved``, and by how much; with the
    ``method`` "macro-steps" these steps, too."""
    shorter = _longer(scene, 1.0 / COARSER)
    keys = ["circuit.reltol", "circuit.max_step"]
    keys += ["coupling.macro_step"] * (method == "macro-steps")
    values = (getattr(getattr(shorter, KEYS[key].table), KEYS[key].name) for key in keys)
    tried = (f"{key} = {max(x, KEYS[key].low):.1g}" for key, x in zip(keys, values, strict=True))
    return (
        f"the steps of ngspice may move {moved}: either they are too long for this netlist (try "
        f"{' and '.join(tried)}), or the motion is chaotic."
    )


def checked_ports(scene: Scene, run: Callable[[], Result], progress: Progress) -> Result:
    """The result of ``run``, which runs a scene with ports, with an error ``NAME.mean_error`` of
    each mean that the runs of :func:`_judges` know. ``progress`` is that of runs after it. Raises
    what ``run`` raises.
    """
    with threads(1) as (pool, going):
        other = pool.submit(_numbers, few_rows(_longer(scene, COARSER)), going)
        result = run()
        own = result.summary
        # Outputs that nothing joins may count an FMU's own steps.
        named = (name for name in asked_for(scene) if f"{name}.rms" in own)
        scales = {f"{name}.mean": max(own[f"{name}.rms"], ROUNDED) for name in named}
        told = _judges(scene, own, other.result(), scales, progress)
    errors = _errors(own, told, (name for name in own if name.endswith(".mean")), LEAST_TOLD)
    found: dict[str, Any] = {f"{name}_error": errors[name] for name in errors}
    if not any(told):
        words = "the errors of the means are not known: the runs with other steps for them fail."
        found["notes"] = [*own["notes"], words]
    worst = max(scales, key=lambda name: errors.get(name, 0.0) / scales[name], default="")
    if errors.get(worst, 0.0) > FAR * scales.get(worst, 0.0):
        name = worst.removesuffix(".mean")
        by = f"{2.0 * errors[worst]:.2g} {result.units[name]}"
        words = f"the mean of {plain(name)} by {by}, more than a tenth of its rms"
        found["notes"] = [*own["notes"], _too_long(scene, words, own["method"])]
    return replace(result, summary=own | found)


def _judges(
    scene: Scene,
    own: dict[str, Any],
    longer: dict[str, Any],
    scales: Mapping[str, float],
    progress: Progress,
) -> list[dict[str, Any]]:
    """The summaries whose differences to ``own`` tell the errors of the numbers in ``scales``, for
    a netlist of the user's. That is the one with all steps COARSER times as ``longer``. Where it
    fails, or is FAR off in units of the scales, one with all steps as much shorter takes its place;
    where both take HARDLY other steps, one of smaller tolerance and longest step stands beside."""
    far = not longer or any(
        abs(own[name] - longer.get(name, own[name])) > FAR * scales[name] for name in scales
    )
    shorter = _longer(scene, 1.0 / COARSER)
    if far and shorter != _longer(scene, COARSER):
        return [_numbers(shorter, progress) or longer]
    if HARDLY < longer.get("circuit_steps", 0) / max(1, own["circuit_steps"]) < 1.0 / HARDLY:
        mean = scene.run.duration / max(1, own["circuit_steps"])
        tighter = {"reltol": scene.circuit.reltol / COARSER**3, "max_step": mean}
        sharper = scene.having(circuit=tighter)
        return [longer, *filter(None, [_numbers(sharper, progress)])]
    return [longer]


def _errors(
    own: dict[str, Any], others: list[dict[str, Any]], names: Iterable[str], least: float
) -> dict[str, float]:
    """The errors of the numbers of ``own`` that all ``others`` have: the greatest differences, at
    least the share ``least`` of the number."""
    return {
        name: max(least * abs(own[name]), *(abs(own[name] - each[name]) for each in others))
        for name in names
        if all(name in each for each in others)
    }


def _numbers(scene: Scene, progress: Progress) -> dict[str, Any]:
    """The summary of a run of ``scene`` by itself, which tells its progress at its rows; empty
    where it fails."""
    with suppress(CosimError):
        return one_run(scene, progress, alone=True).summary
    return {}


def motion(scene: Scene, progress: Progress) -> dict[str, Any]:
    """The kind of motion of a scene, by the keys of a summary; empty where it cannot be found: the
    drive is not periodic, there is no simpler circuit, or too few periods are run.

    ``motion`` is "regular", "no transport" (below LEAST), "several answers", "chaotic" or
    "unsettled" (not periodic within the runs). ``motion_periods`` is the number of the drive's
    periods after which motion repeats, ``motion_settled`` the time, s, from which on it does, and
    ``v_average_settled`` the mean velocity, m/s, from then on, all on the simple circuit.
    ``v_average_answers`` are the mean velocities, m/s, reached from several starts;
    ``v_average_range`` holds the least and the greatest mean velocity of chaotic motion over
    intervals as long as the scene averages.
    """
    length = scene.period
    simple = Fidelity.of(scene).simple
    solvable = not scene.rung.ngspice or simple is not None
    steady = scene.rung.driven and normal_force(scene) is None
    longest = LONGEST * scene.run.duration
    # A scene without a drive has an infinite period.
    if not (solvable and steady) or PERIODS * length > longest:
        return {}
    periods = max(PERIODS, round(min(LONG, longest) / length))
    averaged = max(1, round((scene.run.duration - scene.run.settle) / length))
    found: dict[str, Any] = {}
    for share in SHARES:
        end = round(share * periods) * length
        # With a row for each period, differences of z_part are displacements in a period.
        times = {"duration": end, "settle": end / 2.0, "output_step": length}
        base = _looser(changed(scene, simple or {}, "limited")).having(run=times)
        aside = base.having(mechanics={"initial_lift": base.mechanics.initial_lift + ASIDE})
        starts = (base, aside, *(_started(base, ahead) for ahead in AHEAD))
        runs = (simulate_here(start, progress) for start in starts if start is not None)
        ways = (np.diff(run.columns["z_part"]) for run in runs)
        try:
            found = _kind(ways, length, averaged, share >= 1.0)
        except CosimError:
            return {}
        if found["motion"] != "unsettled":
            break
    return found


def _kind(ways: Iterator[Array], length: float, averaged: int, chaos: bool) -> dict[str, Any]:
    """The kind of a motion from ``ways``: for each start the part's displacements (m) in the
    periods of ``length`` (s). The first start is the scene's own, the second one ASIDE; further
    ones are only run if these two do not decide. v_average is over ``averaged`` periods; ``chaos``
    tells whether the runs are long enough to show it."""
    two = next(ways), next(ways)
    count, count_aside = (_repeats(way) for way in two)
    own, aside = (_mean(way) / length for way in two)
    if None in (count, count_aside) and max(abs(own), abs(aside)) >= LEAST:
        parted = count is None and count_aside is None and relative_error(aside, own) > PARTED
        if not (chaos and parted):
            return {"motion": "unsettled"}
        means = np.concatenate([_stretches(way, averaged) for way in (*two, *ways)]) / length
        return {"motion": "chaotic", "v_average_range": [float(means.min()), float(means.max())]}
    answers = _answers(chain(two, ways), length)
    if answers is None:
        return {"motion": "unsettled"}
    if not any(answers):
        return {"motion": "no transport"}
    found: dict[str, Any] = {"motion": "regular"}
    if len(answers) > 1:
        found = {"motion": "several answers", "v_average_answers": answers}
    if count is not None:
        found["motion_periods"] = count
        found["motion_settled"] = _settled(two[0], count) * length
        found["v_average_settled"] = answers[0]
    return found


def _answers(ways: Iterable[Array], length: float) -> list[float] | None:
    """The mean velocities (m/s) that differ, the first start's first; None, and no further start is
    run, once motion does not repeat."""
    answers: list[float] = []
    for way in ways:
        answer = _answer(way, length)
        if answer is None:
            return None
        if all(relative_error(answer, other) > SAME for other in answers):
            answers.append(answer)
    return answers


def _answer(way: Array, length: float) -> float | None:
    """The mean velocity (m/s) of repeating motion; 0 below LEAST, None without repetition."""
    if abs(_mean(way)) < LEAST * length:
        return 0.0
    count = _repeats(way)
    return None if count is None else float(way[-count:].mean()) / length


def _mean(way: Array) -> float:
    """Mean displacement in a period over the second half of the run, m."""
    return float(way[len(way) // 2 :].mean())


def _stretches(way: Array, count: int) -> Array:
    """Moving averages of displacements over ``count`` periods, in the run's second half."""
    way = way[len(way) // 2 :]
    count = min(count, len(way))
    return np.convolve(way, np.ones(count) / count, "valid")


def _repeats(way: Array) -> int | None:
    """After how many periods the last displacements repeat; None if they do not."""
    for count in range(1, MOST_PERIODS + 1):
        if _apart(way, count)[-2 * MOST_PERIODS :].max() < SAME:
            return count
    return None


def _settled(way: Array, count: int) -> int:
    """The number of the period from which on displacements repeat every ``count`` periods."""
    apart = np.flatnonzero(_apart(way, count) >= SAME)
    return int(apart[-1]) + 1 if len(apart) else 0


def _apart(way: Array, count: int) -> Array:
    """The difference of each displacement to the one ``count`` periods later, relative to the
    largest in the second half of the run."""
    least = 1e-9  # m; below it the part stands still
    return np.abs(way[count:] - way[:-count]) / max(np.abs(way[len(way) // 2 :]).max(), least)


def _coarser(scene: Scene, kind: Mapping[str, Any]) -> Scene | None:
    """The scene with steps that show its error, as long as its ``kind`` of motion needs."""
    longer, rows = _steps(scene, COARSER), _repeated(scene, kind)
    if longer is None or rows is None:
        return longer
    first, last = (row * scene.run.output_step for row in rows)
    return longer.having(run={"settle": first, "duration": last})


def _repeated(scene: Scene, kind: Mapping[str, Any]) -> tuple[int, int] | None:
    """The rows of the waveforms between which averages show the error as well as between the ends
    of the scene's own: the first BRIEF periods in which the motion repeats. None where there are no
    such rows."""
    run, length = scene.run, scene.period
    if "motion_settled" not in kind or run.average != "ends" or length < ROWS * run.output_step:
        return None
    count = kind["motion_periods"]
    settled = kind["motion_settled"] - 1e-9 * length  # it is rounded
    if settled > run.settle:
        return None
    periods = math.ceil(BRIEF / count) * count
    first = max(0, math.ceil(settled / run.output_step))
    last = first + round(periods * length / run.output_step)
    return (first, last) if last * run.output_step < run.duration else None


def _average(result: Result, first: int, last: int) -> float:
    """The part's mean velocity (m/s) between two rows."""
    heights = result.columns["z_part"]
    return float(heights[last] - heights[first]) / ((last - first) * result.scene.run.output_step)


def _steps(scene: Scene, longer: float) -> Scene | None:
    """The scene with steps ``longer`` times as long; None where such a run shows no error."""
    if scene.surface_is_given:
        return None  # its motion is exact
    if not scene.rung.ngspice:
        if longer < 1.0:
            return scene.having(mechanics={"tolerance": scene.mechanics.tolerance * longer**3})
        return _looser(scene) if scene.mechanics.tolerance < LOOSER else None
    return _longer(scene, longer) if scene.coupling.method == "step-locked" else None


def _longer(scene: Scene, longer: float) -> Scene:
    """The scene with steps ``longer`` times as long, or as short where a scene does not allow such
    long ones: a run at the limit would err like the scene itself."""
    circuit = scene.circuit
    whole = math.ceil(longer) if longer > 1.0 else longer  # an FMU may have steps of its own
    tables = {
        "circuit": {"reltol": circuit.reltol * longer**3, "max_step": circuit.max_step * longer},
        "coupling": {"macro_step": scene.coupling.macro_step * whole},
    }
    pairs = ((KEYS[f"{table}.{name}"], x) for table in tables for name, x in tables[table].items())
    if longer > 1.0 and not all(key.holds(x) for key, x in pairs):
        return _longer(scene, 1.0 / longer)
    return scene.having(**tables)


def _looser(scene: Scene) -> Scene:
    return scene.having(mechanics={"tolerance": max(scene.mechanics.tolerance, LOOSER)})


def _started(scene: Scene, ahead: float) -> Scene | None:
    """The scene with its drive's start phase shifted by the share ``ahead`` of a period."""
    try:
        return changed(scene, {"drive.start_phase": (scene.drive.start_phase + ahead) % 1.0}, "it")
    except BadInput:
        return None  # the drive has no such start
