"""The operator's three knobs as a unit cube, and what a small turn of them is."""

from itertools import product

import numpy as np

from cosim.arrays import Array
from cosim.scene import firmware
from cosim.scene.tables import KNOBS

RANGE = firmware.GAIN * firmware.volts(firmware.COUNTS - 1)
"""V: the most that either knob of volts sets at V1."""

KNOB_COUNT = len(KNOBS)

TURN = 0.02
"""Of a knob's whole turn: how well a hand finds a setting again."""

DIGITS = 6
"""Of a knob's whole turn, so that a setting can be typed."""

FREE = {f"drive.{knob}": None for knob in KNOBS}
"""Lets amplitude, frequency and offset stand for themselves."""


def settings(place: Array, reach: float = 1.0) -> dict[str, float]:
    """Amplitude (V), frequency (Hz) and offset (V) of a place in the cube, as the firmware maps its
    potentiometers but without their steps; ``reach`` multiplies both volts.

    The third knob sets where the ramp ends, so the mean moves with the amplitude.
    """
    amplitude, top = reach * RANGE * place[0], reach * RANGE * place[2]
    return {
        "drive.amplitude": _typed(amplitude),
        "drive.frequency": _typed(firmware.knob_frequency(0.0) - 99.0 * place[1]),
        "drive.offset": _typed(top - amplitude / 2.0),
    }


def rounded(places: Array) -> Array:
    """Places (rows) that can be typed, inside the cube."""
    return np.round(np.clip(places, 0.0, 1.0), DIGITS)


def faces(place: Array) -> Array:
    """Each knob turned by TURN either way, by itself."""
    return rounded(place + TURN * np.vstack([np.eye(KNOB_COUNT), -np.eye(KNOB_COUNT)]))


def corners(place: Array) -> Array:
    """All knobs turned by TURN together, in every combination."""
    return rounded(place + TURN * np.array(list(product((-1.0, 1.0), repeat=KNOB_COUNT))))


def _typed(value: float) -> float:
    return round(float(value), DIGITS)
