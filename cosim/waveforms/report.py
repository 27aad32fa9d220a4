"""The printed table of a run's numbers."""

from collections.abc import Iterator, Mapping, Sequence
from math import nan
from typing import Any

from cosim.scene import Scene
from cosim.trials.measured import measured
from cosim.waveforms.columns import netcdf_names
from cosim.waveforms.quantities import label, signed


def table(scene: Scene, summary: dict[str, Any], units: Mapping[str, str]) -> str:
    """The summary as lines of text, velocities in mm/s; ``units``: of the waveforms."""
    if scene.has_ports:
        return _own(scene, summary, units)
    lost = summary.get("energy_residual")
    warning = ": too much, take a smaller circuit.max_step" if lost and lost > SUSPICIOUS else ""
    taken = "{circuit_model}: {circuit_model_why}" if "circuit_model" in summary else ""
    rows = [
        ("part's mean velocity", _scaled(summary["v_average"], 1e3, "mm/s", "+.3f")),
        ("  off by its own steps", _own_error(summary)),
        ("  from other starts", _other_starts(summary)),
        ("  averaged over", _periods(scene, summary)),
        ("motion", motion_in_words(summary)),
        ("", of_the_start(scene, summary)),
        ("transport per cycle", _scaled(summary["transport_per_cycle"], 1e6, "µm", "+.1f")),
        ("sticking", _scaled(summary["stick_fraction"], 100, "% of the time", ".1f")),
        ("surface, peak-to-peak", _scaled(summary["z_surface_pp"], 1e3, "mm", ".3f")),
        ("surface velocity", _range(summary, "v_surface", 1e3, "mm/s", "+.0f")),
        ("surface acceleration", _acceleration(scene, summary)),
        ("  as a camera reads it", _range(summary, "a_camera", 1, "m/s²", "+.0f")),
        *_slips(summary),
    ]
    if "current_max" in summary:
        rows += [
            ("coil current", _range(summary, "current", 1, "A", "+.3f")),
            ("amplifier at a limit", _limits(summary) if scene.rung.has_limits else ""),
        ]
        rows.append(("heat of a coil", _heat(summary)))
    rows += [
        ("impacts", f"{summary.get('impacts', '')}"),
        ("stick-slip events", f"{summary.get('stick_slip_events', '')}"),
        ("circuit taken", taken.format_map(summary)),
        ("  measured of it", summary.get("circuit_model_expected", "")),
        ("energy unaccounted for", "" if lost is None else f"{lost:.1e} of the total{warning}"),
        ("error of the path", _error(summary)),
        ("run time", f"{summary['wall_time']:.2f} s for {scene.run.duration:g} s"),
    ]
    rows += _measures(summary)
    _, beside = of_the_trial(scene)
    told = {name: f"   (measured: {words})" for name, words in beside.items()}
    rows = [(name, value + told.get(name.strip(), "")) for name, value in rows if value]
    return "\n".join(f"  {name:<24}{value}" for name, value in rows)


OFF, LEAST = 0.01, 1e-4
"""Difference of the mean velocity from the settled motion's above which a row says so: relative,
and in m/s where nothing is transported."""

MOST_ROWS = 20
"""Waveforms in the table of a scene with ports, if no more than these are asked for."""


def asked_for(scene: Scene) -> set[str]:
    """The waveforms that a port joins or ``circuit.save`` keeps."""
    ends = {end for p in scene.port for end in (p.probe, p.source, p.origin, p.to) if end}
    return ends | {*(scene.circuit.save or ())}


