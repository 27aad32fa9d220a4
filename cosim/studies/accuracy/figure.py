"""The work-precision diagrams of the accuracy study."""

from collections.abc import Sequence
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cosim.files.atomic import whole
from cosim.studies.accuracy.cases import CASES

if TYPE_CHECKING:
    from cosim.studies.accuracy.accuracy import Run

# Colour, line style and width by the beginning of a method's name.
_STYLES = {
    "step-locked (default), both": ("#d1495b", "-", 2.8),
    "step-locked (default), reltol": ("#d1495b", (0, (3, 1)), 1.8),
    "step-locked (default), max_step": ("#d1495b", (0, (1, 1)), 1.8),
    "Jacobi k = 0": ("#a9cbe6", "-", 1.2),
    "Jacobi k = 1": ("#5b9bd0", "-", 1.2),
    "Jacobi k = 2": ("#1f4e79", "-", 1.2),
    "Gauss-Seidel k = 0": ("#f5cfa5", "-", 1.2),
    "Gauss-Seidel k = 1": ("#e8963f", "-", 1.2),
    "Gauss-Seidel k = 2": ("#8a4a10", "-", 1.2),
    "held EMF, mean current": ("#b9dfc4", "-", 1.2),
    "EMF's slope, mean current": ("#3a8f5c", "-", 1.2),
    "companion": ("#7d3c98", "-", 1.4),
    "iterated, Newton": ("#c39bd3", "-", 1.2),
    "iterated, Aitken": ("#c39bd3", (0, (3, 1)), 1.2),
    "iterated, Anderson": ("#c39bd3", (0, (1, 1)), 1.6),
    "predictor-corrector": ("#e377a8", "-", 1.4),
    "event-aware": ("#16a2a2", "-", 1.6),
    "error-controlled": ("#806000", "-", 1.2),
    "error-controlled, audited": ("#806000", (0, (1, 1)), 1.6),
    "gauss-seidel in ngspice": ("#e8963f", (0, (1, 1)), 1.6),
    "companion in ngspice": ("#7d3c98", (0, (1, 1)), 1.6),
    "all in ngspice": ("0.15", "-", 2.2),
    "SciPy's LSODA with events": ("0.5", "-", 2.2),
}


def draw(runs: Sequence["Run"], folder: Path) -> None:
    """Write ``accuracy.png`` (over CPU time) and ``accuracy-steps.png`` (over circuit steps)."""
    for name, label in (("accuracy", "CPU time [s]"), ("accuracy-steps", "steps of the circuit")):
        figure = Figure(figsize=(12.0, 10.4), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        cases = list(dict.fromkeys(run.case for run in runs))
        axes = (
            figure.subplots(2, 2, squeeze=False)
            if len(cases) > 1
            else figure.subplots(squeeze=False)
        )
        for axis, case in zip(axes.flat, cases, strict=False):
            _panel(axis, [run for run in runs if run.case == case], name == "accuracy")
            axis.set_title(CASES[case].title, fontsize=11, loc="left")
            axis.set(xlabel=label, ylabel="error / range")
        known = {}
        for axis in axes.flat:
            known |= dict(zip(*axis.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=4, fontsize=9)
        with whole(folder / f"{name}.png") as temporary:
            figure.savefig(temporary, format="png")


def _panel(axis: Axes, runs: Sequence["Run"], over_time: bool) -> None:
    for name, (color, line, width) in _STYLES.items():
        own = [run for run in runs if run.solver.name == name]
        x = [run.seconds if over_time else run.steps or nan for run in own]
        y = [run.error for run in own]
        label = name if own else None
        axis.loglog(x, y, color=color, ls=line, lw=width, marker=".", ms=5, label=label)
        bad = [k for k, run in enumerate(own) if run.failure and not isnan(run.error)]
        axis.loglog([x[k] for k in bad], [y[k] for k in bad], "x", color=color, ms=8, mew=2)
    axis.plot([], [], "x", color="0.3", ms=8, mew=2, label="diverged or not monotone")
    axis.grid(alpha=0.3)
