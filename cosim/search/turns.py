"""A turn: the perturbation of settings by which this project judges their robustness."""

from itertools import product

import numpy as np

from cosim.arrays import Array

TURN = 0.02
"""Error with which a hand sets a knob again, as a share of the knob's whole turn or a key's range.
On a potentiometer with 270 to 300 degrees it is 5 to 6 degrees, about the width of its pointer."""


def faces(point: Array) -> Array:
    """Points (rows) with one key turned by TURN either way, inside the cube."""
    step = TURN * np.eye(len(point))
    return np.clip(point + np.vstack([step, -step]), 0.0, 1.0)


def turned(point: Array, keys: int) -> Array:
    """A point (row 0) and all turns of its first ``keys`` coordinates, one by one and together."""
    if not keys:
        return point[np.newaxis]
    # 1 + 2 n + 2^n rows: the point, its turns one by one, and all together; the other keys stay.
    first = point[:keys]
    moved = np.vstack([first, faces(first), corners(first)])
    return np.hstack([moved, np.tile(point[keys:], (len(moved), 1))])


def corners(point: Array) -> Array:
    """Points (rows) with all keys turned by TURN together, in every combination."""
    signs = np.array(list(product((-1.0, 1.0), repeat=len(point))))
    return np.clip(point + TURN * signs, 0.0, 1.0)
