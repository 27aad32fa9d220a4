"""Pictures of a sweep: maps over two keys, curves over one, and clouds of a sample."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from cosim.arrays import Array
from cosim.files.picture import Picture
from cosim.scene import firmware
from cosim.studies.plots import headline
from cosim.studies.sweep.dataset import FAILURE, POINT
from cosim.studies.sweep.report import at, fastest, setting
from cosim.waveforms.quantities import UNITLESS, label, printed
from cosim.waveforms.storage import swept

T = TypeVar("T")

STAYS = 0.05e-3
"""m/s; a part that moves more slowly than this counts as not transported."""

MOST_SLICES = 4

RUGGED = 0.1
"""Of the span of the velocities: a point that is further off the median of those beside it stands
on ground too rugged for the grid; nothing can be read in between."""

FAILED: dict[str, Any] = {"color": "#d1495b", "ls": "", "marker": "x", "ms": 6}


@dataclass(frozen=True)
class Quantity:
    """What a panel shows: a number of the summary, in the units of the bench."""

    name: str
    title: str
    unit: str
    scale: float
    colors: str = "viridis"


V_AVERAGE = Quantity("v_average", "Mean velocity of the part", "mm/s", 1e3, "RdBu")
OTHERS = (
    Quantity("stick_fraction", "Sticking, share of the time", "%", 100.0),
    Quantity("a_camera_min", "Largest fall of the surface, read by a camera", "m/s²", -1.0),
    Quantity("a_surface_max", "Peak acceleration upwards, true", "m/s²", 1.0),
)


def draw(data: xr.Dataset, title: str) -> Picture:
    """The figure of the dataset of a sweep."""
    figure = Picture(13.0, 8.4, "constrained")
    failed = int(np.sum(data[FAILURE].values != ""))
    words = f"{data[FAILURE].size} points" + (f", {failed} failed (×)" if failed else "")
    if "v_average" not in data and any(str(name).endswith(".mean") for name in data):
        headline(figure, f"{title}: {_own(figure, data, swept(data))}, {words}")
        return figure
    if POINT in data.dims:
        words += _scatters(figure, data, swept(data))
    else:
        names = [str(name) for name in data.dims]
        varied = [name for name in names if data.sizes[name] > 1] or names[:1]
        if len(varied) == 1:
            _curves(figure, data.squeeze([n for n in names if n != varied[0]]), varied[0])
        else:
            words += _maps(figure, data, varied)
    best = [
        f"fastest {way}, {data['v_average'].values.ravel()[place] * 1e3:+.3g} mm/s, at "
        f"{at(data, place, 4)}"
        for way, place in fastest(data)[:1]
    ]
    headline(figure, f"{title}: {', '.join(best) or 'the part stays'}\n{words}")
    return figure


MOST_OWN = 6


def _own(figure: Figure, data: xr.Dataset, names: Sequence[str]) -> str:
    """Of a scene with its own FMUs: means over the first key, a point for each setting; in words
    the mean that changes most for its size."""
    means = [str(name) for name in data if str(name).endswith(".mean")][:MOST_OWN]
    dims = data[FAILURE].dims
    over = xr.broadcast(data[names[0]], data[FAILURE])[0].transpose(*dims).values.ravel()
    changes: list[tuple[float, str]] = []
    for axis, name in _panels(figure, means):
        values = data[name].transpose(*dims).values.ravel()
        axis.plot(over, values, ".", color="#1f6fb2")
        axis.ticklabel_format(useOffset=False)
        _over_key(axis, data, names[0])
        told = label(name, unit := data[name].attrs.get("units", ""))
        axis.set_title(told.replace("$", "\\$"), loc="left", fontsize=10.5)
        known = values[np.isfinite(values)]
        if known.size:
            low, high = known.min(), known.max()
            share = (high - low) / (max(abs(low), abs(high)) or 1.0)
            said = "" if unit in UNITLESS else f" {printed(unit)}"
            changes.append((share, f"{name} from {low:.4g} to {high:.4g}{said}"))
    ways = ", ".join(data[name].key for name in names)
    most = max(changes, default=(0.0, "all failed"))[1].replace("$", "\\$")
    return f"{most} over {ways}"


def _row(rows: Any, number: int, count: int) -> list[Axes]:
    """``count`` axes beside each other in one of the subfigures, with one scale upwards."""
    return list(np.atleast_1d(rows[number].subplots(1, count, sharey=True)))


def _others(data: xr.Dataset) -> list[Quantity]:
    """The quantities beside the velocity that there are: rigid walls have no peak, and the fast
    solver knows none."""
    return [one for one in OTHERS if np.isfinite(_values(data, one).values).any()]


def _values(data: xr.Dataset, quantity: Quantity) -> xr.DataArray:
    if quantity.name not in data:
        return xr.full_like(data[FAILURE], np.nan, dtype=np.float64)
    return data[quantity.name] * quantity.scale


def _curves(figure: Figure, data: xr.Dataset, name: str) -> None:
    data = data.sortby(name)
    for axis, quantity in _panels(figure, (V_AVERAGE, *_others(data))):
        values = _values(data, quantity).values
        axis.plot(data[name].values, values, color="#1f6fb2", marker=".", lw=1.3)
        _over_key(axis, data, name)
        if _are_decades(data[name].values):
            axis.set_xscale("log")
        axis.set(ylabel=f"[{quantity.unit}]")
        axis.set_title(quantity.title, loc="left", fontsize=10.5)
    figure.axes[0].axhline(0.0, color="0.3", lw=0.8)


def _panels(figure: Figure, shown: Sequence[T]) -> list[tuple[Axes, T]]:
    """Axes for each, two beside each other; of three the first has a column of its own."""
    if len(shown) == 3:
        return [*zip(figure.subplot_mosaic([[0, 1], [0, 2]]).values(), shown, strict=True)]
    every = [*figure.subplots(-(-len(shown) // 2), 2, squeeze=False).flat]
    for axis in every[len(shown) :]:
        axis.set_visible(False)
    return [*zip(every, shown, strict=False)]


def _are_decades(values: Array) -> bool:
    """Whether values were chosen by their ratios."""
    steps = np.diff(np.log(np.sort(values))) if np.min(values) > 0.0 else np.array([])
    return bool(len(steps) > 2 and values.max() > 20.0 * values.min() and np.ptp(steps) < 0.2)


def _maps(figure: Figure, data: xr.Dataset, names: Sequence[str]) -> str:
    """Two keys span the maps; a third gives slices; any further one stands at the best point. What
    of the sweep is not shown, in words."""
    known = _values(data, V_AVERAGE).fillna(-np.inf)
    best: Any = known.argmax(known.dims)
    *fixed, third, y, x = ["", *names] if len(names) == 2 else names
    beside, said = _others(data), []
    for name in [str(dim) for dim in data.dims if dim not in (x, y, third)]:
        data = data.isel({name: int(best[name])})
        if name in fixed:
            said.append(_setting(data, name))
    data = data.sortby([x, y])
    slices = [data]
    here = data
    if third:
        moving = _moving(data, third)
        count = min(MOST_SLICES, len(moving))
        places = np.unique(np.linspace(0, len(moving) - 1, count).round().astype(int))
        if (top := int(best[third])) in moving:  # the best point is in one that is shown
            places[np.abs(places - moving.index(top)).argmin()] = moving.index(top)
        slices = [data.isel({third: moving[k]}) for k in places.tolist()]
        here = data.isel({third: int(best[third])})
        rows = figure.subfigures(2, 1)
        panels = list(zip(_row(rows, 0, len(slices)), slices, strict=True))
        others = list(zip(_row(rows, 1, len(beside)), beside, strict=True)) if beside else []
    else:
        (first, _), *others = _panels(figure, (V_AVERAGE, *beside))
        panels = [(first, data)]
    norm = _two_sided(np.concatenate([_values(part, V_AVERAGE).values.ravel() for part in slices]))
    hatched = dotted = False
    for k, (axis, part) in enumerate(panels):
        head = f"at {_setting(part, third)}" if third else V_AVERAGE.title
        shown, rugged = _map(axis, part, V_AVERAGE, x, y, norm)
        hatched |= _boundary(axis, part, x, y)
        dotted |= rugged
        axis.set_title(head, loc="left", fontsize=10.5)
        if k == len(panels) - 1:
            label = f"{V_AVERAGE.title} [mm/s]" if third else "[mm/s]"
            axis.figure.colorbar(shown, ax=[p[0] for p in panels], label=label)
    for axis, quantity in others:
        norm = _one_sided(_values(here, quantity).values, quantity.unit)
        _head(axis, quantity, _map(axis, here, quantity, x, y, norm)[0])
    left = f"; at {', '.join(said)} alone" if said else ""
    if third and len(slices) < data.sizes[third]:
        left += f"; drawn at {len(slices)} of {data.sizes[third]} {data[third].key}"
    said += [_setting(here, third)] if third else []
    left += f"; hatched: the part stays (below {STAYS * 1e3:g} mm/s)" if hatched else ""
    left += "; dots: far off the points beside them" if dotted else ""
    if said and others:
        axis, quantity = others[0]
        axis.set_title(f"{quantity.title}\nat {', '.join(said)}", loc="left", fontsize=10.5)
    return left


def _scatters(figure: Figure, data: xr.Dataset, names: Sequence[str]) -> str:
    """The velocity over the first keys, and three quantities over the first two. What of the keys
    is not shown, in words."""
    rows = figure.subfigures(2, 1)
    v = _values(data, V_AVERAGE).values
    norm = _two_sided(v)
    edges: dict[str, Any] = {"edgecolors": "0.4", "linewidths": 0.3}
    top = _row(rows, 0, min(len(names), MOST_SLICES))
    for axis, name in zip(top, names, strict=False):
        axis.scatter(data[name].values, v, c=v, cmap=V_AVERAGE.colors, norm=norm, s=14, **edges)
        _over_key(axis, data, name)
        axis.axhline(0.0, color="0.3", lw=0.8)
    top[0].set_ylabel(f"{V_AVERAGE.title} [mm/s]")
    if len(names) < 2:
        return ""
    x, y = data[names[0]].values, data[names[1]].values
    shown_there = [V_AVERAGE, *(one for one in _others(data) if one is not OTHERS[0])]
    for axis, quantity in zip(_row(rows, 1, len(shown_there)), shown_there, strict=True):
        values = _values(data, quantity).values
        limits = norm if quantity is V_AVERAGE else _one_sided(values, quantity.unit)
        shown = axis.scatter(x, y, c=values, cmap=quantity.colors, norm=limits, s=22, **edges)
        failed = data[FAILURE].values != ""
        axis.plot(x[failed], y[failed], **FAILED)
        _name_axes(axis, data, names[0], names[1])
        _head(axis, quantity, shown)
    rest = [data[name].key for name in names[MOST_SLICES:]]
    return f"; not drawn over {', '.join(rest)}" if rest else ""


def _over_key(axis: Axes, data: xr.Dataset, name: str) -> None:
    """Name the key below the axis, and mark the points that failed there."""
    every, failure = xr.broadcast(data[name], data[FAILURE])
    failed = every.values[failure.values != ""]
    if failed.size:
        bottom = np.full(failed.size, 0.02)
        axis.plot(failed, bottom, transform=axis.get_xaxis_transform(), **FAILED)
    _name_axes(axis, data, name)
    axis.grid(alpha=0.25)


def _map(
    axis: Axes, data: xr.Dataset, quantity: Quantity, x: str, y: str, norm: Normalize
) -> tuple[Any, bool]:
    """What it shows in colours; and whether the velocity's ground is too rugged anywhere."""
    values = _values(data, quantity).transpose(y, x).values
    xs, ys = data[x].values, data[y].values
    shown = axis.pcolormesh(xs, ys, values, cmap=quantity.colors, norm=norm, shading="nearest")
    levels, smooth, rugged = _levels(norm), values, np.zeros(values.shape, bool)
    if quantity is V_AVERAGE:
        rugged = _rugged(values, norm)
        smooth = np.where(rugged, np.nan, values)
        rows, columns = np.nonzero(rugged)
        axis.plot(xs[columns], ys[rows], ".", color="k", ms=4)
    if min(values.shape) > 1 and np.isfinite(smooth).sum() > 3 and levels:
        lines = axis.contour(xs, ys, smooth, levels=levels, colors="0.15", linewidths=0.7)
        axis.clabel(lines, fontsize=7.5, fmt=lambda level: f"{level:.4g}")
    rows, columns = np.nonzero(data[FAILURE].transpose(y, x).values != "")
    axis.plot(xs[columns], ys[rows], **FAILED)
    _name_axes(axis, data, x, y)
    return shown, bool(rugged.any())


