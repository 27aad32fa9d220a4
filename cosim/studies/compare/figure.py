"""The figure of a comparison: surface and part, measured and simulated, frame by frame."""

from typing import Any

from matplotlib.axes import Axes

from cosim.files.picture import Picture
from cosim.studies.compare.compare import Metrics
from cosim.trials.camera import Frames
from cosim.waveforms.figure import PART, SURFACE

MEASURED: dict[str, Any] = {
    "color": "0.25",
    "lw": 0.0,
    "marker": ".",
    "ms": 3.0,
    "label": "measured",
}


def draw(simulated: Frames, measured: Frames, metrics: Metrics, title: str) -> Picture:
    """Heights and velocities over time, of surface and part."""
    figure = Picture(13.0, 7.2, "constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for column, (body, color) in enumerate((("surface", SURFACE), ("part", PART))):
        for row, (kind, unit) in enumerate((("z", "mm"), ("v", "mm/s"))):
            axis: Axes = axes[row, column]
            own: dict[str, Any] = {"color": color, "lw": 1.4, "label": "simulated"}
            sides: list[tuple[Frames, dict[str, Any]]] = [(measured, MEASURED), (simulated, own)]
            for frames, style in sides:
                values = getattr(frames, f"{kind}_{body}")
                first = values[0] if kind == "z" else 0.0
                axis.plot(frames.time * 1e3, (values - first) * 1e3, **style)
            axis.grid(alpha=0.25)
            axis.set_ylabel(f"{'height' if kind == 'z' else 'velocity'} of the {body} [{unit}]")
    for axis in axes[1]:
        axis.set_xlabel("time [ms]")
    axes[0, 0].set_title(
        f"velocity R² {metrics.velocity_r2:.2f}; largest change from frame to frame "
        f"{metrics.kick_simulated * 1e3:.0f} mm/s (measured {metrics.kick_measured * 1e3:.0f})",
        fontsize=10,
        loc="left",
    )
    axes[0, 1].set_title(
        f"mean error {metrics.mean_error_mm:.3f} mm ({metrics.mean_error_percent:.1f} %); drift "
        f"{metrics.drift_simulated * 1e3:+.1f} mm/s (measured {metrics.drift_measured * 1e3:+.1f})",
        fontsize=10,
        loc="left",
    )
    axes[0, 1].legend(loc="upper left", fontsize=8)
    figure.suptitle(title, fontsize=12)
    return figure
