"""Trials with what was found of them, in numbers and in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.studies.report import Row, markdown


@dataclass(frozen=True)
class Shown:
    """Heights of a trial, measured and simulated, m from its first frame that counts, over s.

    What is simulated is the whole path, or each slide, NaN between them.
    """

    name: str
    time: Array
    z_surface: Array
    z_part: Array
    simulated: tuple[Array, Array]

    @property
    def error(self) -> float:
        """Of a whole path the mean of |z measured − z simulated|, m."""
        time, z = self.simulated
        return float(np.abs(z - np.interp(time, self.time, self.z_part)).mean())

    def errors(self) -> dict[str, float]:
        """Of a whole path the error, also as a share of the largest |z| measured, that of the
        straight line that fits best, and the mean velocities."""
        time, z = self.simulated
        measured = np.interp(time, self.time, self.z_part)
        line = np.polynomial.Polynomial.fit(time, measured, 1)
        return {
            "mean_error_mm": self.error * 1e3,
            "mean_error_percent": 100 * self.error / (float(np.abs(self.z_part).max()) or 1.0),
            "straight_line_error_mm": float(np.abs(line(time) - measured).mean()) * 1e3,
            "velocity_mm_per_s": float(z[-1] / time[-1]) * 1e3,
            "velocity_measured_mm_per_s": float(measured[-1] / time[-1]) * 1e3,
        }


MEANS = {
    "mean_error_mm": "mean_error_mm",
    "mean_error_percent": "mean_error_percent",
    "straight_line_mean_error_mm": "straight_line_error_mm",
    "misfit_um": "misfit_um",
    "noise_um": "noise_um",
}
"""Means over trials, and of which of their numbers."""


def together(rows: Sequence[Row]) -> dict[str, Any]:
    """``trials``, a row each, and means over the trials whose force was found."""
    told = [row for row in rows if row["normal_force_weights"] is not None]
    columns = {key: [row[of] for row in told] for key, of in MEANS.items() if of in rows[0]}
    changes = [row["normal_force_change_percent"] for row in told]
    columns["normal_force_change_mean_percent"] = [x for x in changes if x is not None]
    found = {key: float(np.mean(x)) if x else None for key, x in columns.items()}
    known = columns["normal_force_change_mean_percent"]
    return {
        "normal_force_weights": [row["normal_force_weights"] for row in rows],
        **found,
        "normal_force_change_median_percent": float(np.median(known)) if known else None,
        "trials": rows,
    }


def change(found: float | None, measured: float | None) -> Row:
    """A normal force beside the measured one, and how far off it is."""
    off = None if found is None else measured and 100 * abs(found - measured) / measured
    return {"normal_force_measured_weights": measured, "normal_force_change_percent": off}


def told(numbers: dict[str, Any]) -> str:
    """Fitted or published parameters, trial by trial and together."""
    fitted = numbers["parameters"] == "fitted"
    columns = FITTED if fitted else EVALUATED
    rows = [
        {head: row[name] for head, name in (FORCES | columns).items()}
        | ({FRICTION: _friction(row)} if fitted else {})
        for row in numbers["trials"]
    ]
    lines = [*markdown(rows), "", *(_shared(numbers) if fitted else _whole_paths(numbers))]
    if numbers["normal_force_change_mean_percent"] is not None:
        mean, median = (numbers[f"normal_force_change_{x}_percent"] for x in ("mean", "median"))
        lines.append(
            f"normal force off the measured one by {mean:.2f} % mean, {median:.2f} % median"
        )
    return "\n".join(lines)


FORCES = {
    "trial": "trial",
    "force [m·g]": "normal_force_weights",
    "measured": "normal_force_measured_weights",
}
FITTED = {"slides": "slides", "misfit [µm]": "misfit_um", "noise [µm]": "noise_um"}
EVALUATED = {
    "error [mm]": "mean_error_mm",
    "error [%]": "mean_error_percent",
    "sticks, share": "stick_fraction",
}
FRICTION = "µ_k F_n [m·g], 90 %"


def _whole_paths(numbers: dict[str, Any]) -> list[str]:
    return [
        f"µ_k {numbers['mu_k']:.4g}",
        f"mean error of whole simulated paths {numbers['mean_error_mm']:.4f} mm, "
        f"{numbers['mean_error_percent']:.2f} % (best straight lines: "
        f"{numbers['straight_line_mean_error_mm']:.4f} mm)",
    ]


def _shared(numbers: dict[str, Any]) -> list[str]:
    given = "given" if numbers["mu_k_given"] else "from the known forces"
    found = [f"µ_k {numbers['mu_k']:.3f} {given}"]
    if "mu_k_90_percent" in numbers:
        found[0] += f" {_interval(numbers['mu_k_90_percent'], '.3f')}"
    if (ends := numbers["plate_over_kinetic_90_percent"]) and ends[1] is None:
        words = "the search ends there, and no force above is sure; are units and columns right?"
        found.append(f"µ_plate/µ_k at least {ends[0]:.2f}: {words}")
    elif ends:
        found.append(f"µ_plate {numbers['mu_plate']:.3f}")
        found.append(f"µ_plate/µ_k {numbers['plate_over_kinetic']:.2f} {_interval(ends, '.2f')}")
    product = "the tracks tell µ_k F_n; the normal force is that over µ_k"
    return ["; ".join(found), product, headline(numbers)]


def headline(numbers: dict[str, Any]) -> str:
    """How well the slides of the determined trials are predicted."""
    rows = numbers["trials"]
    count = sum(row["normal_force_weights"] is not None for row in rows)
    if not count:
        return "No trial has slides enough to determine its force"
    return (
        f"Slides are predicted to {numbers['misfit_um']:.1f} µm rms, noise of the tracks "
        f"{numbers['noise_um']:.1f} µm: means over the {count} of {len(rows)} trials determined"
    )


def _interval(interval: list[float], form: str) -> str:
    return f"({interval[0]:{form}} … {interval[1]:{form}})"


def _friction(row: Row) -> str:
    """µ_k F_n with its interval, or with the end of it that the trial tells."""
    interval, determined = row["kinetic_friction_90_percent"], row["kinetic_friction_determined"]
    if determined == "no":
        return "not determined"
    if determined != "yes":
        return f"{determined} {interval[determined == 'at most']:.2f}"
    return f"{row['kinetic_friction_weights']:.2f} {_interval(interval, '.2f')}"