def _boundary(axis: Axes, data: xr.Dataset, x: str, y: str) -> bool:
    """Where transport ends: hatched where the part stays. Whether it stays anywhere."""
    speeds = np.abs(_values(data, V_AVERAGE).transpose(y, x).values) / V_AVERAGE.scale
    if min(speeds.shape) < 2 or not (speeds < STAYS).any():
        return False
    over = data[x].values, data[y].values, speeds
    axis.contourf(*over, levels=[0.0, STAYS], colors="none", hatches=["////"])
    axis.contour(*over, levels=[STAYS], colors="k", linewidths=1.4)
    return True


def _moving(data: xr.Dataset, third: str) -> list[int]:
    """The slices in which the part moves anywhere; all where it moves in none."""
    speeds = np.abs(_values(data, V_AVERAGE).transpose(third, ...).values) / V_AVERAGE.scale
    every = range(data.sizes[third])
    found = [k for k in every if np.nan_to_num(speeds[k]).max() >= STAYS]
    return found or list(every)


def _rugged(values: Array, norm: Normalize) -> NDArray[np.bool_]:
    """Which points of a map are further off the median of those beside them than RUGGED."""
    around = np.pad(values, 1, constant_values=np.nan)
    beside = np.array([around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]])
    known = np.isfinite(beside).sum(axis=0) >= 2
    middle = np.nanmedian(np.where(known, beside, 0.0), axis=0)
    span = float(norm.vmax or 0.0) - float(norm.vmin or 0.0)
    return known & (np.abs(values - middle) > RUGGED * span)


