"""What an operator turns, and what for: the three knobs as a unit cube, and the quantities that are
wanted large.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from cosim.arrays import Array
from cosim.scene import firmware
from cosim.scene.tables import KNOBS

RANGE = firmware.GAIN * firmware.volts(firmware.COUNTS - 1)
"""V: the most that either knob of volts sets at V1."""

KNOB_COUNT = len(KNOBS)

STEPS = firmware.COUNTS - 1
"""Of a knob's whole turn: the firmware reads each in so many, and nothing between them can be set.
"""

FREE = {f"drive.{knob}": None for knob in KNOBS}
"""Lets amplitude, frequency and offset stand for themselves."""


def settings(point: Array, reach: float = 1.0) -> dict[str, float]:
    """Amplitude (V), frequency (Hz) and offset (V) of a point of the cube, as the firmware maps its
    potentiometers; ``reach`` multiplies both volts.

    The third knob sets where the ramp ends, so the mean moves with the amplitude.
    """
    amplitude, top = reach * RANGE * point[0], reach * RANGE * point[2]
    return {
        "drive.amplitude": _typed(amplitude),
        "drive.frequency": _typed(firmware.knob_frequency(point[1] * STEPS / firmware.COUNTS)),
        "drive.offset": _typed(top - amplitude / 2.0),
    }


def _typed(value: float) -> float:
    return round(float(value), 6)


Numbers = Mapping[str, float]
"""Of a run's summary, SI."""


@dataclass(frozen=True)
class Quantity:
    """A number that is wanted large."""

    name: str
    title: str
    unit: str
    """That of tables and figures."""
    scale: float
    """From SI to it."""
    of: Callable[[Numbers], float]
    falls: bool = False
    """Whether it is an acceleration that the paper's requirement can be held against."""


def _without_wall(numbers: Numbers) -> float:
    """The surface's peak downward acceleration, m/s², where the ram touches no wall; where it does,
    below zero, the more so the more often, so that a search is led away from there.
    """
    touches = numbers["impacts"] + numbers["at_wall"]
    return -touches if touches else -numbers["a_surface_min"]


QUANTITIES = (
    Quantity(
        "a_camera", "downward acceleration, as a camera reads it", "m/s²", 1.0,
        lambda numbers: -numbers["a_camera_min"], falls=True,
    ),
    Quantity(
        "a_free", "downward acceleration, true peak, no wall touched", "m/s²", 1.0,
        _without_wall, falls=True,
    ),
    Quantity(
        "a_walls", "downward acceleration, true peak, of the walls' contact law", "m/s²", 1.0,
        lambda numbers: -numbers["a_surface_min"], falls=True,
    ),
    Quantity("v_up", "mean velocity upwards", "mm/s", 1e3, lambda numbers: numbers["v_average"]),
    Quantity(
        "v_down", "mean velocity downwards", "mm/s", 1e3,
        lambda numbers: -numbers["v_average"],
    ),
    Quantity(
        "cycle_up", "transport per cycle, upwards", "mm", 1e3,
        lambda numbers: numbers["transport_per_cycle"],
    ),
    Quantity(
        "cycle_down", "transport per cycle, downwards", "mm", 1e3,
        lambda numbers: -numbers["transport_per_cycle"],
    ),
)  # fmt: skip

NEEDED = (
    *("v_average", "transport_per_cycle", "a_camera_min", "a_surface_min", "impacts", "at_wall"),
    *("current_max", "current_min", "energy_copper", "coil_heat", "saturated_fraction"),
)
"""The numbers that anything here is made of."""


def scores(numbers: Numbers) -> Array:
    """Each of QUANTITIES, SI; -inf where there is none."""
    found = np.array([quantity.of(numbers) for quantity in QUANTITIES])
    return np.where(np.isnan(found), -inf, found)
