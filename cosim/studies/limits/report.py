"""The whole study, and limits.csv, limits.md and the figures that it leaves."""

from collections.abc import Callable, Sequence
from math import nan
from pathlib import Path

from cosim.scene import Scene
from cosim.studies.limits import answer, figures
from cosim.studies.limits.aims import QUANTITIES
from cosim.studies.limits.answer import Change, changes, height
from cosim.studies.limits.at import There, acting, at
from cosim.studies.limits.confirm import Point, Points, confirmed, judged
from cosim.studies.limits.runs import Bench
from cosim.studies.limits.study import FULL, IDEAL, OWN, Efforts, Study, study, told_count
from cosim.studies.limits.table import LIMITS, Limit, Settings, needed_acceleration
from cosim.studies.tables import Row, write_csv, write_page


def write(folder: Path, bench: Bench, study: Study, points: Points, there: Sequence[There]) -> str:
    """Write the tables and figures into ``folder``; gives what is printed."""
    found = changes(study, points)
    said = [text for text in answer.paragraphs(study, points, found) if text]
    if not_held := answer.refuted(points):
        said.append(
            f"Of {len(points)} points the more complete circuit does not confirm {len(not_held)} "
            "within 2 %; limits.csv has both values."
        )
    if sought := answer.sought(points):
        said.append(
            "Best points sought on the more complete circuit itself, since it refuted all good "
            f"settings of the cheapest one: {len(sought)}."
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
            "": QUANTITIES[point.quantity].title,
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
                "best on amplifier": best.confirmed * scale if best else nan,
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


def run(
    folder: Path,
    scene: Scene,
    asked: str,
    rigs: Sequence[Settings] = (),
    there: Sequence[Scene] = (),
    *,
    seed: int = 0,
    efforts: Efforts = FULL,
    limits: Sequence[Limit] = LIMITS,
    workers: int | None = None,
    dask: str | None = None,
    told: Callable[[int, str], object] = lambda steps, name: None,
    progress: Callable[[], object] = lambda: None,
) -> str:
    """Search, confirm, lift at the scenes ``there``, and write ``limits.*`` into ``folder``; gives
    what is printed. The store beside them, from which a killed study goes on, is gone at the end.

    ``asked`` are the words after ``cosim run`` that stand for the scene; ``told`` hears of each
    step, and how many there are, ``progress`` of each run. Raises BadInput.
    """
    steps = told_count(limits, efforts, len(rigs)) + 2 + len(there)

    def done(name: str) -> None:
        told(steps, name)

    with Bench(scene, asked, folder / STORE, workers, dask, progress) as bench:
        found = study(bench, rigs, limits, seed, efforts, done)
        points = confirmed(bench, found, done)
        points |= judged(bench, found, points, done)
        words = write(folder, bench, found, points, at(bench, there, limits, done))
        bench.evaluator.forget()
    return words