def _own(scene: Scene, summary: dict[str, Any], units: Mapping[str, str]) -> str:
    """The table of a scene with ports: a line for each waveform not 0, those asked for first."""
    signals = [name.removesuffix(".mean") for name in summary if name.endswith(".mean")]
    asked, moving = asked_for(scene), [name for name in signals if summary[f"{name}.rms"] != 0.0]
    ranked = sorted(moving, key=lambda name: name not in asked)
    names = ranked[: max(MOST_ROWS, len(asked.intersection(moving)))]
    # Units from a waveforms.nc are by netCDF's names.
    files = netcdf_names(signals)
    shown = [label(name, units.get(name) or units[files[name]]) for name in names]
    width = max([20, *map(len, shown)])
    statistics = ["mean", "rms", "least", "greatest"]
    if any(name.endswith(".mean_error") for name in summary):
        statistics.append("mean_error")
    lines = [f"  {'':<{width}}" + "".join(f"{x.replace('_', ' '):>13}" for x in statistics)]
    for name, words in zip(names, shown, strict=True):
        # An error is not known where another run leaves the waveform out, as no finite number.
        values = "".join(f"{summary.get(f'{name}.{x}', nan):>13.6g}" for x in statistics)
        lines.append(f"  {words:<{width}}{values}")
    more, still = len(moving) - len(names), len(signals) - len(moving)
    others = [f"{more} more in summary.json"] * (more > 0)
    others += [f"{still} other{'s are' if still > 1 else ' is'} 0 after settling"] * (still > 0)
    lines += [f"  {'; '.join(others)}"] * bool(others)
    steps, coupling = f"{summary['circuit_steps']} of ngspice", []
    if summary["fmu_steps"]:
        steps += f", {summary['fmu_steps']} of FMUs"
        coupling = [("coupling", summary["method"])]
    repeated = f", {summary['steps_repeated']} repeated" if summary["steps_repeated"] else ""
    time = f"{summary['wall_time']:.2f} s for {scene.run.duration:g} s"
    powers = [name.removesuffix(".power") for name in summary if name.endswith(".power")]
    for what, words in (
        *(("power at " + name, f"{summary[f'{name}.power']:.6g} W") for name in powers),
        *_measures(summary),
        *coupling,
        ("steps", steps + repeated),
        ("run time", time),
    ):
        lines.append(f"  {what:<{width}} {words}")
    return "\n".join(lines)