def _two_sided(values: Array) -> Normalize:
    """Red below zero, blue above, white at zero."""
    known = values[np.isfinite(values)]
    low, high = known.min(initial=0.0), known.max(initial=0.0)
    least = 0.02 * (high - low) or 1.0
    return TwoSlopeNorm(0.0, min(low, -least), max(high, least))


def _one_sided(values: Array, unit: str) -> Normalize:
    known = values[np.isfinite(values)]
    if unit == "%":
        return Normalize(0.0, 100.0)
    low, high = (known.min(), known.max()) if known.size else (1.0, 2.0)
    if low > 0 and high > 20 * low:
        return LogNorm(low, high)
    return Normalize(low, high if high > low else low + 1.0)


def _levels(norm: Normalize) -> list[float]:
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 1.0)
    locator = LogLocator(10.0, (1.0, 3.0)) if isinstance(norm, LogNorm) else MaxNLocator(7)
    ticks = locator.tick_values(low, high)
    # Zero is a plateau where the part stays; its edge is drawn as such.
    return [float(level) for level in ticks if low < level < high and level != 0.0]


def _head(axis: Axes, quantity: Quantity, shown: Any) -> None:
    """Name what a panel has ``shown`` in colours."""
    axis.set_title(quantity.title, loc="left", fontsize=10.5)
    axis.figure.colorbar(shown, ax=axis, label=f"[{quantity.unit}]")


