"""Arrays as the package's signatures name them, and what is asked of them in several places."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def slope(time: Array, heights: Array) -> float:
    """Of the straight line through heights (m) at some times (s), m/s."""
    return float(np.polynomial.Polynomial.fit(time, heights, 1).convert().coef[1])


def drawable(values: Array, unit: str) -> Array:
    """Values without 1e9 s, by which the FMU's time to impact says that none is in sight."""
    return np.where(values < 1e9, values, np.nan) if unit == "s" else values
