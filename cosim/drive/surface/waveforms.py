"""The surface's motion over one period: the optimal waveform, its variants, and Quaid's."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.drive.surface.formulas import (
    GRAVITY,
    Direction,
    Transport,
    positive,
    sign_of,
    sticking_range,
)
from cosim.errors import BadInput

ROUNDING_MARGIN = 1e-9
"""The ``margin`` of :func:`optimal_cycle` that rounding needs; less exact solvers need more."""


@dataclass(frozen=True)
class Cycle:
    """A period of three phases of constant acceleration, repeated for ever; SI units.

    Velocity and position are the same at both ends; the position at t = 0 is 0.
    """

    times: tuple[float, float, float, float]  # s: 0, the ends of the phases, the period
    accelerations: tuple[float, float, float]  # m/s²
    start_velocity: float  # m/s

    def position(self, time: npt.ArrayLike) -> Array:
        """The surface's height, m, at times in s."""
        times, velocities = self.knots()
        within = np.mod(np.asarray(time, dtype=float), times[3])
        phase = np.clip(np.searchsorted(times, within, side="right") - 1, 0, 2)
        since = within - times[phase]
        travelled = 0.5 * (velocities[1:] + velocities[:-1]) * np.diff(times)
        start = np.concatenate([[0.0], np.cumsum(travelled)])[phase]
        mean = velocities[phase] + 0.5 * np.asarray(self.accelerations)[phase] * since
        return start + mean * since

    def stroke(self) -> float:
        """The height between the surface's lowest and highest point, m."""
        times, velocities = self.knots()
        turns = times[:-1] - velocities[:-1] / np.asarray(self.accelerations)  # velocity 0
        inside = turns[(turns > times[:-1]) & (turns < times[1:])]
        return float(np.ptp(self.position(np.concatenate([times, inside]))))

    def knots(self) -> tuple[Array, Array]:
        """Times, s, and velocities, m/s, between which the velocity is linear; one period."""
        times = np.array(self.times)
        change = np.cumsum(np.asarray(self.accelerations) * np.diff(times))
        change[-1] = 0.0  # removes rounding: a cycle returns to its velocity
        return times, self.start_velocity + np.concatenate([[0.0], change])


def optimal_cycle(case: Transport, margin: float = 0.0) -> Cycle:
    """The motion of a surface with at most a_max that transports the part fastest.

    With the coefficients µ̃_s, µ̃_k of `horizontal_equivalent`: up, µ̃_s g on [0, T1], −a_max on
    [T1, T2], +a_max on [T2, T]; down, with all signs changed. T1 = T µ̃_k/(µ̃_s + µ̃_k).

    Part and surface meet again exactly at T. If they meet a little earlier, the surface, still at
    a_max, overtakes the part, which then slips for the whole next phase. ``margin``, a fraction,
    avoids that: T1 comes ``margin`` T later, so that they meet ``margin`` T after the period's end,
    and the first phase stays below the limit of friction as if µ_s were that much smaller.
    """
    pair = case.coefficients()
    static = pair.static - margin * (case.mu_k if case.robust else case.mu_s) * case.f_n
    end_first = case.period * (pair.kinetic / (static + pair.kinetic) + margin)
    cycle = closed_cycle(
        end_first, case.period, static * case.gravity, case.a_max, sign_of(case.direction)
    )
    if static <= 0.0 or cycle.times[2] >= case.period:
        raise BadInput(f"margin = {margin:g} leaves no transport with these numbers.")
    return cycle


def closed_cycle(
    end_first: float, period: float, first: float, a_max: float, sign: float = 1.0
) -> Cycle:
    """The cycle at ``first``, −a_max and +a_max, m/s², that returns to its velocity and height.

    The first phase ends at ``end_first``, s; ``sign`` −1 turns the motion over.
    """
    end_second = 0.5 * (period + end_first * (1.0 + first / a_max))
    times = (0.0, end_first, end_second, period)
    accelerations = (sign * first, -sign * a_max, sign * a_max)
    lengths = np.diff(times)
    gained = np.asarray(accelerations) * lengths
    travelled = float(np.sum(gained * (period - np.asarray(times[1:]) + 0.5 * lengths)))
    return Cycle(times, accelerations, -travelled / period)


def quaid_cycle(a_stick: float, a_max: float, period: float, direction: Direction = "up") -> Cycle:
    """Quaid's waveform: ±a_stick, m/s², while the part is to stick, ∓a_max while it is to slip.

    The slipping phase is [T1, T − T1] with T1 = T a_max/(2 (a_stick + a_max)) (Quaid 1999).
    """
    positive(a_stick=a_stick, a_max=a_max, period=period)
    sign = sign_of(direction)
    end = 0.5 * period * a_max / (a_stick + a_max)
    slow, fast = sign * a_stick, -sign * a_max
    return Cycle((0.0, end, period - end, period), (slow, fast, slow), 0.0)


def quaid_limit(mu_s: float, f_n: float, direction: Direction, gravity: float = GRAVITY) -> float:
    """The largest ``a_stick``, m/s², with which the part still sticks."""
    low, high = sticking_range(mu_s, f_n, gravity)
    return high if direction == "up" else -low


def quaid_velocity(case: Transport, a_stick: float | None = None) -> float:
    """The part's mean velocity, m/s, with Quaid's waveform; negative downwards.

    (a_s T/2) (1/(1 + a_s/a_max) − 1/(1 + a_s/a_k)), where a_k = µ_k F_n/m_P ± g slows the slipping
    part. ``a_stick``, m/s², is by default the limit of friction, and at most that.
    """
    pair = case.coefficients()
    limit = quaid_limit(case.mu_s, case.f_n, case.direction, case.gravity)
    stick = limit if a_stick is None else a_stick
    slowed = pair.kinetic * case.gravity
    share = case.a_max / (case.a_max + stick) - slowed / (slowed + stick)
    return 0.5 * stick * case.period * share * sign_of(case.direction)
