"""A turn: the one perturbation of settings by which this project judges how robust they are."""

from itertools import product

import numpy as np

from cosim.arrays import Array

TURN = 0.02
"""Of a knob's whole turn, or of a key's range: what a hand that sets a knob again is off by. On a
potentiometer that turns by 270 to 300 degrees these are 5 to 6, about the width of its pointer."""


def faces(point: Array) -> Array:
    """Points (rows) with one key turned by TURN either way, inside the cube."""
    step = TURN * np.eye(len(point))
    return np.clip(point + np.vstack([step, -step]), 0.0, 1.0)


def turned(point: Array, keys: int) -> Array:
    """A point and all turns of its first ``keys``, one by one and together (rows)."""
    if not keys:
        return point[np.newaxis]
    # 1 + 2 n + 2^n rows: the point, its turns one by one, and all together; the other keys stay.
    first = point[:keys]
    every = np.vstack([first, faces(first), corners(first)])
    return np.hstack([every, np.tile(point[keys:], (len(every), 1))])


def corners(point: Array) -> Array:
    """Points (rows) with all keys turned by TURN together, in every combination."""
    signs = np.array(list(product((-1.0, 1.0), repeat=len(point))))
    return np.clip(point + TURN * signs, 0.0, 1.0)
