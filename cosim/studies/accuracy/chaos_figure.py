"""The diagram of a chaotic scene: each method's statistics, with the spread of its ensemble."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole

if TYPE_CHECKING:
    from cosim.studies.accuracy.chaos import Ensemble

_LABELS = {
    "v_average": ("mean velocity [mm/s]", 1e3),
    "stick_fraction": ("share of sticking [%]", 1e2),
    "impacts": ("impacts", 1.0),
    "stick_slip_events": ("changes of stick and slip", 1.0),
}


def draw(ensembles: Sequence["Ensemble"], growth: float, folder: Path) -> None:
    """Write ``chaos.png`` into ``folder``."""
    figure = Figure(figsize=(11.0, 3.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(_LABELS), sharey=True)
    places = list(range(len(ensembles)))[::-1]
    for axis, (statistic, (label, scale)) in zip(axes, _LABELS.items(), strict=True):
        for place, one in zip(places, ensembles, strict=True):
            values = [scale * v for v in one.values[statistic]]
            middle, error = (scale * v for v in one.mean(statistic))
            axis.plot(values, [place] * len(values), "|", color="0.6", ms=9)
            axis.errorbar(
                middle, place, xerr=2.0 * error, fmt="o", color="#d1495b", ms=5, capsize=4, lw=2
            )
        axis.set_xlabel(label)
        axis.set_ylim(-0.6, len(ensembles) - 0.4)
        axis.grid(alpha=0.3)
    axes[0].set_yticks(places, [one.name for one in ensembles])
    figure.suptitle(
        f"Chaotic: a small difference grows {growth:.0e} times, so only statistics are compared "
        "(one tick a run; dot: mean with two standard errors)",
        fontsize=10,
    )
    with whole(folder / "chaos.png") as temporary:
        figure.savefig(temporary, format="png")
