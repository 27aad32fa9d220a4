"""The figure of a run: signals of the circuit, and the motion of the mechanics."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from cosim.arrays import Array, drawable
from cosim.files.picture import Picture, grid, legend_above
from cosim.files.spill import release
from cosim.scene import Scene
from cosim.trials.camera import FRAME_RATE, accelerations, heights
from cosim.waveforms.quantities import printed, signed
from cosim.waveforms.report import asked_for, of_the_trial

SURFACE, PART, RAM, DRIVE, EMF = "#1f6fb2", "#d1495b", "#8d99ae", "#2a9d8f", "#e9a03b"
GRIP, SECOND, STICKING = "#7a5195", "#6fb7e9", "#f4e3c1"
BODIES: dict[str, dict[str, Any]] = {
    "surface": {"color": SURFACE, "lw": 1.2, "label": "surface"},
    "surface_2": {"color": SECOND, "lw": 1.1, "ls": "--", "label": "second"},
    "part": {"color": PART, "lw": 1.6, "label": "part"},
}
PERIODS_SHOWN = 3

LINEAR = 100.0
"""m/s²; the axis of the acceleration is logarithmic beyond it, as impacts are far greater."""
_MOST_ROWS = 200_000
"""Rows of a curve up to which all are drawn; of a longer one the extremes of _STRETCHES parts."""
_STRETCHES = 4000
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw(scene: Scene, waves: dict[str, Array], numbers: dict[str, Any]) -> Picture:
    """The figure of a run: its scene, its columns, and the numbers of its summary."""
    given = scene.surface_is_given
    height = 5.8 if given else 8.2
    figure = Picture(13.0, height)
    axes = figure.subplots(2 if given else 3, 2)
    title, beside = _title(scene, numbers), _measured(scene)
    # Fixed margins, in inches: a layout engine would double the time of a short run.
    top = 1 - (0.85 if beside else 0.62) / height
    figure.subplots_adjust(
        left=0.067, right=0.942, bottom=0.5 / height, top=top, wspace=0.3, hspace=0.4
    )
    shown = _last_periods(scene, waves["time"])
    time = waves["time"][shown] * 1e3
    cut = {name: values[shown] for name, values in waves.items()}

    panels = [_positions, _velocities, _acceleration]
    if not given:
        panels = [_positions, _command, _velocities, _voltages, _acceleration]
    whole, *others = axes.flat
    _whole_run(whole, scene, waves)
    for axis, panel in zip(others, panels, strict=True):
        panel(axis, scene, time, cut)
        axis.set(xlim=(time[0], time[-1]), xlabel="time [ms]")
    for axis in axes.flat:
        axis.grid(alpha=0.25)
    figure.suptitle(title, fontsize=12, y=1 - 0.08 / height, va="top")
    figure.text(0.5, 1 - 0.33 / height, beside, fontsize=10, ha="center", va="top")
    return figure


MOST_PANELS = 12


def draw_own(scene: Scene, waves: dict[str, Array], units: Mapping[str, str]) -> Picture:
    """The figure of a run of a scene with its own FMUs: a panel for each waveform, up to
    MOST_PANELS, over the whole run: first those that are asked for, last constant ones."""
    asked, signals = asked_for(scene), [name for name in waves if name != "time"]
    ranked = sorted(signals, key=lambda name: (np.ptp(waves[name]) == 0.0, name not in asked))
    names = ranked[:MOST_PANELS]
    figure, axes = grid(len(names), 1 if len(names) < 4 else 2, 13.0, 1.9, 1.2)
    for axis, name in zip(axes, names, strict=True):
        times, values = _outline(waves["time"], waves[name])
        axis.plot(times, drawable(values, units[name]), color=SURFACE, lw=0.8)
        if scene.run.settle > 0:
            axis.axvspan(0, scene.run.settle, color="0.93", zorder=0)
        axis.set(
            xlim=(0, scene.run.duration), xlabel="time [s]", ylabel=f"[{printed(units[name])}]"
        )
        axis.set_title(name.replace("$", "\\$"), loc="left", fontsize=10.5)
    words = [scene.description or scene.name]
    words += [f"{len(names)} of {len(signals)} waveforms"] * (len(names) < len(signals))
    words += ["grey: settling"] * (scene.run.settle > 0)
    figure.suptitle("; ".join(words).replace("$", "\\$"), fontsize=12)
    return figure


def _last_periods(scene: Scene, time: Array) -> slice:
    """The rows of the last PERIODS_SHOWN periods; without a period of the last tenth of the run, or
    of all if the surface is given. At most _MOST_ROWS."""
    run = scene.run
    length = scene.period
    if math.isfinite(length):
        span = PERIODS_SHOWN * length
    else:
        span = run.duration if scene.surface_is_given else run.duration / 10
    first = int(np.searchsorted(time, time[-1] - span))
    return slice(max(min(first, len(time) - 2), len(time) - _MOST_ROWS, 0), None)


def _outline(time: Array, values: Array) -> tuple[Array, Array]:
    """A curve of fewer points that covers the same pixels: the smallest and the largest value of
    each of _STRETCHES parts; a curve of at most _MOST_ROWS rows is returned as it is."""
    if len(time) <= _MOST_ROWS:
        return time, values
    starts = np.linspace(0, len(time), _STRETCHES + 1).astype(int)
    found = []
    for begin, end in pairwise(starts.tolist()):
        found.append((time[begin], values[begin:end].min(), values[begin:end].max()))
        release()
    begins, *ends = np.array(found).T
    return np.repeat(begins, 2), np.stack(ends, axis=1).ravel()  # least and greatest alternate


def _title(scene: Scene, numbers: dict[str, Any]) -> str:
    drive = scene.drive
    words = f"{scene.name}: part moves at {signed(numbers['v_average'] * 1e3, '+.2f')} mm/s"
    if drive.file is not None:
        return f"{words}; the surface moves as in {Path(drive.file).name}"
    if scene.surface_is_given:
        limit = f", at most {drive.acceleration_max:.4g} m/s²" if drive.waveform != "sine" else ""
        return f"{words}; the surface is given: {drive.waveform}, {drive.frequency:.4g} Hz{limit}"
    if not scene.rung.driven:
        return f"{words}; no drive"
    late = "" if drive.phase_deg is None else f", second coil {drive.phase_deg:.4g}° late"
    commanded, real = f"{drive.frequency:.4g}", f"{1.0 / scene.period:.4g}"
    rate = f"{real} Hz" if real == commanded else f"{real} Hz ({commanded} Hz commanded)"
    return (
        f"{words}; {drive.waveform} {rate}, {drive.amplitude:.3g} V "
        f"peak-to-peak, offset {drive.offset:+.3g} V{late}, circuit “{scene.circuit.model}”"
    )


def _measured(scene: Scene) -> str:
    """A line with the measured values of the trial that the scene repeats; else empty."""
    number, known = of_the_trial(scene)
    forms = {
        "part's mean velocity": "part {}",
        "surface, peak-to-peak": "surface {} peak-to-peak",
        "surface velocity": "surface {}",
        "as a camera reads it": "read by the camera {}",
    }
    words = [form.format(known[name]) for name, form in forms.items() if name in known]
    return f"measured in trial {number}: {', '.join(words)}" if words else ""


def _whole_run(axis: Axes, scene: Scene, waves: dict[str, Array]) -> None:
    time, height = _outline(waves["time"], waves["z_surface"])
    axis.plot(time, height * 1e3, color=SURFACE, lw=0.5, label="surface")
    time, height = _outline(waves["time"], waves["z_part"])
    axis.plot(time, height * 1e3, color=PART, lw=1.2, label="part")
    if scene.run.settle > 0:
        axis.axvspan(0, scene.run.settle, color="0.93", zorder=0, label="settling")
    axis.set_xlim(0, scene.run.duration)
    axis.set(xlabel="time [s]", ylabel="height [mm]")
    _at_least(axis, 0.01)
    curves, _ = axis.get_legend_handles_labels()
    if "normal_force" in waves:
        right = axis.twinx()
        force = _outline(waves["time"], waves["normal_force"])
        right.plot(*force, color=GRIP, lw=1.0, label="grip (right)")
        right.set(ylabel="normal force [N]", ylim=(0.0, None))
        curves += right.get_lines()
    _head(axis, "Whole run", curves)


def _head(axis: Axes, title: str, handles: Sequence[Artist] | None = None) -> None:
    """The title on the left, and the legend above the axes."""
    axis.set_title(title, loc="left", fontsize=10.5)
    if handles is None:
        handles, _ = axis.get_legend_handles_labels()
    if handles:
        spacing = {"borderpad": 0.1, "columnspacing": 1.2}
        if any(x.get_label() == "second" for x in handles):  # a wider legend beside the title
            spacing |= {"columnspacing": 0.7, "handlelength": 1.0, "handletextpad": 0.4}
        legend_above(axis, handles=handles, ncols=len(handles), fontsize=8, **spacing)


def _at_least(axis: Axes, span: float) -> None:
    """Widen the vertical range to ``span``, so that rounding of a resting body is not visible."""
    low, high = axis.get_ylim()
    if high - low < span:
        middle = 0.5 * (low + high)
        axis.set_ylim(middle - span / 2, middle + span / 2)


def _no_drive(axis: Axes, title: str, unit: str) -> None:
    axis.text(0.5, 0.5, "no drive", transform=axis.transAxes, ha="center", color="0.4")
    axis.set(ylabel=unit, yticks=[])
    _head(axis, title)


def _command(axis: Axes, scene: Scene, time: Array, cut: dict[str, Array]) -> None:
    title = "Command and current"
    if "command" not in cut:
        return _no_drive(axis, title, "current [A]")
    axis.plot(time, cut["current"], color=DRIVE, lw=1.3, label="one coil (left)")
    axis.set(ylabel="current [A]")
    right = axis.twinx()
    right.plot(time, cut["command"], color="0.1", lw=1.1, ls=(0, (3, 4)), label="V1 (right)")
    if "current_2" in cut:
        axis.plot(time, cut["current_2"], color=SECOND, lw=1.1, ls="--", label="second (left)")
    right.set_ylabel("V1 [V]")
    # On these scales the two curves coincide where the current source follows its command.
    scale = scene.sense
    both = np.concatenate([cut["current"], cut["command"] / scale])
    edge = max(0.05 * np.ptp(both), 0.02)
    low, high = both.min() - edge, both.max() + edge
    axis.set_ylim(low, high)
    right.set_ylim(low * scale, high * scale)
    _head(axis, title, [*axis.get_lines(), *right.get_lines()])


def _voltages(axis: Axes, _: Scene, time: Array, cut: dict[str, Array]) -> None:
    title = "Coil voltage and back-EMF"
    if "coil_voltage" not in cut:
        return _no_drive(axis, title, "voltage [V]")
    axis.plot(time, cut["coil_voltage"], color="0.35", lw=0.9, label="coil voltage")
    axis.plot(time, cut["back_emf"], color=EMF, lw=1.2, label="back-EMF")
    axis.set(ylabel="voltage [V]")
    _head(axis, title)


def _positions(axis: Axes, _: Scene, time: Array, cut: dict[str, Array]) -> None:
    for body in ("surface", "part", "surface_2"):
        if (height := cut.get(f"z_{body}")) is not None:
            axis.plot(time, (height - height[0]) * 1e3, **BODIES[body])
    axis.set(ylabel="height [mm]")
    _shade_sticking(axis, time, cut["sticking"])
    _at_least(axis, 0.01)
    _head(axis, "Heights, each from its first")


def _velocities(axis: Axes, _: Scene, time: Array, cut: dict[str, Array]) -> None:
    behind = []
    if "v_ram" in cut:  # several times as fast as the surface, so on an axis of its own
        right = axis.twinx()
        relative = cut["v_ram"] - cut["v_surface"]
        behind = right.plot(time, relative, color=RAM, lw=0.8, label="ram on surface (right)")
        right.set(ylabel="of the ram [m/s]")
        _at_least(right, 0.5)
        axis.set(zorder=right.get_zorder() + 1, frame_on=False)
    for body, style in BODIES.items():
        if (velocity := cut.get(f"v_{body}")) is not None:
            axis.plot(time, velocity * 1e3, **style)
    axis.set(ylabel="velocity [mm/s]")
    _at_least(axis, 1.0)
    _shade_sticking(axis, time, cut["sticking"])
    _head(axis, "Velocities", [*behind, *axis.get_legend_handles_labels()[0]])


def _shade_sticking(axis: Axes, time: Array, sticking: Array) -> None:
    style: dict[str, Any] = {"color": STICKING, "alpha": 0.6, "lw": 0, "zorder": 0}
    style |= {"transform": axis.get_xaxis_transform(), "label": "sticking"}
    axis.fill_between(time, 0, 1, where=sticking > 0.5, **style)


def _power_of_ten(value: float, _: float) -> str:
    """Label of a tick of a symmetric logarithmic axis, without matplotlib's slow formula parser."""
    if value == 0.0:
        return "0"
    power = f"{np.log10(abs(value)):.0f}".translate(_RAISED)
    return f"{'−' if value < 0.0 else ''}10{power}"


