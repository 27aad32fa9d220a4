"""How a small error of timing, or of the solver, loses the transport of the optimal waveform.

With the optimal waveform the part reaches the surface's velocity exactly at the period's end. If it
does so a little earlier, the surface becomes faster than the part, which then slips for the whole
next phase. A solver that locates the end of slipping only to within its step or a velocity
threshold makes this error by itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cosim.drive.surface.formulas import Transport, average_velocity, largest_force_ratio
from cosim.drive.surface.waveforms import Cycle, closed_cycle, optimal_cycle
from cosim.files.picture import Picture, grid
from cosim.mechanics import part
from cosim.studies.paper.theory import FIGURE_3
from cosim.studies.report import Report, Row

PERIODS = 20  # of a simulation; the second half is averaged
STEP, V_MIN = part.PUBLISHED_STEP, part.PUBLISHED_V_MIN

Method = Callable[..., part.PartMotion]
_THRESHOLD, _NAME = partial(part.threshold, v_min=V_MIN), f"threshold {V_MIN * 1e6:g} µm/s"
METHODS: dict[str, tuple[Method, str, str]] = {
    "exact": (part.exact, "#1f6fb2", "-"),
    f"Moreau, {STEP * 1e3:g} ms": (partial(part.moreau, step=STEP), "#2a9d8f", "--"),
    f"{_NAME}, {STEP * 1e3:g} ms": (partial(_THRESHOLD, step=STEP), "#e9a03b", "-"),
    f"{_NAME}, {STEP * 1e4:g} µs": (partial(_THRESHOLD, step=STEP / 100), "#d1495b", "-"),
}
"""Solvers, with the colours and line styles of their curves."""
TIMING, FORCE, THEORY = "timing error [periods]", "f_n [m_P g]", "theory"
CLOSED_FORM: dict[str, Any] = {"color": "0.2", "alpha": 0.3, "label": "closed form"}


def mistimed(cycle: Cycle, error: float) -> Cycle:
    """The cycle with its first phase ended ``error`` periods later (earlier, if negative)."""
    _, end_first, _, period = cycle.times
    first, fall, _ = cycle.accelerations
    return closed_cycle(end_first + error * period, period, first, -fall)


def simulated(method: Method, cycle: Cycle, case: Transport) -> float:
    """Mean velocity of the part, m/s, over the second half of PERIODS."""
    half, end = PERIODS // 2 * case.period, PERIODS * case.period
    motion = method(
        *cycle.knots(),
        mu_s=case.mu_s,
        mu_k=case.mu_k,
        force_per_mass=case.f_n * case.gravity,
        gravity=case.gravity,
        periods=PERIODS,
        output=np.array([0.0, half, end * (1 - 1e-12)]),  # rounding must not put it past the end
    )
    return float(motion.z[2] - motion.z[1]) / (end - half)


def report() -> Report:
    """v_ave over the timing error and over f_n, in the case of the paper's figure 3."""
    case, optimum = FIGURE_3, optimal_cycle(FIGURE_3)
    sizes = np.logspace(-9, -2, 29)
    errors = [*(-sizes[::-1]).tolist(), *sizes.tolist()]
    most = largest_force_ratio(case.mu_s, case.a_max, case.gravity) * 0.99
    ratios = np.linspace(1.05 / case.mu_k, most, 40).tolist()
    pressed = [replace(case, f_n=ratio) for ratio in ratios]
    rows: list[Row] = []

    def add(over: str, values: Sequence[float], name: str, curve: Sequence[float]) -> None:
        for x, y in zip(values, curve, strict=True):
            rows.append({"over": over, "value": x, "method": name, "v_average [m/s]": y})

    for over, values, cycles in (
        (TIMING, errors, [(mistimed(optimum, error), case) for error in errors]),
        (FORCE, ratios, [(optimal_cycle(at, margin=1e-6), at) for at in pressed]),
    ):
        for name, (method, *_) in METHODS.items():
            add(over, values, name, [simulated(method, *pair) for pair in cycles])
    add(FORCE, ratios, THEORY, [average_velocity(variant) for variant in pressed])
    best, early = average_velocity(case), simulated(part.exact, mistimed(optimum, -1e-9), case)
    message = (
        f"Of the {best * 1e3:.0f} mm/s that the optimal waveform transports {early * 1e3:.0f} mm/s "
        "are left if the part meets the surface a billionth of a period early"
    )
    name, title = "knife_edge", "The optimal waveform is a knife edge"
    return Report(name, title, rows, [f"{message}."], {}, {"": partial(draw, rows, best)})


def draw(rows: Sequence[Row], best: float) -> Picture:
    """The mean velocity by each method over the timing error, and over f_n; ``best``: m/s."""
    figure, (left, right) = grid(2, 2, 13.0, 4.8, 0.0)
    left.set_xscale("symlog", linthresh=1e-9, linscale=0.4)
    left.axhline(best * 1e3, lw=3.0, **CLOSED_FORM)
    for axis, over in ((left, TIMING), (right, FORCE)):
        for name in (THEORY, *METHODS):
            own = [row for row in rows if (row["over"], row["method"]) == (over, name)]
            x, y = ([row[of] for row in own] for of in ("value", "v_average [m/s]"))
            look: dict[str, Any] = {"lw": 4.0, **CLOSED_FORM}
            if name != THEORY:
                _, color, style = METHODS[name]
                look = {"color": color, "ls": style, "lw": 1.4, "label": name}
            if own:
                axis.plot(x, np.array(y) * 1e3, **look)
        axis.set_ylabel("mean velocity of the part [mm/s]")
        axis.axhline(0.0, color="0.5", lw=0.6)
        axis.legend(fontsize=8)
    left.set_xticks([-1e-2, -1e-4, -1e-6, -1e-8, 0, 1e-8, 1e-6, 1e-4, 1e-2])
    left.set(
        xlabel="first phase ends later than the optimum by [periods]",
        title="A part that meets the surface early loses most of the transport",
    )
    right.set(
        xlabel="normal force over the part's weight, f_n",
        title="A solver with a velocity threshold meets it early by itself",
    )
    return figure
