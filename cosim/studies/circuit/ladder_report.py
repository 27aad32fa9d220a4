"""The ladder in words, a table and a figure."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.scene import Scene
from cosim.studies.circuit.ladder import Rung, cheapest
from cosim.studies.plots import GREEN, panels
from cosim.studies.tables import Row, brief, write_csv, write_page

Found = Sequence[tuple[Scene, list[Rung]]]


def write(folder: Path, found: Found) -> str:
    """Write ladder.csv, .md and .png into ``folder``; gives what is printed."""
    said = [words(scene, rungs) for scene, rungs in found]
    table = [row for pair in found for row in rows(*pair)]
    write_csv(folder / "ladder.csv", table)
    notes = [f"{message(found)}.", *said]
    write_page(folder / "ladder.md", "The ladder of circuits", notes, {"Each rung": table})
    draw(found, folder / "ladder.png")
    printed: list[str] = []
    for (_, rungs), sentence in zip(found, said, strict=True):
        lines = [
            f"  {rung.model:<10}{rung.cost[0]:9.3g} s per simulated s {rung.v_average * 1e3:+9.3f} "
            f"mm/s {rung.off_amplifier:9.3%} off the amplifier {rung.off_top:9.3%} off the top"
            for rung in rungs
        ]
        printed += [sentence, "", *lines, ""]
    return "\n".join([*printed, f"Written to {folder}: ladder.csv, ladder.md, ladder.png"])


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
