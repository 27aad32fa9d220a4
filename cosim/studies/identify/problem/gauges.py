"""Measurements on a machine beside its trials: what each one would show on a given rig.

Each value follows in closed form from the stepper's numbers of the rig. A file of bounds names such
measurements in its tables ``measured``. Accuracies are assumed, unless a source is given.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import pi, sqrt

import numpy as np

from cosim.mechanics.stickslip import rests_of, suspension_force

Numbers = Mapping[str, float]

LOAD = 0.05
"""kg, hung on the platform for the gauge ``deflection``."""


@dataclass(frozen=True)
class Gauge:
    """A measurement of one number, SI."""

    how: str
    unit: str
    """Unit in tables."""
    scale: float
    """Factor from SI to this unit."""
    sd: float
    """Its accuracy, a standard deviation, SI."""
    share: float
    """A further, independent standard deviation, as a share of the value."""
    of: Callable[[Numbers], float]


def leaves(rig: Numbers, wall: str) -> float:
    """The current at which a ram held at a wall by it just leaves, A: Bl i + F_m(q) = m_r g."""
    q = rig["travel_up"] if wall == "up" else -rig["travel_down"]
    force = rig["ram_mass"] * rig["gravity"] - suspension_force(rig, np.array([q]))[0]
    return float(force / rig["force_factor"])


def decay(rig: Numbers) -> float:
    """Of the flexures' ring-down with the ram held at a wall, 1/s: c/2m."""
    return 0.5 * rig["flexure_damping"] / (rig["surface_mass"] + rig["ram_mass"])


def ring(rig: Numbers) -> float:
    """The frequency of the flexures' ring-down with the ram held at a wall, Hz; 0 if overdamped."""
    square = rig["flexure_stiffness"] / (rig["surface_mass"] + rig["ram_mass"])
    return sqrt(max(square - decay(rig) ** 2, 0.0)) / (2.0 * pi)


BIASES = {"": 0.0, " down": -1.0}
"""Coil currents (A) at which the ram's resonance is measured, by suffix of the gauge."""

AT_WALL = 500.0
"""Hz, in place of a resonance where the current holds the ram at a wall: no peak lies below it."""

_NUDGE = 1e-6
"""m, the step of the finite difference that gives the suspension's stiffness."""


def resonance(rig: Numbers, current: float) -> float:
    """The frequency at which the ram swings about its rest nearest the centre under a current (A),
    the housing held, Hz: √(k/m_r)/2π."""
    # A constant coil force moves the rests like a smaller g.
    lighter = rig["force_factor"] * current / rig["ram_mass"]
    q = min(rests_of({**rig, "gravity": rig["gravity"] - lighter}), key=abs)
    if not -rig["travel_down"] < q < rig["travel_up"]:
        return AT_WALL
    below, above = suspension_force(rig, q + np.array([-_NUDGE, _NUDGE])).tolist()
    return sqrt(max(below - above, 0.0) / (2.0 * _NUDGE) / rig["ram_mass"]) / (2.0 * pi)


_RING = "hold the ram at a wall by a current, no part; pluck the platform, film its ring-down: its "

GAUGES = {
    **{
        f"click {end}": Gauge(
            f"hold the ram at its {wall} wall by a current, let that go slowly, a small tone on "
            "it: the current at which a back-EMF sets in",
            "A", 1.0, 0.02, 0.0, partial(leaves, wall=end),
        )
        for end, wall in (("up", "upper"), ("down", "lower"))
    },
    "force factor": Gauge(
        "the coil's impedance for small tones above the ram's resonance, housing held: what the "
        "free ram adds is Bl² over its known mass",
        "N/A", 1.0, 0.0, 0.03, lambda rig: rig["force_factor"],
    ),
    **{
        f"resonance{end}": Gauge(
            f"the peak of the coil's impedance for small tones, housing held, at {current:g} A",
            "Hz", 1.0, 0.0, 0.03, partial(resonance, current=current),
        )
        for end, current in BIASES.items()
    },
    "weight": Gauge(
        "weigh housing, platform and ram, and a third of the flexures; half of these is not known",
        "g", 1e3, 3e-4, 0.0, lambda rig: rig["surface_mass"] + rig["ram_mass"],
    ),
    "travel": Gauge(
        "the ram's way from wall to wall, by a calliper",
        "mm", 1e3, 5e-5, 0.0, lambda rig: rig["travel_up"] + rig["travel_down"],
    ),
    "ring-down": Gauge(_RING + "frequency", "Hz", 1.0, 0.0, 0.01, ring),
    "decay": Gauge(_RING + "decay", "1/s", 1.0, 0.0, 0.1, decay),
    "deflection": Gauge(
        f"hang {LOAD * 1e3:.0f} g on the platform: how far it sinks, by the camera",
        "mm", 1e3, 2e-5, 0.0, lambda rig: LOAD * rig["gravity"] / rig["flexure_stiffness"],
    ),
}  # fmt: skip
"""Gauges by their names in a file of bounds."""
