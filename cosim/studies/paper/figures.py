"""The paper's figures 3 and 4 from the corrected closed forms, with its printed values marked."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cosim.arrays import Array
from cosim.drive.surface import formulas
from cosim.drive.surface.formulas import Transport
from cosim.drive.surface.waveforms import Cycle, optimal_cycle
from cosim.files.picture import Picture, grid, legend_above
from cosim.studies.plots import headline, panels
from cosim.waveforms.figure import PART, STICKING, SURFACE

GUIDELINE = (4.0, 16.0)
"""The paper's range for µ_s F_n, in weights of the part."""
CURVES = ("#8d99ae", "#1f6fb2", "#2a9d8f", "#e9a03b")
DASHED, BEYOND = (0, (5, 2)), (0, (4, 3))  # dash patterns: of the part; beyond the limit f_max
OPTIMA = "line of optima"
POINTS = 400  # of a drawn curve


def draw_cycle(case: Transport) -> Picture:
    """Figure 3: one period of the optimal waveform, surface and part."""
    cycle, mean, gravity = optimal_cycle(case), formulas.average_velocity(case), case.gravity
    slowed = formulas.slipping_acceleration(case.mu_k, case.f_n, -1.0, gravity)
    title = (
        f"Sticking while the surface accelerates at {cycle.accelerations[0] / gravity:.3g} g, "
        f"slipping while it brakes at {case.a_max / gravity:.3g} g, the part moves at "
        f"{mean * 1e3:+.2f} mm/s"
    )
    note = (
        f"The optimal waveform. {_friction(case)}, F$_n$ = {case.f_n:g} m$_P$g, "
        f"T = {case.period * 1e3:.5g} ms; {mean / (gravity * case.period):.4f} gT"
    )
    figure, axes = panels(title, note, (8.4, 8.6), 3, 1, sharex=True)
    _motion(axes, cycle, slowed, gravity)
    sticking = (0.0, cycle.times[1] * 1e3)
    for axis in axes:
        axis.axvspan(*sticking, color=STICKING, alpha=0.6, lw=0, zorder=0, label="sticking")
        for time in cycle.times[1:3]:
            axis.axvline(time * 1e3, color="0.35", lw=0.9, ls=":")
    first, second = (time * 1e3 for time in cycle.times[1:3])
    dotted = f"T$_1$ = {first:.5g} ms, T$_2$ = {second:.5g} ms (dotted)"
    axes[0].set_title(dotted, loc="left", fontsize=10.5)
    legend_above(axes[0], ncols=3, columnspacing=1.1, handlelength=1.6, fontsize=9)
    axes[2].set(xlabel="time [ms]", xlim=(0.0, case.period * 1e3))
    return figure


def _motion(axes: Sequence[Axes], cycle: Cycle, slowed: float, gravity: float) -> None:
    """Draw accelerations, velocities and heights of surface and part over one period.

    The part sticks up to the first knot, and is then slowed at ``slowed``, m/s²: its path is
    integrated piecewise from the time that it has stuck and the time since then, ``loose``."""
    time, knots = np.linspace(0.0, cycle.times[3], POINTS), cycle.knots()
    first = cycle.accelerations[0]
    loose = np.maximum(time - cycle.times[1], 0.0)
    stuck = np.minimum(time, cycle.times[1])
    velocity = knots[1][0] + first * stuck + slowed * loose
    height = knots[1][0] * time + first * stuck * (0.5 * stuck + loose)
    height += 0.5 * slowed * loose**2
    # Both ends of each of the three phases, for step-shaped lines.
    edges = np.repeat(cycle.times, 2)[1:-1]
    accelerations = np.repeat([cycle.accelerations, (first, slowed, slowed)], 2, axis=1) / gravity
    for axis, at, surface, part, name in (
        (axes[0], edges, *accelerations, "acceleration [g]"),
        (axes[1], time, np.interp(time, *knots) * 1e3, velocity * 1e3, "velocity [mm/s]"),
        (axes[2], time, cycle.position(time) * 1e3, height * 1e3, "height [mm]"),
    ):
        axis.plot(at * 1e3, surface, color=SURFACE, lw=1.4, label="surface")
        axis.plot(at * 1e3, part, color=PART, lw=1.8, ls=DASHED, label="part")
        axis.set_ylabel(name)


