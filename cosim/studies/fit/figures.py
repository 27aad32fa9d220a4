"""The figure of a fit: each trial, measured and predicted."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

from cosim.files.picture import Picture, grid
from cosim.studies.fit.results import Shown, headline
from cosim.studies.plots import legend

SURFACE, MEASURED, SIMULATED = "#8fb8da", "0.15", "#d1495b"
DASHED = (0, (4, 1.2))


def trials(shown: Sequence[Shown], result: dict[str, Any]) -> Picture:
    """Measured heights of part and surface, and each slide as predicted, or the whole path with
    published parameters; a panel for each trial."""
    fitted = result["parameters"] == "fitted"
    columns = min(2, len(shown))
    figure, axes = grid(len(shown), columns, 6.5 * columns, 2.35, 1.0)
    said = "part, predicted in each slide" if fitted else "part, simulated"
    for axis, one, row in zip(axes, shown, result["trials"], strict=True):
        for time, z, label, color, width, dashes in (
            (one.time, one.z_surface, "surface, measured", SURFACE, 0.8, "-"),
            (one.time, one.z_part, "part, measured", MEASURED, 1.3, "-"),
            (*one.simulated, said, SIMULATED, 2.0, DASHED),
        ):
            axis.plot(time * 1e3, z * 1e3, label=label, color=color, lw=width, ls=dashes)
        axis.set(xlim=(0, one.time[-1] * 1e3), ylabel="height [mm]")
        title = _slides(row) if fitted else _whole_path(row)
        axis.set_title(f"{one.name}: {title}", loc="left", fontsize=10)
    for axis in axes[-columns:]:
        axis.set_xlabel("time [ms]")
    legend(figure, axes[:1], loc="outside lower center", ncols=3)
    if fitted:
        title = headline(result)
    else:
        title = (
            f"Trials with published parameters: µ_k {result['mu_k']:.3g}; mean error "
            f"{result['mean_error_mm']:.3f} mm, {result['mean_error_percent']:.2f} %"
        )
    figure.suptitle(fill(title, 60 * columns), fontsize=12)
    return figure


def _slides(row: dict[str, Any]) -> str:
    count = f"{row['slides']} slide{'' if row['slides'] == 1 else 's'}"
    if row["normal_force_weights"] is None:
        return f"not determined: {count}"
    return (
        f"F_n {row['normal_force_weights']:.2f} m·g from {count}, misfit {row['misfit_um']:.1f} µm "
        f"(noise {row['noise_um']:.1f} µm)"
    )


def _whole_path(row: dict[str, Any]) -> str:
    return (
        f"error {row['mean_error_mm']:.3f} mm, {row['mean_error_percent']:.1f} %; "
        f"F_n {row['normal_force_weights']:.2f} m·g"
    )
