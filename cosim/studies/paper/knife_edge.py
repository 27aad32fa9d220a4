"""How a small error of timing, or of the solver, loses the transport of the optimal waveform.

With the optimal waveform part and surface meet again exactly at the period's end. If they meet a
little earlier, the surface overtakes the part, which then slips for the whole next phase. A solver
that finds the end of slipping only to within its step, or to within a velocity threshold, makes
that error by itself.
"""

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cosim.drive.surface.formulas import Transport, average_velocity, largest_force_ratio
from cosim.drive.surface.waveforms import Cycle, closed_cycle, optimal_cycle
from cosim.files.atomic import whole
from cosim.mechanics import part

PERIODS = 20
STEP, V_MIN = part.PUBLISHED_STEP, part.PUBLISHED_V_MIN

Method = Callable[..., part.PartMotion]
METHODS: dict[str, Method] = {
    "exact": part.exact,
    f"Moreau, {STEP * 1e3:g} ms": partial(part.moreau, step=STEP),
    f"threshold {V_MIN * 1e6:g} µm/s, {STEP * 1e3:g} ms": partial(
        part.threshold, step=STEP, v_min=V_MIN
    ),
    f"threshold {V_MIN * 1e6:g} µm/s, {STEP * 1e4:g} µs": partial(
        part.threshold, step=STEP / 100, v_min=V_MIN
    ),
}


def mistimed(cycle: Cycle, error: float) -> Cycle:
    """The cycle with its first phase ended ``error`` periods later (earlier, if negative)."""
    _, end_first, _, period = cycle.times
    first, fall, _ = cycle.accelerations
    return closed_cycle(end_first + error * period, period, first, -fall)


def simulated(method: Method, cycle: Cycle, case: Transport) -> float:
    """Mean velocity of the part, m/s, over the second half of 20 periods."""
    half, end = PERIODS // 2 * case.period, PERIODS * case.period
    motion = method(
        *cycle.knots(),
        mu_s=case.mu_s,
        mu_k=case.mu_k,
        force_per_mass=case.f_n * case.gravity,
        gravity=case.gravity,
        periods=PERIODS,
        output=np.array([0.0, half, end * (1 - 1e-12)]),
    )
    return float(motion.z[2] - motion.z[1]) / (end - half)


def write(out_dir: Path, case: Transport) -> None:
    """Write ``knife_edge.csv`` and ``knife_edge.png``: v_ave over the timing error and over f_n."""
    sizes = np.logspace(-9, -2, 29)
    errors = np.concatenate([-sizes[::-1], sizes])
    cycle = optimal_cycle(case)
    cycles = [mistimed(cycle, float(error)) for error in errors]
    most = largest_force_ratio(case.mu_s, case.a_max, case.gravity) * 0.99
    ratios = np.linspace(1.05 / case.mu_k, most, 40)
    pressed = [replace(case, f_n=float(ratio)) for ratio in ratios]
    over_error, over_force = {}, {}
    for name, method in METHODS.items():
        over_error[name] = [simulated(method, one, case) for one in cycles]
        over_force[name] = [
            simulated(method, optimal_cycle(one, margin=1e-6), one) for one in pressed
        ]
    theory = [average_velocity(one) for one in pressed]
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
    from cosim.studies.paper.knife_edge_figure import draw

    path = out_dir / "knife_edge.png"
    draw(path, errors, over_error, average_velocity(case), ratios, over_force, theory)
