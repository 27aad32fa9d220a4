"""A sweep for a reader: the table that is printed."""

from collections import Counter

import numpy as np
import xarray as xr

from cosim.scene import Scene, keys
from cosim.studies.sweep.dataset import FAILURE, POINT

MOST_REASONS = 5


def table(scene: Scene, data: xr.Dataset) -> str:
    """The greatest transport up and down, with the settings, and why points failed."""
    reasons = Counter(str(text) for text in data[FAILURE].values.ravel() if text)
    count = data[FAILURE].size
    lines = [f"{scene.name}: {count} points, {sum(reasons.values())} failed"]
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


def _at(data: xr.Dataset, place: np.intp) -> str:
    """The settings of a point by its number."""
    units = {key.full: key.unit for key in keys()}
    if POINT in data.dims:
        values = {str(name): data[name].values[place] for name in data.coords}
    else:
        dims = [str(dim) for dim in data["v_average"].dims]
        where = np.unravel_index(place, data["v_average"].shape)
        values = {dim: data[dim].values[k] for dim, k in zip(dims, where, strict=True)}
    return ", ".join(
        f"{name} = {value:.6g}" + ("" if units[name] == "1" else f" {units[name]}")
        for name, value in values.items()
    )
