"""A sweep for a reader: the table that is printed."""

from collections import Counter

import numpy as np
import xarray as xr

from cosim.errors import SimulationFailed
from cosim.studies.sweep.dataset import FAILURE, swept
from cosim.waveforms.quantities import with_unit

MOST_REASONS = 5


def table(data: xr.Dataset) -> str:
    """The greatest transport up and down, with the settings, and why points failed."""
    reasons = Counter(str(text) for text in data[FAILURE].values.ravel() if text)
    count = data[FAILURE].size
    name = str(data.attrs["title"]).removeprefix("Sweep of ")
    lines = [f"{name}: {count} points, {sum(reasons.values())} failed"]
    if "v_average" in data and np.isfinite(data["v_average"].values).any():
        v = data["v_average"].values
        for way, place in (("up", np.nanargmax(v)), ("down", np.nanargmin(v))):
            speed = v.ravel()[place]
            if (speed > 0) == (way == "up"):
                lines.append(f"  fastest {way:<5}{speed * 1e3:+10.3f} mm/s at {_at(data, place)}")
    lines += [f"  {n} failed: {reason}" for reason, n in reasons.most_common(MOST_REASONS)]
    if len(reasons) > MOST_REASONS:
        lines.append(
            f"  and for {len(reasons) - MOST_REASONS} more reasons: see {FAILURE} in sweep.nc"
        )
    return "\n".join(lines)


def check(data: xr.Dataset) -> None:
    """Raise SimulationFailed where no point could be run."""
    reasons = [str(reason) for reason in data[FAILURE].values.flat]
    if all(reasons):
        raise SimulationFailed(f"No point could be run; the first one: {reasons[0]}")


def _at(data: xr.Dataset, place: np.intp) -> str:
    """The settings of a point by its number."""
    v = data["v_average"]
    point = v[dict(zip(v.dims, np.unravel_index(place, v.shape), strict=True))]
    return ", ".join(setting(point[name]) for name in swept(data))


def setting(value: xr.DataArray, digits: int = 6) -> str:
    """``table.key = number unit`` of a point's coordinate."""
    return f"{value.key} = {with_unit(float(value), value.units, digits)}"
