"""The knife edge of the optimal waveform: how a small timing error, or the solver, loses it all.

Part and surface are to meet again just at the period's end. If they meet a little before, the
surface overtakes the part, which then slips for the whole next phase. A solver that finds the end
of slipping only to within its step, or to within a velocity threshold, makes that error by itself.
"""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.drive.surface.formulas import GRAVITY, average_velocity, largest_force_ratio_sticking
from cosim.drive.surface.waveforms import Cycle, closing_cycle, optimal_cycle
from cosim.files.atomic import whole
from cosim.mechanics import part

Array = npt.NDArray[np.float64]

PERIODS = 20
STEP = 1e-4  # s, the published scheme's
V_MIN = 1e-5  # m/s, the same

METHODS: dict[str, Callable[..., part.PartMotion]] = {
    "exact": part.exact,
    f"Moreau, {STEP * 1e3:g} ms": lambda *a, **k: part.moreau(*a, step=STEP, **k),
    f"threshold {V_MIN * 1e6:g} µm/s, {STEP * 1e3:g} ms": lambda *a, **k: part.threshold(
        *a, step=STEP, v_min=V_MIN, **k
    ),
    f"threshold {V_MIN * 1e6:g} µm/s, {STEP * 1e4:g} µs": lambda *a, **k: part.threshold(
        *a, step=STEP / 100, v_min=V_MIN, **k
    ),
}


def mistimed(cycle: Cycle, error: float) -> Cycle:
    """The cycle with its first phase ended ``error`` periods later (earlier, if negative)."""
    _, first, _, period = cycle.times
    first += error * period
    rise, fall = cycle.accelerations[0], -cycle.accelerations[1]
    second = 0.5 * (period + first * (1.0 + rise / fall))
    return closing_cycle((0.0, first, second, period), cycle.accelerations)


def simulated(
    method: Callable[..., part.PartMotion],
    cycle: Cycle,
    mu_s: float,
    mu_k: float,
    f_n: float,
    gravity: float = GRAVITY,
) -> float:
    """Mean velocity of the part, m/s, over the second half of 20 periods."""
    times, velocities = cycle.knots()
    half, end = PERIODS // 2 * cycle.times[3], PERIODS * cycle.times[3]
    motion = method(
        times,
        velocities,
        mu_s=mu_s,
        mu_k=mu_k,
        force_per_mass=f_n * gravity,
        gravity=gravity,
        periods=PERIODS,
        output=np.array([0.0, half, end * (1 - 1e-12)]),
    )
    return float(motion.z[2] - motion.z[1]) / (end - half)


def write(
    out_dir: Path,
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    gravity: float = GRAVITY,
) -> None:
    """Write ``knife_edge.csv`` and ``knife_edge.png``: v_ave over the timing error and over f_n."""
    sizes = np.logspace(-9, -2, 29)
    errors = np.concatenate([-sizes[::-1], sizes])
    cycle = optimal_cycle(mu_s, mu_k, a_max, f_n, period, gravity=gravity)
    over_error = {
        name: [
            simulated(method, mistimed(cycle, float(e)), mu_s, mu_k, f_n, gravity) for e in errors
        ]
        for name, method in METHODS.items()
    }
    least = 1.05 / mu_k
    ratios = np.linspace(least, largest_force_ratio_sticking(mu_s, a_max, gravity) * 0.99, 40)
    cycles = [
        optimal_cycle(mu_s, mu_k, a_max, float(f), period, gravity=gravity, margin=1e-6)
        for f in ratios
    ]
    over_force = {
        name: [
            simulated(method, c, mu_s, mu_k, float(f), gravity)
            for c, f in zip(cycles, ratios, strict=True)
        ]
        for name, method in METHODS.items()
    }
    theory = [
        average_velocity(mu_s, mu_k, a_max, float(f), period, gravity=gravity) for f in ratios
    ]
    with (
        whole(out_dir / "knife_edge.csv") as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        table = csv.writer(file)
        table.writerow(["over", "value", "method", "v_average [m/s]"])
        for kind, values, curves in (
            ("timing error [periods]", errors, over_error),
            ("f_n [m_P g]", ratios, over_force | {"theory": theory}),
        ):
            for name, curve in curves.items():
                table.writerows(
                    [kind, repr(float(x)), name, repr(float(y))]
                    for x, y in zip(values, curve, strict=True)
                )
    best = average_velocity(mu_s, mu_k, a_max, f_n, period, gravity=gravity)
    from cosim.studies.paper.knife_edge_figure import draw

    with whole(out_dir / "knife_edge.png") as temporary:
        draw(temporary, errors, over_error, best, ratios, over_force, theory)