def _measures(summary: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The results of the netlist's ``.meas`` lines."""
    for name, value in summary.items():
        if name.startswith("meas."):
            yield name.removeprefix("meas."), "none" if value is None else f"{value:.6g}"


def of_the_trial(scene: Scene) -> tuple[int, dict[str, str]]:
    """The number of the trial that the scene repeats, and values measured in it, by the names of
    the table's rows; none without a trial."""
    found = measured(scene)
    if found is None:
        return 0, {}
    number, numbers = found
    values = {
        "part's mean velocity": _scaled(numbers["v_average"], 1e3, "mm/s", "+.2f"),
        "surface, peak-to-peak": _scaled(numbers.get("z_surface_pp"), 1e3, "mm", ".2f"),
        "surface velocity": _range(numbers, "v_surface", 1e3, "mm/s", "+.0f"),
        "as a camera reads it": _range(numbers, "a_camera", 1, "m/s²", "+.0f"),
    }
    return number, {name: words for name, words in values.items() if words}


def _slips(summary: dict[str, Any]) -> Sequence[tuple[str, str]]:
    """A row for each direction of the part, or one for both where only a plate would differ."""
    up, down = (_slip(summary, way) for way in ("up", "down"))
    if up == down:
        return [("slip", up)]
    return [("slip, part going up", up), ("slip, part going down", down)]


def _slip(summary: dict[str, Any], way: str) -> str:
    """The surface's accelerations beyond which the part slips, and which were reached."""
    if f"slip_{way}" not in summary:
        return ""
    low, high = summary[f"slip_{way}"]
    reached = [
        f"{' and '.join(summary[f'slip_by_{by}'][way]) or 'neither'} by {words}"
        for by, words in (("surface", "instants"), ("camera", "the camera's mean over 4 ms"))
        if f"slip_by_{by}" in summary
    ]
    ending = f"; reached: {', '.join(reached)}" if reached else ""
    return f"beyond {low:+.1f} … {high:+.1f} m/s²{ending}"


def _heat(summary: dict[str, Any]) -> str:
    """The heat of a coil, and the estimated rise of its temperature."""
    if "coil_heat" not in summary:
        return ""
    lift, ever = (warmer(summary[f"coil_rise_{name}"]) for name in ("lift", "continuous"))
    warm = f"warmer by {lift} in 10 s, by {ever} in continuous use (estimate)"
    return f"{summary['coil_heat']:.3g} W; {warm}"


def warmer(ends: Sequence[float | None]) -> str:
    """The least and greatest rise of a coil's temperature, K, in words; None: without limit."""
    known = [f"{end:.3g}" if end < 999.5 else f"{end:.0f}" for end in ends if end is not None]
    if len(known) < len(ends):
        return f"at least {known[0]} K" if known else "more and more"
    return f"{' to '.join(known)} K"


def _own_error(summary: dict[str, Any]) -> str:
    """The error of the mean velocity that the run's step sizes may cause (twice its estimate)."""
    error = summary.get("v_average_error")
    return "" if error is None else f"not more than about {2e3 * error:.1g} mm/s"


def _other_starts(summary: dict[str, Any]) -> str:
    """The mean velocities of the same drive begun later; empty where none was run."""
    found = summary.get("v_average_other_starts") or []
    words = ", ".join(signed(1e3 * value, "+.3f") for value in found)
    return f"{words} mm/s" if words else ""


def motion_in_words(summary: Mapping[str, Any]) -> str:
    """The kind of motion in a summary, and its consequence for the mean velocity."""
    kind = summary.get("motion")
    if kind is None:
        return ""
    if kind == "unsettled":
        return "not periodic after 240 periods and 8 s: the mean is that of this stretch"
    if kind == "no transport":
        return "the part shakes in its place, from other starts too"
    if kind == "regular":
        count, settled = summary["motion_periods"], summary["motion_settled"]
        each = "every period" if count == 1 else f"every {count} periods"
        return f"repeats {each}, to 0.1 % from {settled:.2g} s on"
    if kind == "chaotic":
        low, high = (1e3 * value for value in summary["v_average_range"])
        return f"chaotic: means over as many periods lie between {low:+.3f} and {high:+.3f} mm/s"
    answers = " or ".join(f"{1e3 * value:+.3f}" for value in summary["v_average_answers"])
    return f"the start decides: {answers} mm/s"


def of_the_start(scene: Scene, summary: Mapping[str, Any]) -> str:
    """A warning where the mean velocity is not that of the settled motion; else empty."""
    settle, still = scene.run.settle, summary.get("motion") == "no transport"
    late = summary.get("motion_settled", 0.0) > settle + 0.01 * scene.period
    later = 0.0 if still else summary.get("v_average_settled", 0.0)
    off = abs(summary["v_average"] - later)
    if not (still or late) or off < (LEAST if still else OFF * abs(later)):
        return ""
    words = f"the mean above, from {settle:.3g} s on, reads the start"
    return f"{words}; later it is {1e3 * later:+.3f} mm/s"


def _error(summary: dict[str, Any]) -> str:
    """For a run that chose its coupling by its error: the error, the method and the steps."""
    if "error_estimate" not in summary:
        return ""
    taken = summary["coupling_taken"]
    words = (v if isinstance(v, str) else f"{key} {v:g}" for key, v in taken.items())
    return f"{summary['error_estimate']:.1e} of its range, with {', '.join(words)}"


def _periods(scene: Scene, summary: dict[str, Any]) -> str:
    """The number of periods of the averages; empty without a period (which is then infinite)."""
    periods = (scene.run.duration - scene.run.settle) / scene.period
    if not periods:
        return ""
    if abs(periods - round(periods)) < 1e-6:
        repeats = summary.get("motion_periods", 1)
        broken = round(periods) % repeats and periods <= MANY
        hint = f"; a multiple of the motion's {repeats} gives a truer mean" if broken else ""
        return f"{periods:.0f} period{'s' if periods > 1.5 else ''}{hint}"
    if scene.run.average == "slope":
        return f"{periods:.4g} periods, by the slope in a camera's frames"
    hint = "" if periods > MANY else "; whole ones give a truer mean"
    return f"{periods:.4g} periods{hint}"


def _scaled(value: float | None, factor: float, unit: str, form: str) -> str:
    return "" if value is None else f"{signed(value * factor, form)} {unit}"


def _range(summary: Mapping[str, Any], name: str, factor: float, unit: str, form: str) -> str:
    low, high = summary[f"{name}_min"], summary[f"{name}_max"]
    if low is None or high is None:
        return ""
    low, high = (signed(value * factor, form) for value in (low, high))
    return f"{low} … {high} {unit}"


MANY = 500
"""From so many periods on, averages over whole periods are no better."""

SUSPICIOUS = 1e-3
"""Unaccounted share of the energy above which the table has a warning."""

LIMITS = {
    "swing_high_fraction": "swing high",
    "swing_low_fraction": "swing low",
    "current_limit_fraction": "current limit",
    "slew_fraction": "slew rate",
}


def _limits(summary: dict[str, Any]) -> str:
    """The limits of the amplifier that acted, each with its share of the time, as far as known."""
    acted = [
        f"{name} {summary[key] * 100:.3g} %" for key, name in LIMITS.items() if summary.get(key)
    ]
    words = f"{', '.join(acted)} of the time" if acted else ""
    if "saturated_fraction" in summary:
        return words or "never"
    unknown = "not known: the netlist has no node swing that tells it"
    return f"{words}; of the swing {unknown}" if words else unknown


def _acceleration(scene: Scene, summary: dict[str, Any]) -> str:
    if scene.mechanics.contact == "rigid" and not scene.surface_is_given:
        return 'without bound at a rigid impact (mechanics.contact = "compliant" has a peak)'
    if "a_surface_max" not in summary:
        return ""
    return _range(summary, "a_surface", 1, "m/s²", "+.0f") or "without bound: velocity jumps"
