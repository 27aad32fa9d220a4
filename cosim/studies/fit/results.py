"""Trials with what was found of them, in numbers and in words."""

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
        line = np.polynomial.Polynomial.fit(time, measured, 1)
        return {
            "mean_error_mm": self.error * 1e3,
            "mean_error_percent": 100 * self.error / (float(np.abs(self.z_part).max()) or 1.0),
            "straight_line_error_mm": float(np.abs(line(time) - measured).mean()) * 1e3,
            "velocity_mm_per_s": float(z[-1] / time[-1]) * 1e3,
            "velocity_measured_mm_per_s": float(measured[-1] / time[-1]) * 1e3,
        }


def together(
    shown: Sequence[Shown], forces: Sequence[Force], found: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """``trials``, a row each: what was found, beside what is known of its normal force, and the
    errors of its simulated path; and means over those whose friction is determined."""
    rows: list[dict[str, Any]] = [
        {"trial": one.name} | own | _change(own["normal_force_weights"], force) | one.errors()
        for one, force, own in zip(shown, forces, found, strict=True)
    ]

    told = [row for row in rows if row.get("kinetic_friction_determined", "yes") == "yes"] or rows

    def every(name: str) -> list[float]:
        return [row[name] for row in told if row[name] is not None]

    changes = every("normal_force_change_percent")
    return {
        "normal_force_weights": [row["normal_force_weights"] for row in rows],
        "mean_error_mm": float(np.mean(every("mean_error_mm"))),
        "mean_error_percent": float(np.mean(every("mean_error_percent"))),
        "straight_line_mean_error_mm": float(np.mean(every("straight_line_error_mm"))),
        "normal_force_change_mean_percent": float(np.mean(changes)) if changes else None,
        "normal_force_change_median_percent": float(np.median(changes)) if changes else None,
        "trials": rows,
    }


def _change(found: float, force: Force) -> dict[str, Any]:
    measured = force.measured
    return {
        "normal_force_measured_weights": measured,
        "normal_force_change_percent": measured and 100 * abs(found - measured) / measured,
    }


def told(numbers: dict[str, Any]) -> str:
    """Fitted or published parameters, trial by trial and together."""
    fitted, rows = numbers["parameters"] == "fitted", numbers["trials"]
    heads = ("µ_k F_n [m g], 90 %", "slides") if fitted else ("sticks", "error [%]")
    table = [("trial", "force [m g]", "measured", "error [mm]", *heads)]
    for row in rows:
        measured = row["normal_force_measured_weights"]
        cells = (row["trial"], f"{row['normal_force_weights']:.2f}")
        cells += ("–" if measured is None else f"{measured:.2f}", f"{row['mean_error_mm']:.3f}")
        if fitted:
            cells += (_number(row, "kinetic_friction", "_weights", ".2f"), str(row["slides"]))
        else:
            cells += (f"{row['stick_fraction']:.0%}", f"{row['mean_error_percent']:.2f}")
        table.append(cells)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(map(str.rjust, row, widths)) for row in table]
    lines += _shared(numbers) if fitted else [f"µ_k {numbers['mu_k']:.4g}"]
    lines.append(
        f"mean error of whole simulated paths {numbers['mean_error_mm']:.4f} mm, "
        f"{numbers['mean_error_percent']:.2f} % (best straight lines: "
        f"{numbers['straight_line_mean_error_mm']:.4f} mm)"
    )
    if numbers["normal_force_change_mean_percent"] is not None:
        mean, median = (numbers[f"normal_force_change_{x}_percent"] for x in ("mean", "median"))
        lines.append(
            f"normal force off the measured one by {mean:.2f} % mean, {median:.2f} % median"
        )
    return "\n".join(lines)


def _shared(numbers: dict[str, Any]) -> list[str]:
    given = "given" if numbers["mu_k_given"] else "from the known forces"
    found = [f"µ_k {numbers['mu_k']:.3f} {given}"]
    if "mu_k_90_percent" in numbers:
        found[0] += f" {_interval(numbers['mu_k_90_percent'], '.3f')}"
    if numbers["plate_over_kinetic_90_percent"]:
        ends = _interval(numbers["plate_over_kinetic_90_percent"], ".2f")
        found.append(f"µ_plate {numbers['mu_plate']:.3f}")
        found.append(f"µ_plate/µ_k {numbers['plate_over_kinetic']:.2f} {ends}")
    rows = numbers["trials"]
    open_ = [row["trial"] for row in rows if row["kinetic_friction_determined"] != "yes"]
    lines = ["; ".join(found), "the tracks tell µ_k F_n; the normal force is that over µ_k"]
    return lines + [f"not determined on both sides: {', '.join(open_)}"] * bool(open_)


def _interval(interval: list[float], form: str) -> str:
    return f"({interval[0]:{form}} … {interval[1]:{form}})"


def _number(numbers: dict[str, Any], name: str, unit: str, form: str) -> str:
    """A number with its interval, or with the end of it that the trials tell."""
    interval, determined = numbers[f"{name}_90_percent"], numbers[f"{name}_determined"]
    if determined == "no":
        return "not determined"
    if determined != "yes":
        return f"{determined} {interval[determined == 'at most']:{form}}"
    return f"{numbers[name + unit]:{form}} {_interval(interval, form)}"
