"""The paper's figures 3 and 4, drawn from the corrected closed forms."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cosim.drive.surface import formulas
from cosim.drive.surface.formulas import GRAVITY
from cosim.drive.surface.waveforms import Cycle, optimal_cycle

Array = npt.NDArray[np.float64]

# The colours of surface and part in all of the bench's figures.
SURFACE, PART, STICKING = "#1f6fb2", "#d1495b", "#f4e3c1"
CURVES = ("#8d99ae", "#1f6fb2", "#2a9d8f", "#e9a03b")
POINTS = 400


def draw_cycle(
    path: Path,
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    gravity: float = GRAVITY,
) -> None:
    """Figure 3: one period of the optimal waveform, surface and part, into ``path`` (a PNG)."""
    cycle = optimal_cycle(mu_s, mu_k, a_max, f_n, period, gravity=gravity)
    mean = formulas.average_velocity(mu_s, mu_k, a_max, f_n, period, gravity=gravity)
    slowed = formulas.slipping_acceleration(mu_k, f_n, -1.0, gravity)
    figure = Figure(figsize=(8.4, 8.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 1, sharex=True)
    _accelerations(axes[0], cycle, slowed, gravity)
    _motions(axes[1], axes[2], cycle, slowed)
    for axis in axes:
        _phases(axis, cycle)
        axis.grid(alpha=0.25)
    _name_phases(axes[0], axes[1], cycle)
    axes[2].set(xlabel="time [ms]", xlim=(0.0, period * 1e3))
    figure.suptitle(
        f"Optimal waveform: the part moves at {mean * 1e3:+.2f} mm/s "
        f"({mean / (gravity * period):.4f} gT)\n{_case(mu_s, mu_k)}, "
        f"F$_n$ = {f_n:g} m$_P$g, a$_{{max}}$ = {a_max / gravity:g} g, T = {period * 1e3:.5g} ms",
        fontsize=12,
    )
    figure.savefig(path, format="png")


def _accelerations(axis: Axes, cycle: Cycle, slowed: float, gravity: float) -> None:
    edges = np.repeat(cycle.times, 2)[1:-1] * 1e3
    surface = np.repeat(cycle.accelerations, 2) / gravity
    part = np.repeat([cycle.accelerations[0], slowed, slowed], 2) / gravity
    axis.plot(edges, surface, color=SURFACE, lw=1.4, label="surface")
    axis.plot(edges, part, color=PART, lw=1.8, ls=(0, (5, 2)), label="part")
    axis.set_ylabel("acceleration [g]")


def _motions(velocity: Axes, height: Axes, cycle: Cycle, slowed: float) -> None:
    """Velocities and heights; the end of the period is its own time, not the next one's start."""
    time = np.linspace(0.0, cycle.times[3], POINTS)
    knots = cycle.knots()
    surface = np.interp(time, *knots)
    loose = np.maximum(time - cycle.times[1], 0.0)
    stuck = np.minimum(time, cycle.times[1])
    part = knots[1][0] + cycle.accelerations[0] * stuck + slowed * loose
    travelled = knots[1][0] * time + cycle.accelerations[0] * stuck * (0.5 * stuck + loose)
    travelled += 0.5 * slowed * loose**2
    for axis, first, second in (
        (velocity, surface, part),
        (height, cycle.position(time), travelled),
    ):
        axis.plot(time * 1e3, first * 1e3, color=SURFACE, lw=1.4)
        axis.plot(time * 1e3, second * 1e3, color=PART, lw=1.8, ls=(0, (5, 2)))
    velocity.set_ylabel("velocity [mm/s]")
    height.set_ylabel("height [mm]")


def _phases(axis: Axes, cycle: Cycle) -> None:
    sticking = (0.0, cycle.times[1] * 1e3)
    axis.axvspan(*sticking, color=STICKING, alpha=0.6, lw=0, zorder=0, label="sticking")
    for time in cycle.times[1:3]:
        axis.axvline(time * 1e3, color="0.35", lw=0.9, ls=":")


def _name_phases(above: Axes, between: Axes, cycle: Cycle) -> None:
    """The values of T1 and T2 with the legend, and their names above the lines."""
    first, second = (time * 1e3 for time in cycle.times[1:3])
    title = f"T$_1$ = {first:.5g} ms, T$_2$ = {second:.5g} ms"
    above.set_title(title, loc="left", fontsize=10.5)
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=3, fontsize=9, frameon=False)
    near = second - first < 0.05e3 * cycle.times[3]
    for name, time, side in (("1", first, "right"), ("2", second, "left")):
        between.text(
            time,
            1.015,
            f"T$_{name}$",
            transform=between.get_xaxis_transform(),
            ha=side if near else "center",
            fontsize=10,
        )


