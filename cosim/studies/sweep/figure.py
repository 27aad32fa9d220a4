"""Pictures of a sweep: maps over two keys, curves over one, points of a sample."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MaxNLocator

from cosim.arrays import Array
from cosim.files.picture import Picture, grid
from cosim.scene import firmware
from cosim.studies.plots import headline
from cosim.studies.sweep.dataset import FAILURE, POINT
from cosim.studies.sweep.report import at, fastest, of_ports, range_of, setting
from cosim.waveforms.quantities import UNITLESS, label, printed
from cosim.waveforms.storage import swept

STAYS = 0.05e-3
"""m/s; a part that moves more slowly than this counts as not transported."""

WIDE = 20.0
"""Ratio of a key's greatest and least value from which on its axis may be logarithmic."""

MOST = 6
"""Most panels of a figure."""

FAILED: dict[str, Any] = {"color": "#d1495b", "ls": "", "marker": "x", "ms": 6}


class Quantity(NamedTuple):
    """What a panel shows: a number of the summary, times ``scale`` to be in ``unit``."""

    name: str
    title: str
    unit: str
    scale: float = 1.0


V_AVERAGE = Quantity("v_average", "Mean velocity of the part", "mm/s", 1e3)
OTHERS = (
    Quantity("stick_fraction", "Sticking, share of the time", "%", 100.0),
    Quantity("a_camera_min", "Largest fall of the surface, read by a camera", "m/s²", -1.0),
    Quantity("a_surface_max", "Peak acceleration upwards, true", "m/s²"),
)


def draw(data: xr.Dataset, title: str) -> Picture:
    """The figure of the dataset of a sweep."""
    keys = swept(data)
    varied = [key for key in keys if data.sizes.get(key, 1) > 1] or keys[:1]
    failed = int(np.sum(data[FAILURE].values != ""))
    words = f"{data[FAILURE].size} points" + (f", {failed} failed (×)" if failed else "")
    quantities = _quantities(data)
    if POINT in data.dims:
        figure = _over_keys(data, [(key, quantities[0]) for key in keys], ".")
    elif len(varied) == 1:
        panels = [(varied[0], quantity) for quantity in quantities]
        figure = _over_keys(data.sortby(varied[0]), panels, ".-")
    else:
        y, x, *fixed = varied
        shown = _at_the_best(data, y, x, quantities[0])
        figure = _maps(shown, y, x, quantities)
        if fixed:
            words += f"; drawn at {', '.join(_setting(shown[key]) for key in fixed)}, the best"
        v, most = _values(shown, V_AVERAGE), STAYS * V_AVERAGE.scale
        if any((v < level).any() and (v > level).any() for level in (-most, most)):
            words += f"; black lines: ±{most:g} mm/s"
        words += "; dashes: the part stays" * bool((abs(v) < most).any())
    if of_ports(data):
        said = range_of(data, quantities[0].name, 4) or "all failed"
        headline(figure, f"{title}: {quantities[0].name} {said}\n{words}".replace("$", "\\$"))
        return figure
    best = [
        f"fastest {way}, {data['v_average'].values.ravel()[place] * 1e3:+.3g} mm/s, at "
        f"{at(data, place, 4)}"
        for way, place in fastest(data)[:1]
    ]
    headline(figure, f"{title}: {', '.join(best) or 'the part stays'}\n{words}")
    return figure


def _quantities(data: xr.Dataset) -> list[Quantity]:
    """The velocity, and each other quantity that some point has: with rigid walls and with the fast
    solver there are no peaks of the acceleration. Of a scene with ports of its own, their means."""
    if means := of_ports(data):
        return [Quantity(name, name, data[name].attrs.get("units", "")) for name in means[:MOST]]
    return [V_AVERAGE, *(x for x in OTHERS if np.isfinite(_values(data, x).values).any())]


def _values(data: xr.Dataset, quantity: Quantity) -> xr.DataArray:
    if quantity.name not in data:
        return xr.full_like(data[FAILURE], np.nan, dtype=np.float64)
    return data[quantity.name] * quantity.scale


def _panels(titles: Sequence[str]) -> tuple[Picture, list[Axes]]:
    """Axes with these titles, two beside each other."""
    figure, axes = grid(len(titles), min(len(titles), 2), 13.0, 3.9, 0.6)
    for axis, title in zip(axes, titles, strict=True):
        axis.set_title(title.replace("$", "\\$"), loc="left", fontsize=10.5)
    return figure, axes


