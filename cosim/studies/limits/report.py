"""The whole study, and limits.csv, limits.md and the figures that it leaves."""

import os
from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path

from cosim.errors import BadInput
from cosim.scene import Scene, load
from cosim.scene.loading import Overrides
from cosim.studies.limits import answer, figures
from cosim.studies.limits.aims import QUANTITIES
from cosim.studies.limits.answer import Change, changes, height
from cosim.studies.limits.at import There, acting
from cosim.studies.limits.at import at as lifted_at
from cosim.studies.limits.confirm import Point, Points, confirmed, judged
from cosim.studies.limits.runs import Bench
from cosim.studies.limits.study import (
    FULL,
    IDEAL,
    OWN,
    QUICK,
    Study,
    checked,
    ensemble,
    study,
    told_count,
)
from cosim.studies.limits.table import LIMITS, Limit, needed_acceleration
from cosim.studies.report import Progress, Report, counted, silent
from cosim.studies.tables import Row


def report(bench: Bench, study: Study, points: Points, there: Sequence[There]) -> Report:
    """What the study tells."""
    found = changes(study, points)
    said = [text for text in answer.paragraphs(study, points, found) if text]
    if not_held := answer.refuted(points):
        said.append(
            f"Of {len(points)} points the more complete circuit does not confirm {len(not_held)} "
            f"within {bench.fidelity.tolerance:.1%}; limits.csv has both values."
        )
    if sought := answer.sought(points):
        said.append(
            "Best points sought on the more complete circuit itself, since it refuted all good "
            f"settings of the cheapest one: {len(sought)}."
        )
    tables: dict[str, Sequence[Row]] = {
        "What is achievable": achieved(study, points),
        "What lifting each limit changes, in per cent of the frontier": lifted(found),
    }
    if there:
        tables["What each limit costs at given settings: change of v_average without it, mm/s"] = [
            at_row(one, study.limits) for one in there
        ]
    commands = [
        {
            "": QUANTITIES[point.quantity].title,
            "setting": point.kind,
            "command": f"`{bench.command(point.settings)}`",
        }
        for point in points.values()
        if point.name == OWN
    ]
    tables["How the points of the own circuit are repeated; limits.csv has those of all"] = commands
    return Report(
        "limits", "What is achievable, and which limit binds",
        [row(bench, study, point) for point in points.values()], said, tables,
        figures.drawn(study, points, found, there), "\n\n".join(said),
    )  # fmt: skip


def row(bench: Bench, study: Study, point: Point) -> Row:
    """A point of a frontier, as a row of the table."""
    quantity, setting = QUANTITIES[point.quantity], point.setting
    limit = next((limit for limit in study.limits if limit.name == point.name[0]), None)
    scale = quantity.scale
    return {
        "limit": point.name[0],
        "value": point.name[1] * limit.scale if limit else nan,
        "unit": limit.unit if limit else "",
        "lifted": bool(limit and point.name[1] == limit.gone),
        "ratings": answer.rated(limit, point.name[1]).strip(" ()") if limit else "",
        "quantity": quantity.name,
        "setting": point.kind,
        "found": setting.value * scale,
        "median over turns": setting.median * scale,
        "worst over turns": setting.worst * scale,
        "unit of these": quantity.unit,
        "drive.frequency [Hz]": point.settings["drive.frequency"],
        "drive.amplitude [V]": point.settings["drive.amplitude"],
        "drive.offset [V]": point.settings["drive.offset"],
        "heat of a coil [W]": point.heat,
        "found on": point.settings["circuit.model"],
        "judged on": point.rung,
        "there": point.judged * scale,
        "off [%]": 100.0 * abs(point.judged / setting.value - 1.0),
        "confirmed": point.holds,
        "on full": point.full * scale,
        "refuted before it": point.refuted,
        "command": bench.command(point.settings),
    }


