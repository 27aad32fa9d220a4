"""The printed summary of a sweep."""

from collections import Counter

import numpy as np
import xarray as xr

from cosim.errors import SimulationFailed
from cosim.scene.tables import KNOBS
from cosim.studies.sweep.dataset import FAILURE, JUDGED
from cosim.waveforms.quantities import percent, with_unit
from cosim.waveforms.storage import swept

MOST_REASONS = 5
"""Different reasons of failures that are printed, the most frequent ones."""

MOST_MEANS = 3
"""Means of a scene with ports of its own that are printed, those of the first ports."""

MOTION = "motion_fastest_{}"
"""Attribute of a sweep's dataset with the kind of motion at the fastest point "up" or "down"."""
MOTIONS = "motion_at_random"
"""Attribute of a sweep's dataset with how often each kind of motion occurs."""

LEAST = 1e-3
"""m/s; the least reference of a relative error of v_average."""

TOLD = 0.5e-6
"""m/s; a velocity that is less is printed as 0, and no transport."""

BEYOND = 0.02
"""Relative error of v_average: of a fast sweep the share of points above it is printed."""


def table(data: xr.Dataset) -> str:
    """The greatest transport up and down, or the range of what ports join, with the settings, and
    why points failed."""
    reasons = Counter(str(text) for text in data[FAILURE].values.ravel() if text)
    count = data[FAILURE].size
    name = str(data.attrs["title"]).removeprefix("Sweep of ")
    lines = [f"{name}: {count} points, {sum(reasons.values())} failed"]
    if "v_average" in data and not fastest(data):
        lines.append("  the part stays at each point that ran")
    for way, place in fastest(data):
        speed, judged = data["v_average"].values.ravel()[place], ""
        if JUDGED in data:
            judged = f" (by the FMU {data[JUDGED].values.ravel()[place] * 1e3:+.3f})"
        lines.append(f"  fastest {way:<5}{speed * 1e3:+10.3f} mm/s{judged} at {at(data, place)}")
        if motion := data.attrs.get(MOTION.format(way)):
            lines.append(f"    its motion   {motion}")
    for name in of_ports(data)[:MOST_MEANS]:
        if said := range_of(data, name):
            lines.append(f"  {name:<20} {said}")
    if MOTIONS in data.attrs:
        lines.append(f"  motion at points at random: {data.attrs[MOTIONS]}")
    lines += _judgement(data) if JUDGED in data else []
    lines += [f"  {n} failed: {reason}" for reason, n in reasons.most_common(MOST_REASONS)]
    if (more := len(reasons) - MOST_REASONS) > 0:
        lines.append(f"  and for {more} more reasons: see {FAILURE} in sweep.nc")
    return "\n".join(lines)


def of_ports(data: xr.Dataset) -> list[str]:
    """The means of a scene with ports of its own, of what ports join and save keeps first."""
    own = "v_average" not in data
    return [name for name in map(str, data) if own and name.endswith(".mean")]


def range_of(data: xr.Dataset, name: str, digits: int = 6) -> str:
    """In words, the least and the greatest value of a number, with their settings."""
    values = data[name].values.ravel()
    if not np.isfinite(values).any():
        return ""
    unit = data[name].attrs.get("units", "1")
    if np.nanmin(values) == np.nanmax(values):
        return f"{with_unit(float(np.nanmin(values)), unit, 4)} at all points"
    return "from " + " to ".join(
        f"{with_unit(float(values[place]), unit, 4)} at {at(data, place, digits)}"
        for place in (np.nanargmin(values), np.nanargmax(values))
    )


def fastest(data: xr.Dataset) -> list[tuple[str, np.intp]]:
    """Flat indices of the points that transport fastest "up" and "down", if any does so."""
    v = data["v_average"].values if "v_average" in data else np.array(np.nan)
    if not np.isfinite(v).any():
        return []
    ends = ("up", np.nanargmax(v)), ("down", np.nanargmin(v))
    moves = {"up": np.nanmax(v) >= TOLD, "down": np.nanmin(v) <= -TOLD}
    return [(way, place) for way, place in ends if moves[way]]


def check(data: xr.Dataset) -> None:
    """Raise SimulationFailed where no point could be run."""
    reasons = [str(reason) for reason in data[FAILURE].values.flat]
    if all(reasons):
        raise SimulationFailed(f"No point could be run; the first one: {reasons[0]}")


def _judgement(data: xr.Dataset) -> list[str]:
    """Lines on the error of the fast solver at the points that the FMU ran again."""
    fast, fmu = (data[name].values.ravel() for name in ("v_average", JUDGED))
    known = np.flatnonzero(np.isfinite(fmu))
    if not len(known):
        return []
    scale = np.maximum(np.abs(fmu[known]), LEAST)
    error = np.abs(fast[known] - fmu[known]) / scale
    worst = known[error.argmax()]
    return [
        f"  fast solver against the FMU at {len(known)} points: median error "
        f"{percent(np.median(error))}, beyond {BEYOND * 100:g} % at "
        f"{(error > BEYOND).mean() * 100:.3g} % of them (of v_average, at least {LEAST * 1e3:g} "
        "mm/s)",
        f"  furthest off {percent(error.max())} at {at(data, worst)}",
    ]


def at(data: xr.Dataset, place: np.intp, digits: int = 6) -> str:
    """The settings of the point with the flat index ``place``, with what knobs set."""
    every = data[FAILURE]
    point = every[dict(zip(every.dims, np.unravel_index(place, every.shape), strict=True))]
    found = [setting(point[name], digits) for name in swept(data)]
    meant = [  # only the axes of the sweep have an attribute "key"
        f"{name} {with_unit(float(value), value.units, 4)}"
        for name, value in point.coords.items()
        if str(name) in KNOBS.values() and "key" not in value.attrs
    ]
    return ", ".join(found) + (f" ({', '.join(meant)})" if meant else "")


def setting(value: xr.DataArray, digits: int = 6) -> str:
    """``table.key = number unit`` of a point's coordinate."""
    return f"{value.key} = {with_unit(float(value), value.units, digits)}"