def draw_velocities(
    path: Path,
    mu_s: float,
    mu_k: float,
    peaks: Sequence[float],
    period: float,
    gravity: float = GRAVITY,
) -> None:
    """Figure 4: v_ave over the normal force for several a_max, m/s², into ``path`` (a PNG)."""
    figure = Figure(figsize=(9.0, 6.0), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    for peak, color in zip(peaks, CURVES, strict=False):
        _curve(axis, mu_s, mu_k, peak, period, gravity, color)
    axis.grid(alpha=0.25)
    axis.axhline(0.0, color="0.5", lw=0.8, zorder=1)
    axis.set(
        xlabel="normal force F$_n$/(m$_P$g) [1]",
        ylabel="mean velocity of the part v$_{ave}$ [mm/s]",
        xlim=(0.0, None),
    )
    scale = gravity * period * 1e3
    right = axis.twinx()
    low, high = axis.get_ylim()
    right.set(ylim=(low / scale, high / scale), ylabel="v$_{ave}$/(gT) [1]")
    figure.legend(
        handles=_legend(axis), loc="outside lower center", ncols=4, fontsize=9, frameon=False
    )
    axis.set_title(
        f"Fastest transport upwards: {_case(mu_s, mu_k)}, T = {period * 1e3:.5g} ms", fontsize=12
    )
    figure.savefig(path, format="png")


def _curve(
    axis: Axes,
    mu_s: float,
    mu_k: float,
    peak: float,
    period: float,
    gravity: float,
    color: str,
) -> None:
    sticking = formulas.largest_force_ratio_sticking(mu_s, peak, gravity)
    sliding = formulas.largest_force_ratio_sliding(mu_k, peak, gravity)
    best = formulas.optimal_force_ratio(mu_s, mu_k, peak, gravity)

    def velocity(forces: npt.ArrayLike) -> Array:
        pairs = (formulas.horizontal_equivalent(mu_s, mu_k, f) for f in np.atleast_1d(forces))
        speeds = [_speed(pair, peak, period, gravity) for pair in pairs]
        return np.array(speeds) * 1e3

    allowed = np.linspace(formulas.least_force_ratio(mu_s), sticking, POINTS)
    beyond = np.linspace(sticking, sliding, POINTS)
    axis.plot(
        allowed, velocity(allowed), color=color, lw=1.8, label=f"a$_{{max}}$ = {peak / gravity:g} g"
    )
    axis.plot(beyond, velocity(beyond), color=color, lw=1.1, ls=(0, (4, 3)))
    axis.plot([sticking] * 2, [0.0, velocity(sticking)[0]], color=color, lw=0.8, ls=":")
    axis.plot(best, velocity(best), "o", color=color, ms=6)
    axis.plot(sticking, velocity(sticking), "s", color=color, ms=5.5)
    axis.plot(sliding, 0.0, "v", color=color, ms=6.5, clip_on=False, zorder=3)


def _speed(pair: formulas.Friction, peak: float, period: float, gravity: float) -> float:
    """The formula of v_ave, m/s, with its value 0 at both its ends, where rounding may miss it."""
    if pair.static <= 0.0 or pair.kinetic >= peak / gravity:
        return 0.0
    return formulas.horizontal_velocity(*pair, peak, period, gravity)


def _legend(axis: Axes) -> list[Line2D]:
    curves = [line for line in axis.get_lines() if not str(line.get_label()).startswith("_")]
    grey = "0.35"
    return [
        *curves,
        Line2D([], [], color=grey, marker="o", ls="", label="f$_{opt}$"),
        Line2D([], [], color=grey, marker="s", ls="", label="f$_{max}$ of a part that sticks"),
        Line2D([], [], color=grey, marker="v", ls="", label="f$_{n,max}$ of a part that slides"),
        Line2D([], [], color=grey, lw=1.1, ls=(0, (4, 3)), label="the formula beyond f$_{max}$"),
    ]


def _case(mu_s: float, mu_k: float) -> str:
    return f"µ$_s$ = {mu_s:g}, µ$_k$ = {mu_k:g}"
