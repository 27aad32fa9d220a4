"""What a run tells of its own numbers: how far its steps may be off, and what kind of motion it is.

Both come from other runs of the same scene, on other processors while the scene itself runs.

The error of v_average is the difference to a run with all steps COARSER times as long. It is not
the run's own history that tells it, since that obeys the solver's own equations; nor a run with
less tolerance alone, since both would then err alike in whatever has a fixed length.

The kind is that of the scene on the circuit "limited", which is much cheaper: as it is, from a
height 1e-9 m aside, and with the drive a quarter period ahead and behind. Where the first two part,
motion is chaotic, and no path and no mean over a given time is right by itself. Where the others
come to another motion, the start decides between several.

Not seen: several answers that these starts do not part; a kind that the simpler circuit does
not have, near a border between two of them; and chaos that dies out before the averages begin.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from math import isinf
from threading import Event
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, CosimError
from cosim.mechanics.fmi import load
from cosim.mechanics.normal_force import normal_force
from cosim.scene import Scene, changed
from cosim.simulation.elsewhere import summary_elsewhere
from cosim.simulation.fidelity import LEAST, Fidelity, relative_error
from cosim.simulation.here import few_rows, simulate_here, summary_here
from cosim.waveforms.result import Result

COARSER = 3.0
"""How much longer the steps are of the run that tells the error of another one."""

LOOSER = 1e-6
"""``mechanics.tolerance`` of that run where no steps of ngspice are made."""

LEAST_TOLD = 5e-5
"""Of v_average, with ngspice: two runs may err alike by chance, and this much was seen."""

STRICT = 2.4
"""How much shorter they are for an error in the strict sense, of both runs."""

PERIODS, LONG = 60, 2.0
"""Of the drive, and s: how long a run is at least that tells the kind of motion; its second half
counts."""

LONGER = 4
"""Times as long where motion is not yet periodic."""

AHEAD = (0.25, 0.75)
"""Of a period, by which the drive begins later in its course in the other runs."""

LONGEST = 10.0
"""Times the scene's own duration that such a run may last."""

ASIDE = 1e-9
"""m; far above rounding, and far below what regular motion makes of it."""

PARTED = 1e-5
"""Relative difference of v_average from ASIDE that regular motion does not have."""

SAME = 1e-3
"""Relative difference below which two values of v_average, or of the part's way in a period, are
one."""

MOST_PERIODS = 8
"""Of the drive after which motion may repeat."""


class _Stopped(CosimError):
    """Nobody waits for this run any more."""


def checked(scene: Scene, run: Callable[[], Result], strict: bool = False) -> Result:
    """The result of ``run``, which runs ``scene``, with what is told of its numbers: the error of
    v_average, m/s, and the kind of motion.

    ``strict`` tells the error by two finer runs and three more starts, on the scene's own circuit,
    which costs ten times as much. Raises what ``run`` raises.
    """
    stopped = Event()

    def going(_: float) -> None:
        if stopped.is_set():
            raise _Stopped

    def mean(of: Scene | None) -> float | None:
        alone = summary_elsewhere if scene.rung.ngspice else summary_here
        try:
            return None if of is None else alone(few_rows(of), going)["v_average"]
        except CosimError:
            return None

    load(3)
    with ThreadPoolExecutor(2) as threads:
        try:
            others: list[Future[float | None]] = []
            if strict:
                finer = [_steps(scene, 1.0 / STRICT**k) for k in (1, 2)]
                others += [threads.submit(mean, each) for each in finer]
                starts = [_started(scene, quarter / 4.0) for quarter in (1, 2, 3)]
                others += [threads.submit(mean, start) for start in starts]
            else:
                others.append(threads.submit(mean, _steps(scene, COARSER)))
            kind = threads.submit(motion, scene, going)
            result = run()
        except BaseException:
            stopped.set()
            raise
        own, told = result.summary["v_average"], [other.result() for other in others]
        found: dict[str, Any] = kind.result()
    if strict:
        fine, finest, *from_elsewhere = told
        error = None if fine is None or finest is None else max(abs(own - finest), abs(own - fine))
        means = [value for value in from_elsewhere if value is not None]
        found["v_average_other_starts"] = means
    else:
        least = LEAST_TOLD * abs(own) if scene.rung.ngspice else 0.0
        error = None if told[0] is None else max(abs(own - told[0]), least)
    told_of = {"v_average_error": error, **found}
    return Result(result.scene, result.columns, result.summary | told_of)