def _setting(data: xr.Dataset, name: str) -> str:
    meant = _meant(data[name].key, float(data[name]))
    return setting(data[name], 4) + (meant and f", {meant}")


def _meant(key: str, value: float) -> str:
    """What a knob at ``value`` stands for."""
    if key == "drive.pot_frequency":
        return f"{firmware.knob_frequency(value):.3g} Hz"
    if key == "drive.pot_max":
        return f"{firmware.knob_amplitude(value):.3g} V"
    return ""


def _name_axes(axis: Axes, data: xr.Dataset, *names: str) -> None:
    """Label x, and y if it is named; below the numbers of a knob stands what they stand for."""
    axis.xaxis.set_major_locator(MaxNLocator(6))
    for name, line in zip(names, (axis.xaxis, axis.yaxis), strict=False):
        key, unit = data[name].key, data[name].units
        place = axis.get_subplotspec()
        inner = line is axis.yaxis and axis.get_shared_y_axes().get_siblings(axis) != [axis]
        if not inner or (place is not None and place.is_first_col()):
            line.set_label_text(label(key, unit))
        if _meant(key, 0.5):
            low, high = line.get_view_interval()
            shown = [tick for tick in np.linspace(0.0, 1.0, 6) if low <= tick <= high]
            if len(shown) > 1:
                words = [f"{tick:.1f}\n{_meant(key, tick)}" for tick in shown]
                line.set_ticks(shown, words, fontsize=8.5)
