"""What the closed forms say for one set of numbers: ``theory.json`` and the paper's two figures."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cosim.drive.surface import formulas
from cosim.drive.surface.formulas import GRAVITY, Direction
from cosim.drive.surface.waveforms import Cycle, optimal_cycle, quaid_cycle, quaid_velocity
from cosim.errors import BadInput
from cosim.files.atomic import whole

# The paper's figure 3: friction, ten times g, five times the part's weight; the period is ours.
DEFAULTS = {"mu_s": 0.7, "mu_k": 0.6, "a_max": 10.0 * GRAVITY, "f_n": 5.0, "period": 0.05}

# The largest accelerations of figure 4's curves, in units of the one given.
SHARES = (0.5, 1.0, 1.5, 2.0)


def write(
    out_dir: Path,
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    gravity: float = GRAVITY,
) -> dict[str, Any]:
    """Write ``theory.json``, ``figure3.png`` and ``figure4.png``; returns what the first holds.

    ``a_max`` in m/s², ``period`` in s; :data:`DEFAULTS` has the paper's numbers. BadInput, and no
    file, where there is no transport upwards.
    """
    numbers = collect(mu_s, mu_k, a_max, f_n, period, gravity)
    from cosim.studies.paper import figures  # with matplotlib, which a mere formula does not need

    with whole(out_dir / "theory.json") as temporary:
        text = json.dumps(numbers, indent=2, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with whole(out_dir / "figure3.png") as temporary:
        figures.draw_cycle(temporary, mu_s, mu_k, a_max, f_n, period, gravity)
    with whole(out_dir / "figure4.png") as temporary:
        peaks = [row["a_max"] for row in numbers["figure4"]]
        figures.draw_velocities(temporary, mu_s, mu_k, peaks, period, gravity)
    return numbers


def collect(
    mu_s: float, mu_k: float, a_max: float, f_n: float, period: float, gravity: float = GRAVITY
) -> dict[str, Any]:
    """All numbers of the theory, SI, for one case; velocities over g T beside those in m/s."""
    formulas.admissible(mu_s, mu_k, a_max, f_n, period, "up", False, gravity)
    given = (mu_s, mu_k, a_max, f_n, period)

    def optimal(direction: Direction, robust: bool) -> dict[str, Any]:
        options: Any = {"direction": direction, "robust": robust, "gravity": gravity}
        velocity = formulas.average_velocity(*given, **options)
        return _cycle(optimal_cycle(*given, **options), velocity, gravity)

    def quaid() -> dict[str, Any]:
        stick = formulas.sticking_range(mu_s, f_n, gravity)[1]
        velocity = quaid_velocity(*given, gravity=gravity)
        return _cycle(quaid_cycle(stick, a_max, period), velocity, gravity)

    return {
        "inputs": {
            "mu_s": mu_s,
            "mu_k": mu_k,
            "a_max": a_max,
            "f_n": f_n,
            "period": period,
            "gravity": gravity,
        },
        "conditions": _conditions(mu_s, mu_k, a_max, f_n, gravity),
        "horizontal_equivalent": {
            "up": formulas.horizontal_equivalent(mu_s, mu_k, f_n)._asdict(),
            "down": formulas.horizontal_equivalent(mu_s, mu_k, f_n, "down")._asdict(),
        },
        "up": optimal("up", False),
        "up_robust": _or_reason(lambda: optimal("up", True)),
        "up_quaid": quaid(),
        "down": _or_reason(lambda: optimal("down", False)),
        "down_robust": _or_reason(lambda: optimal("down", True)),
        "normal_force": _force(mu_s, mu_k, a_max, period, gravity),
        "figure4": [
            _force(mu_s, mu_k, share * a_max, period, gravity)
            for share in SHARES
            if share * a_max > formulas.least_peak_acceleration_at_any_force(gravity)
        ],
    }


def table(numbers: dict[str, Any]) -> str:
    """The main numbers of :func:`collect` for a reader."""
    force, gravity = numbers["normal_force"], numbers["inputs"]["gravity"]
    rows = [
        ("fastest transport up", _told(numbers["up"])),
        ("  robust variant", _told(numbers["up_robust"])),
        ("  Quaid's waveform", _told(numbers["up_quaid"])),
        ("fastest transport down", _told(numbers["down"])),
        (
            "best normal force",
            f"{force['f_optimal']:.4f} m_P g, with {force['v_at_optimal'] * 1e3:+.2f} mm/s",
        ),
        (
            "largest normal force",
            f"{force['f_max_sticking']:.4f} m_P g (a part that slides already: "
            f"{force['f_max_sliding']:.4f} m_P g)",
        ),
        (
            "least peak acceleration",
            f"{numbers['conditions']['least_peak_acceleration'] / gravity:.4g} g",
        ),
    ]
    return "\n".join(f"  {name:<25}{value}" for name, value in rows)


def _told(entry: dict[str, Any]) -> str:
    if "not_possible" in entry:
        return f"none: {entry['not_possible']}"
    return f"{entry['v_average'] * 1e3:+.2f} mm/s, stroke {entry['stroke'] * 1e3:.3f} mm"


def _conditions(
    mu_s: float, mu_k: float, a_max: float, f_n: float, gravity: float
) -> dict[str, Any]:
    return {
        "sticking_range": list(formulas.sticking_range(mu_s, f_n, gravity)),
        "slipping_accelerations": [
            formulas.slipping_acceleration(mu_k, f_n, sign, gravity) for sign in (-1.0, 1.0)
        ],
        "least_force_ratio": formulas.least_force_ratio(mu_s),
        "least_peak_acceleration": formulas.least_peak_acceleration(mu_s, f_n, gravity),
        "least_peak_acceleration_at_any_force": (
            formulas.least_peak_acceleration_at_any_force(gravity)
        ),
        "fulfilled": formulas.conditions(mu_s, mu_k, a_max, f_n, gravity),
    }


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


def _force(
    mu_s: float, mu_k: float, a_max: float, period: float, gravity: float
) -> dict[str, float]:
    best = formulas.optimal_force_ratio(mu_s, mu_k, a_max, gravity)
    pair = formulas.horizontal_equivalent(mu_s, mu_k, best)
    velocity = formulas.horizontal_velocity(*pair, a_max, period, gravity)
    return {
        "a_max": a_max,
        "f_min": formulas.least_force_ratio(mu_s),
        "f_optimal": best,
        "f_cubic": formulas.cubic_force_ratio(mu_s, mu_k, a_max, gravity),
        "f_max_sticking": formulas.largest_force_ratio_sticking(mu_s, a_max, gravity),
        "f_max_sliding": formulas.largest_force_ratio_sliding(mu_k, a_max, gravity),
        "v_at_optimal": velocity,
        "v_at_optimal_over_gT": velocity / (gravity * period),
    }


def _or_reason(make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What is made, or the sentence that says why it does not exist."""
    try:
        return make()
    except BadInput as error:
        return {"not_possible": str(error)}