def motion(scene: Scene, progress: Callable[[float], None]) -> dict[str, Any]:
    """The kind of motion of a scene, by the keys of a summary; empty where it is not known: nothing
    repeats, there is no simpler circuit, or too few periods are run.

    ``motion`` is "regular", "no transport" (below LEAST), "several answers", "chaotic" or
    "unsettled": not periodic by then. ``motion_periods`` are those of the drive after which it
    repeats, and ``motion_settled`` is from when on it does so, s. ``v_average_answers`` are the
    mean velocities, m/s, that several starts come to; ``v_average_range`` holds the least and the
    greatest one of chaotic motion in stretches as long as the average.
    """
    length = scene.period
    simple = Fidelity.of(scene).simple
    if (
        (scene.rung.ngspice and simple is None)
        or not scene.rung.driven
        or isinf(length)
        or normal_force(scene) is not None
    ):
        return {}
    if PERIODS * length > LONGEST * scene.run.duration:
        return {}
    averaged = max(1, round((scene.run.duration - scene.run.settle) / length))
    found: dict[str, Any] = {}
    for longer in (1, LONGER):
        end = longer * max(PERIODS, round(LONG / length)) * length
        times = {"duration": end, "settle": end / 2.0, "output_step": length}
        base = changed(scene, simple or {}, "limited").model_copy(
            update={"run": scene.run.model_copy(update=times)}
        )
        starts = [base, _aside(base), *(_started(base, ahead) for ahead in AHEAD)]
        try:
            ways = [_ways(start, progress) for start in starts if start is not None]
        except CosimError:
            return {}
        found = _kind(ways, length, averaged)
        if found["motion"] != "unsettled":
            break
    return found


def _kind(ways: Sequence[Array], length: float, averaged: int) -> dict[str, Any]:
    """The kind of a motion whose part goes ``ways`` (m) in the periods of ``length`` (s): from the
    scene's own start, from one ASIDE, and from others. The average is over ``averaged`` periods."""
    late = [way[len(way) // 2 :] for way in ways]
    means = [float(way.mean()) / length for way in late]
    if max(map(abs, means)) < LEAST:
        return {"motion": "no transport"}
    repeats = [_repeats(way) for way in ways]
    if None in repeats[:2] and relative_error(means[1], means[0]) > PARTED:
        every = np.concatenate([_stretches(way, averaged) for way in late]) / length
        return {"motion": "chaotic", "v_average_range": [float(every.min()), float(every.max())]}
    answers: list[float] = []
    for way, count in zip(ways, repeats, strict=True):
        if count is None:
            return {"motion": "unsettled"}
        answer = float(way[-count:].mean()) / length
        if all(relative_error(answer, other) > SAME for other in answers):
            answers.append(answer)
    assert repeats[0] is not None
    found = {
        "motion_periods": repeats[0],
        "motion_settled": _settled(ways[0], repeats[0]) * length,
    }
    if len(answers) > 1:
        return {"motion": "several answers", "v_average_answers": answers, **found}
    return {"motion": "regular", **found}


def _ways(scene: Scene, progress: Callable[[float], None]) -> Array:
    """How far the part goes in each period, m."""
    return np.diff(simulate_here(scene, progress, 3).columns["z_part"])


def _stretches(way: Array, count: int) -> Array:
    """The mean way over each ``count`` periods in a row, at most over all."""
    count = min(count, len(way))
    return np.convolve(way, np.ones(count) / count, "valid")


def _repeats(way: Array) -> int | None:
    """After how many periods the last ways repeat."""
    for count in range(1, MOST_PERIODS + 1):
        if _apart(way, count)[-2 * MOST_PERIODS :].max() < SAME:
            return count
    return None


def _settled(way: Array, count: int) -> int:
    """The period from which on the ways repeat after ``count`` of them."""
    apart = np.flatnonzero(_apart(way, count) >= SAME)
    return int(apart[-1]) + 1 if len(apart) else 0


def _apart(way: Array, count: int) -> Array:
    """How far each way is from the one ``count`` periods later, relative to the largest of late."""
    least = 1e-9  # m; the part stands still
    return np.abs(way[count:] - way[:-count]) / max(np.abs(way[len(way) // 2 :]).max(), least)


def _steps(scene: Scene, longer: float) -> Scene | None:
    """The scene with steps so many times as long; None where no such run would tell anything."""
    if scene.surface_is_given:
        return None  # its motion is exact
    if not scene.rung.ngspice:
        if longer < 1.0:
            finer = {"tolerance": scene.mechanics.tolerance * longer**3}
        elif scene.mechanics.tolerance < LOOSER:
            finer = {"tolerance": LOOSER}
        else:
            return None
        return scene.model_copy(update={"mechanics": scene.mechanics.model_copy(update=finer)})
    if scene.coupling.method != "step-locked":
        return None
    circuit = scene.circuit
    steps = {
        "reltol": min(circuit.reltol * longer**3, 1e-2),
        "max_step": min(circuit.max_step * longer, 1e-2),
    }
    return scene.model_copy(update={"circuit": circuit.model_copy(update=steps)})


def _aside(scene: Scene) -> Scene:
    lifted = {"initial_lift": scene.mechanics.initial_lift + ASIDE}
    return scene.model_copy(update={"mechanics": scene.mechanics.model_copy(update=lifted)})


def _started(scene: Scene, ahead: float) -> Scene | None:
    """The scene with its drive switched on so much of a period later in its course."""
    try:
        return changed(scene, {"drive.start_phase": (scene.drive.start_phase + ahead) % 1.0}, "it")
    except BadInput:
        return None  # the drive has no such start
