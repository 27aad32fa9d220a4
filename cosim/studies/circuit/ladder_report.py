"""The ladder in words, a table and a figure."""

from collections.abc import Sequence
from math import nan
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole
from cosim.scene import Scene
from cosim.studies.circuit.ladder import Rung, cheapest
from cosim.studies.study import Row
from cosim.studies.study import write as write_tables

Found = Sequence[tuple[Scene, list[Rung]]]

COLORS = ("#1f6fb2", "#d1495b", "#2a9d8f", "#e9a03b", "#6a4c93", "#333333")

LEAST_SHOWN = 1e-6
"""Least error in the figure."""


def write(folder: Path, found: Found) -> str:
    """Write ladder.csv, .md, .json and .png into ``folder``; gives what is printed."""
    said = [words(scene, rungs) for scene, rungs in found]
    content: dict[str, Sequence[Row]] = {
        "Cost and error of each rung": [row for pair in found for row in rows(*pair)]
    }
    write_tables(folder, "ladder", "Model no more than a scene needs", content, said)
    with whole(folder / "ladder.png") as temporary:
        draw(found, temporary)
    printed: list[str] = []
    for (_, rungs), sentence in zip(found, said, strict=True):
        printed += [sentence, ""]
        printed += [
            f"  {rung.model:<10}{rung.cost[0]:9.3g} s per simulated s {rung.v_average * 1e3:+9.3f} "
            f"mm/s {rung.off_amplifier:9.3%} off the amplifier {rung.off_top:9.3%} off the top"
            for rung in rungs
        ]
        printed.append("")
    printed.append(f"Written to {folder}: ladder.csv, ladder.md, ladder.json")
    return "\n".join([*printed, f"Figure: {folder / 'ladder.png'}"])


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
            "peak downward acceleration [m/s2]": nan if rung.fall is None else rung.fall,
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
    """Draw error over cost, a line for each scene, into ``path`` (a PNG)."""
    figure = Figure(figsize=(11.0, 5.2), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots(1, 2, sharey=True)
    for axis, against in zip(axes, ("amplifier", "full"), strict=True):
        for (scene, rungs), color in zip(found, COLORS * 9, strict=False):
            top = [rung.model for rung in rungs].index(against)
            shown = rungs[:top]
            errors = [
                max(rung.off_amplifier if against == "amplifier" else rung.off_top, LEAST_SHOWN)
                for rung in shown
            ]
            costs = [rung.cost[0] for rung in shown]
            axis.plot(costs, errors, color=color, marker="o", ms=5, label=scene.name)
            for rung, cost, error in zip(shown, costs, errors, strict=True):
                axis.plot(rung.cost[1:], [error, error], color=color, lw=0.8)
                axis.annotate(
                    rung.model, (cost, error), (5, 5), textcoords="offset points", fontsize=8.5
                )
            axis.axvline(rungs[top].cost[0], color=color, lw=0.9, ls=":")
        axis.axhline(found[0][0].run.tolerance, color="#555555", lw=0.9, ls="--")
        axis.set(xscale="log", yscale="log", xlabel="computing per simulated second [s]")
        title = f"Against the rung “{against}” (dotted: its own cost)"
        axis.set_title(title, loc="left", fontsize=10.5)
        axis.grid(alpha=0.25, which="both")
        axis.margins(x=0.12)
    axes[0].set_ylabel("relative error of v_average (dashed: tolerance)")
    axes[0].legend(fontsize=8.5)
    figure.savefig(path, format="png")
