"""What a run tells of its own numbers: how far its steps may be off, and what kind of motion it is.

Both come from other runs of the same scene, on other processors while the scene itself runs.

The error of v_average is the difference to a run with all steps COARSER times as long. It is not
the run's own history that tells it, since that obeys the solver's own equations; nor a run with
less tolerance alone, since both would then err alike in whatever has a fixed length.

The kind is that of the scene on the circuit "limited", which is much cheaper: as it is, from a
height 1e-9 m aside, and with the drive begun 1/4, 1/2 and 3/4 of a period later in its course.
Where the first two part and neither repeats, motion is chaotic, and no path and no mean over a
given time is right by itself. Where the others come to another motion, the start decides between
several. Motion that repeats within short runs needs no longer ones.

Not seen: several answers that these starts do not part; a kind that the simpler circuit does
not have, near a border between two of them; and chaos that dies out before the averages begin.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from threading import Event
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, CosimError
from cosim.mechanics.fmi import load
from cosim.mechanics.normal_force import normal_force
from cosim.scene import Scene, changed
from cosim.scene.describe import KEYS
from cosim.simulation.elsewhere import one_run
from cosim.simulation.fidelity import LEAST, Fidelity, relative_error
from cosim.simulation.here import few_rows, simulate_here
from cosim.toolchain.processes import Progress
from cosim.waveforms.result import Result

COARSER = 3.5
"""How much longer the steps are of the run that tells the error of another one."""

LOOSER = 1e-6
"""``mechanics.tolerance`` of that run where no steps of ngspice are made."""

LEAST_TOLD = 5e-5
"""Of v_average, with ngspice: two runs may err alike by chance, and this much was seen."""

STRICT = 2.4
"""How much shorter they are for an error in the strict sense, of both runs."""

PERIODS, LONG = 60, 2.0
"""Of the drive, and s: how long a run is at least that tells of chaos; its second half counts."""

SHARES = (0.5, 1.0, 4.0)
"""Of that: how long the runs are, until the motion is periodic or chaotic."""

AHEAD = (0.25, 0.5, 0.75)
"""Of a period, by which the drive begins later in its course in the other runs."""

LONGEST = 10.0
"""Times the scene's own duration: a run of LONG is shorter where it would be longer, and none is
made where PERIODS would be."""

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


@contextmanager
def _beside(count: int) -> Iterator[tuple[ThreadPoolExecutor, Progress]]:
    """Threads for ``count`` other runs at once, and their progress, which ends them where the block
    does not end well, also while only they run."""
    stopped = Event()

    def going(_: float) -> None:
        if stopped.is_set():
            raise _Stopped

    with ThreadPoolExecutor(count) as threads:
        try:
            yield threads, going
        except BaseException:
            stopped.set()
            raise


def checked(scene: Scene, run: Callable[[], Result], strict: bool = False) -> Result:
    """The result of ``run``, which runs ``scene``, with what is told of its numbers: the error of
    v_average, m/s, and the kind of motion.

    ``strict`` tells the error by two finer runs and three more starts, on the scene's own circuit,
    which costs ten times as much. Raises what ``run`` raises.
    """
    load(3)
    with _beside(2) as (threads, going):

        def mean(of: Scene | None) -> float | None:
            with suppress(CosimError):
                if of is not None:
                    return one_run(few_rows(of), going, alone=True).summary["v_average"]
            return None

        asked = [_steps(scene, COARSER)]
        if strict:
            asked = [_steps(scene, 1.0 / STRICT**k) for k in (1, 2)]
            asked += [_started(scene, ahead) for ahead in AHEAD]
        others = [threads.submit(mean, each) for each in asked]
        kind = threads.submit(motion, scene, going)
        result = run()
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
    return replace(result, summary=result.summary | told_of)


def checked_ports(scene: Scene, run: Callable[[], Result]) -> Result:
    """The result of ``run``, which runs a scene with ports, and as ``NAME.mean_error`` how far each
    mean is from that of a run with all steps COARSER times as long, or as short where a scene may
    not have such long ones; nothing where that one fails. Raises what ``run`` raises.
    """
    told: dict[str, Any] = {}
    with _beside(1) as (threads, going):
        other = threads.submit(one_run, few_rows(_longer(scene, COARSER)), going, alone=True)
        result = run()
        with suppress(CosimError):
            told = other.result().summary
    errors = {
        f"{name}_error": abs(value - told[name])
        for name, value in result.summary.items()
        if name.endswith(".mean") and name in told
    }
    return replace(result, summary=result.summary | errors)


def motion(scene: Scene, progress: Progress) -> dict[str, Any]:
    """The kind of motion of a scene, by the keys of a summary; empty where it is not known: nothing
    repeats, there is no simpler circuit, or too few periods are run.

    ``motion`` is "regular", "no transport" (below LEAST), "several answers", "chaotic" or
    "unsettled": not periodic by then. ``motion_periods`` are those of the drive after which it
    repeats, ``motion_settled`` is from when on it does so, s, and ``v_average_settled`` the mean
    velocity, m/s, that it then has, of the same simple circuit. ``v_average_answers`` are the
    mean velocities, m/s, that several starts come to; ``v_average_range`` holds the least and the
    greatest one of chaotic motion in stretches as long as the average.
    """
    length = scene.period
    simple = Fidelity.of(scene).simple
    solvable = not scene.rung.ngspice or simple is not None
    steady = scene.rung.driven and normal_force(scene) is None
    longest = LONGEST * scene.run.duration
    # Where nothing drives the scene its period is infinite.
    if not (solvable and steady) or PERIODS * length > longest:
        return {}
    periods = max(PERIODS, round(min(LONG, longest) / length))
    averaged = max(1, round((scene.run.duration - scene.run.settle) / length))
    found: dict[str, Any] = {}
    for share in SHARES:
        end = round(share * periods) * length
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
    """The kind of a motion whose part goes ``ways`` (m) in the periods of ``length`` (s): from the
    scene's own start, from one ASIDE, and from others, which are not asked for where these two
    tell it. The average is over ``averaged`` periods; ``chaos``: it would be seen by now."""
    # The own start and that aside alone may tell chaos; only else are the others run.
    two = next(ways), next(ways)
    repeats = [_repeats(way) for way in two]
    own, aside = (_mean(way) / length for way in two)
    if None in repeats and max(abs(own), abs(aside)) >= LEAST:
        if not chaos or any(repeats) or relative_error(aside, own) <= PARTED:
            return {"motion": "unsettled"}
        every = np.concatenate([_stretches(way, averaged) for way in (*two, *ways)]) / length
        return {"motion": "chaotic", "v_average_range": [float(every.min()), float(every.max())]}
    answers: list[float] = []  # those that differ
    for way in (*two, *ways):
        answer = _answer(way, length)
        if answer is None:
            return {"motion": "unsettled"}
        if all(relative_error(answer, other) > SAME for other in answers):
            answers.append(answer)
    if not any(answers):
        return {"motion": "no transport"}
    found: dict[str, Any] = {"motion": "regular"}
    if len(answers) > 1:
        found = {"motion": "several answers", "v_average_answers": answers}
    if repeats[0] is not None:
        found["motion_periods"] = repeats[0]
        found["motion_settled"] = _settled(two[0], repeats[0]) * length
        found["v_average_settled"] = answers[0]
    return found


def _answer(way: Array, length: float) -> float | None:
    """The mean velocity (m/s) that a way comes to; 0 below LEAST, None where it does not repeat."""
    if abs(_mean(way)) < LEAST * length:
        return 0.0
    count = _repeats(way)
    return None if count is None else float(way[-count:].mean()) / length


def _mean(way: Array) -> float:
    """Of its second half."""
    return float(way[len(way) // 2 :].mean())


def _stretches(way: Array, count: int) -> Array:
    """The mean way over each ``count`` periods in a row of its second half, at most over all."""
    way = way[len(way) // 2 :]
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
            return scene.having(mechanics={"tolerance": scene.mechanics.tolerance * longer**3})
        return _looser(scene) if scene.mechanics.tolerance < LOOSER else None
    return _longer(scene, longer) if scene.coupling.method == "step-locked" else None


def _longer(scene: Scene, longer: float) -> Scene:
    """With as much shorter ones where longer ones would be beyond what a scene may have: two runs
    with the longest steps err alike."""
    circuit = scene.circuit
    tables = {
        "circuit": {"reltol": circuit.reltol * longer**3, "max_step": circuit.max_step * longer},
        "coupling": {"macro_step": scene.coupling.macro_step * longer},
    }
    every = ((KEYS[f"{table}.{name}"], x) for table in tables for name, x in tables[table].items())
    if longer > 1.0 and not all(key.holds(x) for key, x in every):
        return _longer(scene, 1.0 / longer)
    return scene.having(**tables)


def _looser(scene: Scene) -> Scene:
    return scene.having(mechanics={"tolerance": max(scene.mechanics.tolerance, LOOSER)})


def _started(scene: Scene, ahead: float) -> Scene | None:
    """The scene with its drive switched on so much of a period later in its course."""
    try:
        return changed(scene, {"drive.start_phase": (scene.drive.start_phase + ahead) % 1.0}, "it")
    except BadInput:
        return None  # the drive has no such start
