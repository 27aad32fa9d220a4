"""limits.csv, limits.md and the figures."""

from collections.abc import Sequence
from math import nan
from pathlib import Path

from cosim.studies.limits.find.at import There, judged
from cosim.studies.limits.find.confirm import Point, Points
from cosim.studies.limits.find.quantities import QUANTITIES
from cosim.studies.limits.find.runs import Bench
from cosim.studies.limits.find.study import IDEAL, OWN, Study
from cosim.studies.limits.find.table import Limit, needed_acceleration
from cosim.studies.limits.report import figures, words
from cosim.studies.limits.report.ranking import Change, changes, height
from cosim.studies.tables import Row, write_csv, write_page


def write(folder: Path, bench: Bench, study: Study, points: Points, there: Sequence[There]) -> str:
    """Write the tables and figures into ``folder``; gives what is printed."""
    found = changes(study, points)
    said = [text for text in words.paragraphs(study, points, found) if text]
    if not_held := words.refuted(points):
        said.append(
            f"{len(not_held)} of {len(points)} points are not confirmed within 2 % by the more "
            "complete circuit; limits.csv has both values."
        )
    write_csv(folder / "limits.csv", [row(bench, study, point) for point in points.values()])
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
            "quantity": QUANTITIES[point.quantity].name,
            "setting": point.kind,
            "command": f"`{bench.command(point.settings)}`",
        }
        for point in points.values()
        if point.name == OWN
    ]
    tables["How the points of the own circuit are repeated; limits.csv has those of all"] = commands
    write_page(folder / "limits.md", "What is achievable, and which limit binds", said, tables)
    names = figures.draw(folder, study, points, found, there)
    return "\n\n".join([*said, f"Written to {folder}: limits.csv, limits.md, {', '.join(names)}"])


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
        "ratings": words.rated(limit, point.name[1]).strip(" ()") if limit else "",
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
        "there": point.confirmed * scale,
        "off [%]": 100.0 * point.off,
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
                "best": height(best) * scale,
                "robust: median": height(robust) * scale,
                "robust: worst": robust.setting.worst * scale if robust else nan,
                "best, ideal current": height(points.get((IDEAL, number, "best"))) * scale,
                "robust, ideal current": height(points.get((IDEAL, number, "robust"))) * scale,
                "best, other rigs": " to ".join(f"{x:.4g}" for x in (min(others), max(others)))
                if others
                else "-",
                "needed": needed_acceleration(study.scene) if quantity.falls else nan,
                "best on amplifier": best.confirmed * scale if best else nan,
                "best on full": best.full * scale if best else nan,
            }
        )
    return found


def lifted(found: Sequence[Change]) -> list[Row]:
    """A row for each limit: its verdict and interval for each quantity."""
    rows = []
    for name in words.largest(found):
        row: Row = {"limit": name}
        for change in (change for change in found if change.limit.name == name):
            title = QUANTITIES[change.quantity].name
            told = f"{change.verdict}: {words.interval(change)}" if change.every else "-"
            row[title] = told
        rows.append(row)
    return rows


def at_row(there: There, limits: Sequence[Limit]) -> Row:
    """A scene's own setting and what it would do without each limit."""
    own = there.own.numbers.get("v_average", nan) * 1e3
    row: Row = {"scene": there.scene.name, "v_average [mm/s]": own, "coil's heat [W]": there.heat}
    for limit in judged(limits):
        row[limit.name] = cost(there, limit) * 1e3
    return row


def cost(there: There, limit: Limit) -> float:
    """The change of v_average, m/s, when a limit is lifted at a scene's own setting."""
    after, before = (
        outcomes[limit.name].numbers.get("v_average", nan)
        for outcomes in (there.lifted, there.against)
    )
    return after - before