def draw_velocities(case: Transport, peaks: Sequence[float]) -> Picture:
    """Figure 4: v_ave over the normal force for several a_max, m/s²."""
    figure, (axis,) = grid(1, 1, 9.0, 6.0, 0.0)
    axis.axvspan(*(weight / case.mu_s for weight in GUIDELINE), color=STICKING, alpha=0.45, lw=0)
    best = [_curve(axis, case, *pair) for pair in zip(peaks, CURVES, strict=False)]
    ratios, speeds = optima(case, max(peaks))
    axis.plot(ratios, speeds * 1e3, color="0.15", lw=1.3, ls=DASHED, zorder=2, label=OPTIMA)
    axis.axhline(0.0, color="0.5", lw=0.8, zorder=1)
    axis.set(
        xlabel="normal force F$_n$/(m$_P$g) [1]",
        ylabel="mean velocity of the part v$_{ave}$ [mm/s]",
        xlim=(0.0, None),
    )
    scale = case.gravity * case.period * 1e3
    low, high = axis.get_ylim()
    axis.twinx().set(ylim=(low / scale, high / scale), ylabel="v$_{ave}$/(gT) [1]")
    figure.legend(
        handles=_legend(axis), loc="outside lower center", ncols=3, fontsize=9, frameon=False
    )
    note = f"Fastest transport upwards. {_friction(case)}, T = {case.period * 1e3:.5g} ms."
    axis.set_title(note, loc="left", fontsize=9, color="0.35")
    headline(
        figure,
        "The harder the surface accelerates, the faster the part, and the tighter the best grip: "
        f"{min(best):.2g} to {max(best):.2g} times the part's weight",
    )
    return figure


def optima(case: Transport, most: float) -> tuple[Array, Array]:
    """The line of optima: the best f_n and its v_ave, m/s, for each a_max up to ``most``, m/s²."""
    least = formulas.least_peak_acceleration_at_any_force(case.gravity)
    peaks = np.linspace(least * (1 + 1e-6), most, POINTS)
    found = [formulas.force_limits(case, float(peak)) for peak in peaks]
    ratios, speeds = ([row[of] for row in found] for of in ("f_optimal", "v_at_optimal"))
    return np.array(ratios), np.array(speeds)


def _curve(axis: Axes, case: Transport, peak: float, color: str) -> float:
    """Draw v_ave over f_n for the a_max ``peak``, m/s²; returns the best f_n."""
    mu_s, mu_k, gravity = case.mu_s, case.mu_k, case.gravity
    sticking = formulas.largest_force_ratio(mu_s, peak, gravity)
    sliding = formulas.largest_force_ratio(mu_k, peak, gravity)
    best = formulas.optimal_force_ratio(mu_s, mu_k, peak, gravity)

    def speed(f_n: float) -> float:
        """v_ave, mm/s; exactly 0 at both ends of the range of f_n, in spite of rounding."""
        pair = formulas.horizontal_equivalent(mu_s, mu_k, f_n)
        if pair.static <= 0.0 or pair.kinetic >= peak / gravity:
            return 0.0
        return formulas.horizontal_velocity(*pair, peak, case.period, gravity) * 1e3

    allowed = np.linspace(formulas.least_force_ratio(mu_s), sticking, POINTS)
    beyond = np.linspace(sticking, sliding, POINTS)
    label = f"a$_{{max}}$ = {peak / gravity:g} g"
    axis.plot(allowed, [speed(f) for f in allowed], color=color, lw=1.8, label=label)
    axis.plot(beyond, [speed(f) for f in beyond], color=color, lw=1.1, ls=BEYOND)
    axis.plot([sticking] * 2, [0.0, speed(sticking)], color=color, lw=0.8, ls=":")
    axis.plot(best, speed(best), "o", color=color, ms=6)
    axis.plot(sticking, speed(sticking), "s", color=color, ms=5.5)
    axis.plot(sliding, 0.0, "v", color=color, ms=6.5, clip_on=False, zorder=3)
    return best


def _legend(axis: Axes) -> list[Artist]:
    curves = [line for line in axis.get_lines() if not str(line.get_label()).startswith("_")]
    marks = (
        ("o", "f$_{opt}$"),
        ("s", "f$_{max}$ of a part that sticks"),
        ("v", "f$_{n,max}$ as printed: of one that slides"),
    )
    return [
        *curves,
        *(Line2D([], [], color="0.35", marker=mark, ls="", label=words) for mark, words in marks),
        Line2D([], [], color="0.35", lw=1.1, ls=BEYOND, label="the formula beyond f$_{max}$"),
        Patch(color=STICKING, alpha=0.45, label="the paper's guideline, µ$_s$F$_n$ = 4…16 m$_P$g"),
    ]


def _friction(case: Transport) -> str:
    return f"µ$_s$ = {case.mu_s:g}, µ$_k$ = {case.mu_k:g}"
