"""The ladder as a study: in words, a table and a figure."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from cosim.evaluate.store import Store
from cosim.scene import Scene, load
from cosim.scene.loading import Overrides
from cosim.studies.circuit.ladder import Rung, cheapest, runs_in_all
from cosim.studies.circuit.ladder import ladder as each_rung
from cosim.studies.plots import GREEN, panels
from cosim.studies.report import Progress, Report, counted, silent
from cosim.studies.tables import Row, brief

Found = Sequence[tuple[Scene, list[Rung]]]

STORE = "ladder.sqlite"


def ladder(
    scenes: Sequence[Scene | str | os.PathLike[str]] = ("paper",),
    overrides: Overrides | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
) -> Report:
    """Run scenes on each rung of the circuit in turn: what each costs, and how far its v_average is
    from the top's and the amplifier's.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput and
    SimulationFailed.
    """
    every = [load(scene, overrides) for scene in scenes]
    tick = counted(progress, runs_in_all() * len(every))
    path = None if out is None else Path(out) / STORE
    with Store(path, [scene.as_dict() for scene in every]) as store:
        found = report([(scene, each_rung(scene, store, tick)) for scene in every])
        if out is not None:
            found.save(out)
        store.remove()
    return found


def report(found: Found) -> Report:
    """Which circuit each scene needs, and what it costs."""
    said = [words(scene, rungs) for scene, rungs in found]
    table = [row for pair in found for row in rows(*pair)]
    printed: list[str] = []
    for (_, rungs), sentence in zip(found, said, strict=True):
        lines = [
            f"  {rung.model:<10}{rung.cost[0]:9.3g} s per simulated s {rung.v_average * 1e3:+9.3f} "
            f"mm/s {rung.off_amplifier:9.3%} off the amplifier {rung.off_top:9.3%} off the top"
            for rung in rungs
        ]
        printed += [sentence, "", *lines, ""]
    notes, figures = [f"{message(found)}.", *said], {"": partial(draw, found)}
    return Report(
        "ladder", "The ladder of circuits", table, notes, {"Each rung": table}, figures,
        "\n".join(printed),
    )  # fmt: skip


def rows(scene: Scene, rungs: list[Rung]) -> list[Row]:
    """The table of one scene."""
    return [
        {
            "scene": scene.name,
            "circuit.model": rung.model,
            "computing per simulated second [s]": rung.cost[0],
            "least [s]": rung.cost[1],
            "most [s]": rung.cost[2],
            "v_average [mm/s]": rung.v_average * 1e3,
            "off the amplifier [%]": 100.0 * rung.off_amplifier,
            "off the top [%]": 100.0 * rung.off_top,
            "peak downward acceleration [m/s2]": rung.fall,
        }
        for rung in rungs
    ]


def words(scene: Scene, rungs: list[Rung]) -> str:
    """The cheapest rung within the scene's tolerance, and why."""
    tolerance = scene.run.tolerance
    by_model = {rung.model: rung for rung in rungs}
    top, amplifier, limited = (by_model[name] for name in ("full", "amplifier", "limited"))
    taken = cheapest(rungs, tolerance)
    said = [
        f"{scene.name}: within {tolerance:.2g} of the top the cheapest rung is {taken.model}, at "
        f"{taken.cost[0]:.2g} s a simulated second where the top takes {top.cost[0]:.2g} s."
    ]
    if amplifier.off_top > tolerance:
        said.append(
            f"The behavioural amplifier is {amplifier.off_top:.2%} off: it has neither the data "
            "sheet's output stage, whose swing loss grows with the current, nor the firmware's "
            "staircase."
        )
    near = [rung for rung in rungs[:2] if rung.off_amplifier <= tolerance]
    if near:
        said.append(
            f"Against the amplifier, {near[0].model} is {near[0].off_amplifier:.2%} off, at "
            f"{amplifier.cost[0] / near[0].cost[0]:.3g} times less cost."
        )
    else:
        said.append(f"Against the amplifier, limited is {limited.off_amplifier:.2%} off: too far.")
    return " ".join(said)


def draw(found: Found, path: Path) -> None:
    """Draw error over cost, a panel a scene, and mark the cheapest rung within the tolerance."""
    wide = min(len(found), 3)
    high = -(-len(found) // wide)
    errors = [rung.off_top for _, rungs in found for rung in rungs]
    top = 200.0 * max(*errors, *(scene.run.tolerance for scene, _ in found))
    size = (max(3.8 * wide, 6.0), 3.4 * high + 0.6)
    note = "Green: the cheapest rung within run.tolerance, which is shaded."
    figure, axes = panels(message(found), note, size, high, wide, sharex=True, sharey=True)
    for axis, (scene, rungs) in zip(axes, found, strict=False):
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
        axis.set(xlabel="computing per simulated second [s]", ylim=(-0.03, top))
        axis.margins(x=0.35)
    axes[0].set_ylabel("error of v_average against “full” [%]")
    figure.write(path)


def message(found: Found) -> str:
    """The title of the figure."""
    by_model: dict[str, list[str]] = {}
    for scene, rungs in found:
        taken = cheapest(rungs, scene.run.tolerance)
        less = f" ({brief(rungs[-1].cost[0] / taken.cost[0])} times cheaper)"
        said = scene.name + (less if taken is not rungs[-1] else "")
        by_model.setdefault(taken.model, []).append(said)
    needed = [f"{' and '.join(scenes)} on {model}" for model, scenes in by_model.items()]
    return f"The cheapest rung that keeps the tolerance: {', '.join(needed)}"