def _over_keys(data: xr.Dataset, panels: Sequence[tuple[str, Quantity]], style: str) -> Picture:
    """A quantity over a key in each panel; the points that failed are marked at the bottom."""
    panels = panels[:MOST]
    figure, axes = _panels([label(quantity.title, quantity.unit) for _, quantity in panels])
    for axis, (key, quantity) in zip(axes, panels, strict=True):
        x, values, failure = xr.broadcast(data[key], _values(data, quantity), data[FAILURE])
        axis.plot(x.values.ravel(), values.values.ravel(), style, color="#1f6fb2")
        axis.ticklabel_format(useOffset=False)
        failed = x.values[failure.values != ""]
        if failed.size:
            bottom = np.full(failed.size, 0.02)
            axis.plot(failed, bottom, transform=axis.get_xaxis_transform(), **FAILED)
        if quantity is V_AVERAGE:
            axis.axhline(0.0, color="0.3", lw=0.8)
        _name(axis.xaxis, data[key])
    return figure


def _at_the_best(data: xr.Dataset, y: str, x: str, first: Quantity) -> xr.Dataset:
    """The points over two keys, all others being as where ``first`` is greatest."""
    values = _values(data, first).values
    place = np.nanargmax(values) if np.isfinite(values).any() else 0
    place = next((place for _, place in fastest(data)), place)
    best = dict(zip(data[FAILURE].dims, np.unravel_index(place, data[FAILURE].shape), strict=True))
    others = {name: at for name, at in best.items() if name not in (x, y)}
    return data.isel(others).sortby([x, y]).transpose(y, x)


def _maps(data: xr.Dataset, y: str, x: str, quantities: Sequence[Quantity]) -> Picture:
    """A map of each quantity, with the failed points and where the part stays."""
    figure, axes = _panels([quantity.title for quantity in quantities])
    xs, ys = data[x].values, data[y].values
    rows, columns = np.nonzero(data[FAILURE].values != "")
    for axis, quantity in zip(axes, quantities, strict=True):
        axis.grid(False)
        values = _values(data, quantity).values
        shown = axis.pcolormesh(_borders(xs), _borders(ys), values)
        if quantity is V_AVERAGE:
            known = values[np.isfinite(values)]
            ends = known.min(initial=-STAYS), known.max(initial=STAYS)
            shown.set(cmap="RdBu", norm=TwoSlopeNorm(0.0, *map(float, ends)))
            _boundary(axis, xs, ys, values / quantity.scale)
        unit = "" if quantity.unit in UNITLESS else f"[{printed(quantity.unit)}]"
        figure.colorbar(shown, ax=axis, label=unit)
        axis.plot(xs[columns], ys[rows], **FAILED)
        _name(axis.xaxis, data[x])
        _name(axis.yaxis, data[y])
    return figure


def _by_ratios(values: Array) -> bool:
    """Whether a key's values go up by ratios, over decades."""
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    return bool(0.0 < low < high / WIDE and middle**2 < 2.0 * low * high)


def _borders(values: Array) -> Array:
    """The borders of the cells of a map: the middles between values, as the axis shows them."""
    ratios = _by_ratios(values)
    x = np.log(values) if ratios else values
    half = np.diff(x) / 2.0
    borders = np.concatenate([x[:1] - half[:1], x[:-1] + half, x[-1:] + half[-1:]])
    return np.exp(borders) if ratios else borders


def _boundary(axis: Axes, xs: Array, ys: Array, v: Array) -> None:
    """Draw the contours ±STAYS of ``v`` (m/s), and a dash at each point where the part stays."""
    known = v[np.isfinite(v)]
    low, high = known.min(initial=np.inf), known.max(initial=-np.inf)
    if levels := [level for level in (-STAYS, STAYS) if low < level < high]:
        axis.contour(xs, ys, v, levels=levels, colors="k", linewidths=1.2)
    # Contours alone would miss islands of a single point, of which maps of knobs have many.
    rows, columns = np.nonzero(np.abs(v) < STAYS)
    axis.plot(xs[columns], ys[rows], "_", color="0.4", ms=9)


_MEANT = {
    "drive.pot_frequency": (firmware.knob_frequency, "Hz"),
    "drive.pot_max": (firmware.knob_amplitude, "V"),
}
"""The quantity that a knob sets as a function of the knob, and its unit."""


def _setting(value: xr.DataArray) -> str:
    meaning, unit = _MEANT.get(value.key, (None, ""))
    meant = f", {meaning(float(value)):.3g} {unit}" if meaning else ""
    return setting(value, 4) + meant


def _name(axis: Axis, key: xr.DataArray) -> None:
    """Label an axis, which is logarithmic where values go up by ratios; below each tick of a knob
    stands the frequency or amplitude that it sets."""
    axis.set_label_text(label(key.key, key.units))
    if _by_ratios(key.values):
        of = axis.axes
        (of.set_xscale if axis is of.xaxis else of.set_yscale)("log")
    meaning, unit = _MEANT.get(key.key, (None, ""))
    if meaning:
        axis.set_major_locator(MaxNLocator(5))
        axis.set_major_formatter(
            lambda knob, _: f"{knob:.3g}\n{meaning(min(max(knob, 0.0), 1.0)):.3g} {unit}"
        )