def achieved(study: Study, points: Points) -> list[Row]:
    """A row for each quantity: the own circuit and the ideal current."""
    found = []
    for number, quantity in enumerate(QUANTITIES):
        best, robust = (points.get((OWN, number, kind)) for kind in ("best", "robust"))
        scale = quantity.scale
        others = [
            rig.found[OWN][number].settings[0].value * scale
            for rig in study.rigs[1:]
            if rig.found[OWN][number].settings
        ]
        found.append(
            {
                "": f"{quantity.title} [{quantity.unit}]",
                "name": quantity.name,
                "best": height(best) * scale,
                "robust: median": height(robust) * scale,
                "robust: worst": robust.setting.worst * scale if robust else nan,
                "best, ideal current": height(points.get((IDEAL, number, "best"))) * scale,
                "robust, ideal current": height(points.get((IDEAL, number, "robust"))) * scale,
                "best, other rigs": " to ".join(f"{x:.4g}" for x in (min(others), max(others)))
                if others
                else "-",
                "needed": needed_acceleration(study.scene) if quantity.falls else nan,
                "best on amplifier": best.judged * scale if best else nan,
                "best on full": best.full * scale if best else nan,
            }
        )
    return found


def lifted(found: Sequence[Change]) -> list[Row]:
    """A row for each limit: its verdict and interval for each quantity."""
    rows = []
    for name in answer.largest(found):
        row: Row = {"limit": name}
        for change in (change for change in found if change.limit.name == name):
            title = QUANTITIES[change.quantity].name
            told = f"{change.verdict}: {answer.interval(change)}" if change.every else "-"
            row[title] = told
        rows.append(row)
    return rows


def at_row(there: There, limits: Sequence[Limit]) -> Row:
    """A scene's own setting and what it would do without each limit."""
    own = there.own.numbers.get("v_average", nan) * 1e3
    row: Row = {"scene": there.scene.name, "v_average [mm/s]": own, "coil's heat [W]": there.heat}
    for limit in acting(limits):
        row[limit.name] = cost(there, limit) * 1e3
    return row


def cost(there: There, limit: Limit) -> float:
    """The change of v_average, m/s, when a limit is lifted at a scene's own setting."""
    after, before = (
        outcomes[limit.name].numbers.get("v_average", nan)
        for outcomes in (there.lifted, there.against)
    )
    return after - before


STORE = "limits.sqlite"

LEAST_EFFORT, MOST_EFFORT = 0.01, 100.0

TRIALS = tuple(f"trial-{number:02d}" for number in range(1, 11))


def limits(
    scene: Scene | str | os.PathLike[str] = "paper",
    overrides: Overrides | None = None,
    *,
    rigs: str | os.PathLike[str] | None = None,
    at: Sequence[Scene | str | os.PathLike[str]] | None = None,
    seed: int = 0,
    quick: bool = False,
    effort: float = 1.0,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = silent,
) -> Report:
    """What the three knobs can achieve on a scene's rig, and which limit of the circuit binds.

    The best settings are searched with each limit as it is, eased, tightened and gone, and judged
    by circuits with more in them. ``rigs`` is a file of others that may be meant, such as
    ``identify.json``: JSON or TOML whose list ``ensemble`` has tables of keys and values. At the
    scenes ``at`` (the trials') each limit is lifted at their own settings. ``quick`` searches
    coarsely, ``effort`` multiplies what the searches may cost. The same for the same ``seed``, on
    any number of ``workers`` or on the Dask cluster at the address ``dask``.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput.
    """
    if seed < 0:
        raise BadInput(f"--seed {seed}: must be a whole number from 0.")
    if not LEAST_EFFORT <= effort <= MOST_EFFORT:
        raise BadInput(f"--effort {effort:g}: must be from {LEAST_EFFORT:g} to {MOST_EFFORT:g}.")
    words = [scene.name if isinstance(scene, Scene) else str(scene)]
    if overrides:
        pairs = overrides.items() if isinstance(overrides, Mapping) else ()
        texts = [f"{key}={value}" for key, value in pairs] or list(overrides)
        words += [f"--set {text}" for text in texts]
    base, there = load(scene, overrides), [load(one) for one in at or TRIALS]
    efforts = (QUICK if quick else FULL).times(effort)
    force = base.friction.normal_force
    others = ensemble(Path(rigs), efforts.rigs, force) if rigs is not None else []
    checked(base, others, rigs)
    told = counted(progress, told_count(LIMITS, efforts, len(others)) + 2 + len(there))
    path = None if out is None else Path(out) / STORE
    with Bench(base, " ".join(words), path, workers, dask) as bench:
        found = study(bench, others, LIMITS, seed, efforts, told)
        points = confirmed(bench, found, told)
        points |= judged(bench, found, points, told)
        made = report(bench, found, points, lifted_at(bench, there, LIMITS, told))
        if out is not None:
            made.save(out)
        bench.forget()
    return made
