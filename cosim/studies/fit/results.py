"""Trials with what was found of them, in numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.mechanics import part
from cosim.studies.fit.forces import Force

STEP = part.PUBLISHED_STEP
"""s, at which a measured and a simulated path are compared."""


@dataclass(frozen=True)
class Shown:
    """Heights of a trial, measured and simulated, m from its first frame that counts, over s."""

    name: str
    time: Array
    z_surface: Array
    z_part: Array
    simulated: tuple[Array, Array]

    @property
    def error(self) -> float:
        """The mean of |z measured − z simulated|, m."""
        time, z = self.simulated
        return float(np.abs(z - np.interp(time, self.time, self.z_part)).mean())

    def errors(self) -> dict[str, float]:
        """The error, also as a share of the largest |z| measured, that of the straight line that
        fits best, and the mean velocities."""
        time, z = self.simulated
        measured = np.interp(time, self.time, self.z_part)
        largest = float(np.abs(self.z_part).max())
        mean = self.error
        line = np.polynomial.Polynomial.fit(time, measured, 1)
        return {
            "mean_error_mm": mean * 1e3,
            "mean_error_percent": 100 * mean / (largest or 1.0),
            "straight_line_error_mm": float(np.abs(line(time) - measured).mean()) * 1e3,
            "velocity_mm_per_s": float(z[-1] / time[-1]) * 1e3,
            "velocity_measured_mm_per_s": float(measured[-1] / time[-1]) * 1e3,
        }


class Solved:
    """Trials with their parameters and simulated motions."""

    def __init__(
        self,
        shown: Sequence[Shown],
        forces: Sequence[Force],
        numbers: dict[str, Any],
        found: Sequence[dict[str, Any]],
    ) -> None:
        self.shown, self.forces = shown, forces
        """What is known of each trial's normal force beside it."""
        rows = [
            {"trial": one.name} | own | _change(own["normal_force_weights"], force) | one.errors()
            for one, force, own in zip(shown, forces, found, strict=True)
        ]
        self.numbers = numbers | _summed(rows)
        """What ``fit.json`` holds; units as the names say, forces in weights of the part."""


def _change(found: float, force: Force) -> dict[str, Any]:
    measured = force.measured
    return {
        "normal_force_measured_weights": measured,
        "normal_force_change_percent": measured and 100 * abs(found - measured) / measured,
    }


def _summed(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """All trials together."""

    def every(name: str) -> list[float]:
        return [row[name] for row in rows if row[name] is not None]

    changes = every("normal_force_change_percent")
    return {
        "normal_force_weights": every("normal_force_weights"),
        "mean_error_mm": float(np.mean(every("mean_error_mm"))),
        "mean_error_percent": float(np.mean(every("mean_error_percent"))),
        "straight_line_mean_error_mm": float(np.mean(every("straight_line_error_mm"))),
        "normal_force_change_mean_percent": float(np.mean(changes)) if changes else None,
        "normal_force_change_median_percent": float(np.median(changes)) if changes else None,
        "trials": rows,
    }