def _acceleration(axis: Axes, scene: Scene, time: Array, cut: dict[str, Array]) -> None:
    axis.plot(time, cut["a_surface"], color=SURFACE, lw=0.8, label="true")
    exposure = scene.run.shutter / FRAME_RATE
    # The frames whose exposure is inside the shown rows.
    first, last = cut["time"][[0, -1]] + np.array([exposure, -exposure]) / 2
    frames = np.arange(np.ceil(first * FRAME_RATE), last * FRAME_RATE) / FRAME_RATE
    if len(frames) > 4:
        read = accelerations(heights(cut, "surface", frames, exposure))
        label = f"read from {FRAME_RATE:.0f} frames/s"
        axis.plot(frames * 1e3, read, color="0.2", lw=0.9, marker=".", ms=4, label=label)
    rigid = scene.mechanics.contact == "rigid" and not scene.surface_is_given
    beyond = "\nwithout its jumps" if rigid else ""
    if np.abs(axis.dataLim.intervaly).max() > LINEAR:
        beyond += f"\nlogarithmic beyond {LINEAR:g}"
        axis.set_yscale("symlog", linthresh=LINEAR)
        axis.yaxis.set_major_formatter(_power_of_ten)
    _at_least(axis, 2.0)
    axis.set(ylabel=f"acceleration [m/s²]{beyond}")
    _head(axis, "Acceleration of the surface")
