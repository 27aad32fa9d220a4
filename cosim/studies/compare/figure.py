"""The figure of a comparison: every measured signal and the simulated one, over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cosim.files.picture import Picture
from cosim.studies.compare.compare import Found
from cosim.studies.compare.scores import R2
from cosim.studies.plots import headline
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.figure import DRIVE, PART, SURFACE
from cosim.waveforms.quantities import signed

PANELS = (
    (("z_surface", SURFACE), ("v_surface", SURFACE)),
    (("z_part", PART), ("v_part", PART)),
    (("command", DRIVE), ("current", DRIVE), ("coil_voltage", DRIVE)),
)
"""Signals and colours of the panels, column by column."""

SCALED = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s")}
"""Units that a panel shows in another one: the factor and the shown unit."""


def draw(title: str, found: Found) -> Picture:
    """A column of panels for each body that was measured, and one for the circuit."""
    columns = [[p for p in column if p[0] in found.simulated] for column in PANELS]
    columns = [column for column in columns if column]
    rows = max(map(len, columns))
    figure = Picture(6.5 * max(len(columns), 1.4), 1.0 + 3.1 * rows, "constrained")
    axes = figure.subplots(rows, len(columns), sharex=True, squeeze=False)
    for k, column in enumerate(columns):
        for axis, panel in zip(axes[:, k], column, strict=False):
            _panel(axis, *panel, found)
        for axis in axes[len(column) :, k]:
            axis.set_visible(False)
        axes[len(column) - 1, k].set_xlabel("time [ms]")
        axes[len(column) - 1, k].tick_params(labelbottom=True)
    kinds = (Line2D([], [], color="0.25", ls="", marker="."), Line2D([], [], color="0.25", lw=1.4))
    words = ("measured: dots", "simulated: lines, in the body's colour")
    figure.legend(kinds, words, loc="outside lower center", ncols=2)
    headline(figure, f"{title}: {_message(found)}".replace("$", "\\$"))
    return figure


def _message(found: Found) -> str:
    """In words, the first R² of the comparison and the error of the part's mean velocity."""
    numbers = found.values
    said = [
        f"explains {_share(share)} of the variance of the {words}"
        for name, words in R2.values()
        if (share := numbers.get(name)) is not None
    ][:1]
    if (error := numbers.get("drift_error")) is not None:
        said.append(f"misses the part's mean velocity by {signed(1e3 * error, '+.1f')} mm/s")
    return f"the run {' and '.join(said)}" if said else "nothing to be told"


def _share(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share > 0.0 else "nothing"


def _panel(axis: Axes, name: str, color: str, found: Found) -> None:
    scale, unit = SCALED.get(COLUMNS[name].unit, (1.0, COLUMNS[name].unit))
    time, measured = found.recording.time * 1e3, found.recording.signals[name]
    # Dots of a long recording cover each other, and the run's line.
    size = 3.0 if len(time) < 2000 else 1.0
    for values, style in (
        (measured, {"color": "0.25", "ls": "", "marker": ".", "ms": size}),
        (found.simulated[name], {"color": color, "lw": 1.4}),
    ):
        first = values[np.isfinite(measured)][0] if name.startswith("z") else 0.0
        axis.plot(time, (values - first) * scale, **style)
    axis.grid(alpha=0.25)
    axis.set_ylabel(f"{COLUMNS[name].text} [{unit}]")
    axis.set_title(_words(name, found), fontsize=10, loc="left")


WORDS = {
    "z_part": ("mean_error_mm", "mean error from the first row {:.3f} mm", " (ceiling {:.3f})")
}
WORDS |= {name: (score, "R² {:.2f}", " (ceiling {:.2f})") for name, (score, _) in R2.items()}
"""For a panel's signal: its score, and the words for its value and for its ceiling."""
BOTH = {
    "z_part": ("drift", "mean velocity {:+.1f} mm/s (measured {:+.1f})"),
    "v_surface": ("kick", "largest change {:.0f} mm/s (measured {:.0f})"),
}
"""For a panel's signal: a number that both sides have, and the words for it, in mm/s."""


def _words(name: str, found: Found) -> str:
    """A panel's title: the score of its signal, and the number that both sides have."""
    numbers = found.values
    said = []
    if name in WORDS:
        score, words, beside = WORDS[name]
        run, ceiling = numbers[score], numbers[f"{score}_ceiling"]
        if run is not None:
            said.append(words.format(run) + ("" if ceiling is None else beside.format(ceiling)))
    if name in BOTH:
        number, words = BOTH[name]
        sides = (numbers[f"{number}_{side}"] or 0.0 for side in ("simulated", "measured"))
        said.append(words.format(*(1e3 * value for value in sides)))
    return "\n".join(said)
