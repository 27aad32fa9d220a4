"""The function that users call, and its report: limits.csv, limits.md and the figures."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from math import isfinite, nan
from pathlib import Path

from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import inputs
from cosim.evaluate.store import Store, reported
from cosim.scene import Overrides, Scene, load, to_link
from cosim.studies.limits import figures
from cosim.studies.limits.answer import BY_NAME, ends, gains, noise, percent, sentences
from cosim.studies.limits.changes import AS_IT_IS, CHANGES, Settings
from cosim.studies.limits.judge import Point
from cosim.studies.limits.runs import GOALS, NEEDED, Bench, Goal, command, sets
from cosim.studies.limits.study import FULL, QUICK, Study, checked, ensemble, steps, study
from cosim.studies.report import Progress, Report, Row, counted, silent
from cosim.studies.study import check_seed
from cosim.typed import typed

STORE = "limits.sqlite"

LEAST_EFFORT, MOST_EFFORT = 0.01, 100.0  # range of the factor ``effort``


def report(found: Study, asked: Sequence[str]) -> Report:
    """The report of a study; ``asked`` are the words that give its scene to ``cosim run``."""
    said, groups = sentences(found), {change.name: change.group for change in CHANGES}
    tables: dict[str, Sequence[Row]] = {
        f"What each change brings: {goal.title} [{goal.unit}]": [*_gains(found, goal)]
        for goal in GOALS
    }
    tables["How the device as it is, and its best shapes, are repeated"] = [
        {**key._asdict(), "command": f"`{command(asked, found.scene, point.settings)}`"}
        for key, point in found.rigs[0].points.items()
        if groups[key.change] in ("", "waveform") and point.settings
    ]
    rows = [
        {
            **({"rig": number} | key._asdict() | _row(BY_NAME[key.goal], point)),
            "command": command(asked, found.scene, rig.settings | point.settings),
        }
        for number, rig in enumerate(found.rigs)
        for key, point in rig.points.items()
    ]
    drawn = {
        "": partial(figures.changes, found, BY_NAME["v_up"]),
        "-acceleration": partial(figures.changes, found, BY_NAME["a_camera"]),
        "-settings": partial(figures.settings, found),
    }
    return Report(
        *("limits", "What is achievable, and what would change it"),
        *(rows, said, tables, drawn, "\n\n".join(said)),
    )


def _row(goal: Goal, point: Point) -> Row:
    return {
        "value": point.value * goal.scale,
        "median over turns": point.median * goal.scale,
        "worst over turns": point.worst * goal.scale,
        "unit": goal.unit,
        "v_average [mm/s]": point.v_average * 1e3,
        "a_camera [m/s²]": point.a_camera,
        "heat of a coil [W]": point.heat,
        "drive.frequency [Hz]": point.settings["drive.frequency"],
        "drive.amplitude [V]": point.settings["drive.amplitude"],
        "drive.offset [V]": point.settings["drive.offset"],
        "judged on": point.rung,
        "there": point.there * goal.scale,
        "confirmed": point.confirmed if point.rung else "",
    }


def _gains(found: Study, goal: Goal) -> Iterator[Row]:
    """A row for the unchanged device, then for each change, the largest median gain first."""
    every, scatter = gains(found, goal), noise(found, goal)
    for change, gain in ((AS_IT_IS, None), *((gain.change, gain) for gain in every)):
        robust, best = (found.rigs[0].point(change, goal, kind) for kind in ("robust", "best"))
        own = rigs = "-" if gain else ""
        if gain and isfinite(gain.own):
            own = f"{100.0 * gain.own:+.1f}"
        if gain and len(gain.every) > 1:
            rigs = f"{percent(gain.middle)} ({ends(gain)})"
        yield {
            "change": change.name,
            "robust (median)": robust.median * goal.scale if robust else nan,
            "worst of its turns": robust.worst * goal.scale if robust else nan,
            "gain [%]": own,
            "over the rigs: median (range) [%]": rigs,
            "noise [%]": f"{100.0 * scatter:.1f}",
            "best": best.value * goal.scale if best else nan,
            "its median": best.median * goal.scale if best else nan,
        }


@typed
def limits(
    scene: Scene | str | os.PathLike[str] = "paper",
    overrides: Overrides | None = None,
    *,
    rigs: str | os.PathLike[str] | None = None,
    seed: int = 0,
    quick: bool = False,
    effort: float = 1.0,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = silent,
) -> Report:
    """What is achievable on a scene's rig with the knobs, and what would change it: the command's
    waveform, heat, grip, and each part of the circuit.

    For each change the knobs are set anew, for what is the best and for what stays good when they
    turn by ±2 %, by the fast solver; the FMU and the amplifier judge. ``rigs`` is a file of others
    that may be meant, such as ``identify.json``: JSON or TOML whose list ``ensemble`` has tables of
    keys and values; gains are paired on each. ``quick`` searches coarsely, ``effort`` multiplies
    what the searches may cost. The same for the same ``seed``, on any number of ``workers`` or on
    the Dask cluster at the address ``dask``.

    Each of the report's ``rows`` is the best setting of a ``rig`` (0: the scene's) after a
    ``change``, for a ``goal`` and ``kind`` ("best" or "robust"): ``value``, ``median over turns``
    and ``worst over turns`` in ``unit``, ``v_average [mm/s]``, the surface's ``a_camera [m/s²]``,
    ``heat of a coil [W]``, the drive's ``drive.frequency [Hz]``, ``drive.amplitude [V]`` and
    ``drive.offset [V]``, the rung ``judged on``, what it found ``there``, whether that
    ``confirmed`` it, and the ``command`` that repeats it. ``tables`` have the gains, by goal.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput.
    """
    check_seed(seed)
    if not LEAST_EFFORT <= effort <= MOST_EFFORT:
        raise BadInput(f"--effort {effort:g}: must be from {LEAST_EFFORT:g} to {MOST_EFFORT:g}.")
    words = [str(scene)]
    if isinstance(scene, Scene):
        words = [scene.name]
        with suppress(BadInput):  # of a scene that names files
            words = [to_link(scene)]
    base = load(scene, overrides)
    if isinstance(overrides, Mapping):
        words += sets(dict(overrides))
    elif overrides:
        words += [word for text in overrides for word in ("--set", text)]
    efforts = (QUICK if quick else FULL).times(effort)
    checked(base)
    others: list[Settings] = ensemble(Path(rigs), base) if rigs is not None else []
    # A change to what all rigs have already would be another search of the unchanged device.
    bases = [Bench.base(base, rig, "a rig") for rig in ({}, *others)]
    changes = [one for one in CHANGES if one is AS_IT_IS or any(map(one.acts, bases))]
    told = counted(progress, steps(efforts, changes, len(others)))

    def found(store: Store) -> Study:
        return study(
            *(base, others, store),
            lambda rig: Evaluator(rig, kept=NEEDED, workers=workers, dask=dask),
            *(seed, efforts, changes, told),
        )

    asked = inputs(base), others, seed, quick, effort
    return reported(lambda store: report(found(store), words), out, STORE, *asked)
