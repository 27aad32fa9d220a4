"""The closed forms evaluated for one case, as numbers, a table and the paper's two figures."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.drive.surface import formulas
from cosim.drive.surface.formulas import Direction, Transport
from cosim.drive.surface.waveforms import (
    Cycle,
    optimal_cycle,
    quaid_cycle,
    quaid_limit,
    quaid_velocity,
)
from cosim.errors import BadInput
from cosim.files.atomic import write_json
from cosim.typed import typed

if TYPE_CHECKING:
    from cosim.files.picture import Picture

FIGURE_3 = Transport(mu_s=0.7, mu_k=0.6, a_max=98.1, f_n=5.0, period=0.05)
"""The case of the paper's figure 3 (a_max 10 g); the paper gives no period, this is ours."""

SHARES = (0.5, 1.0, 1.5, 2.0)
"""The largest accelerations of figure 4's curves, in units of the one given."""


@dataclass(frozen=True, repr=False)
class Theory:
    """What the closed forms give for a case: ``numbers``, SI, as ``theory.json`` holds them."""

    case: Transport
    numbers: dict[str, Any]

    def plot(self) -> "Picture":
        """The paper's figure 3: one period of the optimal waveform, surface and part."""
        from cosim.studies.paper import figures

        return figures.draw_cycle(self.case)

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``theory.json``, and the paper's figures ``figure3.png`` and ``figure4.png``."""
        from cosim.studies.paper import figures

        out = Path(folder)
        write_json(out / "theory.json", self.numbers)
        self.plot().write(out / "figure3.png")
        peaks = [row["a_max"] for row in self.numbers["figure4"]]
        figures.draw_velocities(self.case, peaks).write(out / "figure4.png")

    def __repr__(self) -> str:
        force, gravity = self.numbers["normal_force"], self.case.gravity
        least = self.numbers["conditions"]["least_peak_acceleration"] / gravity
        rows = {
            "fastest transport up": _told(self.numbers["up"]),
            "  robust variant": _told(self.numbers["up_robust"]),
            "  Quaid's waveform": _told(self.numbers["up_quaid"]),
            "fastest transport down": _told(self.numbers["down"]),
            "best normal force": f"{force['f_optimal']:.4f} m_P g, with "
            f"{force['v_at_optimal'] * 1e3:+.2f} mm/s",
            "largest normal force": f"{force['f_max_sticking']:.4f} m_P g (a part that slides "
            f"already: {force['f_max_sliding']:.4f} m_P g)",
            "least peak acceleration": f"{least:.4g} g",
        }
        return "\n".join(f"  {name:<25}{value}" for name, value in rows.items())


@typed
def theory(
    *,
    mu_s: float = FIGURE_3.mu_s,
    mu_k: float = FIGURE_3.mu_k,
    a_max: float = FIGURE_3.a_max,
    f_n: float = FIGURE_3.f_n,
    period: float = FIGURE_3.period,
) -> Theory:
    """The closed forms of vertical vibratory transport (Yako et al., ICRA 2024, corrected).

    Coefficients of friction, the surface's largest acceleration in m/s², the normal force over the
    part's weight, and the period in s; by default those of the paper's figure 3. Raises BadInput
    where there is no transport upwards.

    ``numbers`` of what comes back, as ``theory.json`` has them, SI: the ``inputs``, the
    ``conditions`` of transport, ``horizontal_equivalent``, the optimal cycles ``up``, ``down``,
    their robust variants and Quaid's (``v_average`` in m/s, and over g T), the best and the largest
    ``normal_force`` over the part's weight, and ``figure4``, a row for each acceleration.

    >>> round(theory(period=0.05).numbers["up"]["v_average"], 4)
    0.1524
    """
    case = Transport(mu_s, mu_k, a_max, f_n, period)
    return Theory(case, collect(case))


def collect(case: Transport) -> dict[str, Any]:
    """All numbers of the theory, SI, for one case; velocities over g T beside those in m/s."""
    case.coefficients()  # raises where there is no transport
    mu_s, mu_k, f_n, gravity = case.mu_s, case.mu_k, case.f_n, case.gravity

    def optimal(direction: Direction, robust: bool) -> dict[str, Any]:
        variant = replace(case, direction=direction, robust=robust)
        return _cycle(optimal_cycle(variant), formulas.average_velocity(variant), gravity)

    def possible(direction: Direction, robust: bool) -> dict[str, Any]:
        try:
            return optimal(direction, robust)
        except BadInput as error:
            return {"not_possible": str(error)}

    stick = quaid_limit(mu_s, f_n, "up", gravity)
    quaid = quaid_cycle(stick, case.a_max, case.period)
    peaks = [share * case.a_max for share in SHARES]
    least = formulas.least_peak_acceleration_at_any_force(gravity)
    names = ("mu_s", "mu_k", "a_max", "f_n", "period", "gravity")
    return {
        "inputs": {name: getattr(case, name) for name in names},
        "conditions": {
            "sticking_range": list(formulas.sticking_range(mu_s, f_n, gravity)),
            "slipping_accelerations": [
                formulas.slipping_acceleration(mu_k, f_n, sign, gravity) for sign in (-1.0, 1.0)
            ],
            "least_force_ratio": formulas.least_force_ratio(mu_s),
            "least_peak_acceleration": formulas.least_peak_acceleration(mu_s, f_n, gravity),
            "least_peak_acceleration_at_any_force": least,
        },
        "horizontal_equivalent": {
            "up": formulas.horizontal_equivalent(mu_s, mu_k, f_n)._asdict(),
            "down": formulas.horizontal_equivalent(mu_s, mu_k, f_n, "down")._asdict(),
        },
        "up": optimal("up", False),
        "up_robust": possible("up", True),
        "up_quaid": _cycle(quaid, quaid_velocity(case), gravity),
        "down": possible("down", False),
        "down_robust": possible("down", True),
        "normal_force": formulas.force_limits(case, case.a_max),
        "figure4": [formulas.force_limits(case, peak) for peak in peaks if peak > least],
    }


def _told(entry: dict[str, Any]) -> str:
    """Velocity and stroke of an entry of ``numbers`` in words, or why there is no transport."""
    if "not_possible" in entry:
        return f"none: {entry['not_possible']}"
    return f"{entry['v_average'] * 1e3:+.2f} mm/s, stroke {entry['stroke'] * 1e3:.3f} mm"


def _cycle(cycle: Cycle, velocity: float, gravity: float) -> dict[str, Any]:
    times, velocities = cycle.knots()
    return {
        "v_average": velocity,
        "v_average_over_gT": velocity / (gravity * cycle.times[3]),
        "t1": cycle.times[1],
        "t2": cycle.times[2],
        "stroke": cycle.stroke(),
        "accelerations": list(cycle.accelerations),
        "knot_times": times.tolist(),
        "knot_velocities": velocities.tolist(),
    }
