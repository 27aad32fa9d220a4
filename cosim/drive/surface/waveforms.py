"""The surface's motion: the optimal waveform, its variants, and Quaid's, as functions of time."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.drive.surface.formulas import (
    GRAVITY,
    Direction,
    admissible,
    positive,
    sign_of,
    sticking_range,
)
from cosim.errors import BadInput

Array = npt.NDArray[np.float64]

# What the simulation's waveform stays away from the knife edge, by default: see optimal_cycle.
MARGIN = 1e-9


@dataclass(frozen=True)
class Cycle:
    """A period of three phases of constant acceleration, repeated for ever; SI units.

    Velocity and position are the same at both ends; the position at t = 0 is 0.
    """

    times: tuple[float, float, float, float]  # s: 0, the ends of the phases, the period
    accelerations: tuple[float, float, float]  # m/s²
    start_velocity: float  # m/s

    def acceleration(self, time: npt.ArrayLike) -> Array:
        """The surface's acceleration, m/s², at times in s; at a jump the later one."""
        return np.asarray(self.accelerations)[self._phase(time)[0]]

    def velocity(self, time: npt.ArrayLike) -> Array:
        """The surface's velocity, m/s, at times in s."""
        phase, since = self._phase(time)
        return self.knots()[1][phase] + np.asarray(self.accelerations)[phase] * since

    def position(self, time: npt.ArrayLike) -> Array:
        """The surface's height, m, at times in s."""
        phase, since = self._phase(time)
        times, velocities = self.knots()
        travelled = 0.5 * (velocities[1:] + velocities[:-1]) * np.diff(times)
        start = np.concatenate([[0.0], np.cumsum(travelled)])[phase]
        mean = velocities[phase] + 0.5 * np.asarray(self.accelerations)[phase] * since
        return start + mean * since

    def stroke(self) -> float:
        """The height between the surface's lowest and highest point, m."""
        times, velocities = self.knots()
        turns = times[:-1] - velocities[:-1] / np.asarray(self.accelerations)
        inside = turns[(turns > times[:-1]) & (turns < times[1:])]
        return float(np.ptp(self.position(np.concatenate([times, inside]))))

    def knots(self) -> tuple[Array, Array]:
        """Times, s, and velocities, m/s, between which the velocity is linear; one period."""
        times = np.array(self.times)
        change = np.cumsum(np.asarray(self.accelerations) * np.diff(times))
        change[-1] = 0.0  # but for rounding it is that already
        return times, self.start_velocity + np.concatenate([[0.0], change])

    def _phase(self, time: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], Array]:
        """The phase in which each time falls, and the time since that phase began."""
        within = np.mod(np.asarray(time, dtype=float), self.times[3])
        phase = np.clip(np.searchsorted(self.times, within, side="right") - 1, 0, 2)
        return phase, within - np.asarray(self.times)[phase]


def optimal_cycle(
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    *,
    direction: Direction = "up",
    robust: bool = False,
    margin: float = 0.0,
    gravity: float = GRAVITY,
) -> Cycle:
    """The surface's motion, at most a_max, that transports the part fastest.

    Upwards: (µ_s F_n/m_P − g) on [0, T1], −a_max on [T1, T2], +a_max on [T2, T]; downwards
    −(µ_s F_n/m_P + g), +a_max, −a_max. Part and surface meet again just at T. That is a knife
    edge: if they meet a little before T, the surface, still at a_max, overtakes the part, which
    then slips for the whole next phase. ``margin``, a fraction, keeps away from it: T1 comes
    ``margin`` T later, so that they meet ``margin`` T after the period's end, and the first phase
    stays below the limit of friction as if µ_s were that much smaller.

    The ``robust`` variant has a first phase at (µ_k F_n/m_P − g), in which a part that still
    slips keeps up with the surface, so that meeting early costs nothing.
    """
    pair = admissible(mu_s, mu_k, a_max, f_n, period, direction, robust, gravity)
    if not 0.0 <= margin < 0.1:
        raise BadInput(f"margin = {margin:g} must be at least 0 and less than 0.1.")
    static = pair.static - margin * (mu_k if robust else mu_s) * f_n
    first = static * gravity
    end_first = period * (pair.kinetic / (static + pair.kinetic) + margin)
    end_second = 0.5 * (period + end_first * (1.0 + first / a_max))  # the velocity returns
    if first <= 0.0 or end_second >= period:
        raise BadInput(f"margin = {margin:g} leaves no transport with these numbers.")
    sign = sign_of(direction)
    return closing_cycle(
        (0.0, end_first, end_second, period), (sign * first, -sign * a_max, sign * a_max)
    )


def optimal_waveform(
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    *,
    direction: Direction = "up",
    robust: bool = False,
    margin: float = MARGIN,
    gravity: float = GRAVITY,
) -> tuple[Array, Array]:
    """:func:`optimal_cycle` for a simulation: knots (times, s; velocities, m/s) over one period.

    Between the knots the velocity is linear. The default margin is what rounding needs; solvers
    with coarser events need more.
    """
    return optimal_cycle(
        mu_s,
        mu_k,
        a_max,
        f_n,
        period,
        direction=direction,
        robust=robust,
        margin=margin,
        gravity=gravity,
    ).knots()


def quaid_cycle(a_stick: float, a_max: float, period: float, direction: Direction = "up") -> Cycle:
    """Quaid's waveform: ±a_stick, m/s², while the part is to stick, ∓a_max while it is to slip.

    The slipping phase is [T1, T − T1] with T1 = T a_max/(2 (a_stick + a_max)) (Quaid 1999).
    """
    positive(a_stick=a_stick, a_max=a_max, period=period)
    sign = sign_of(direction)
    end = 0.5 * period * a_max / (a_stick + a_max)
    slow, fast = sign * a_stick, -sign * a_max
    return Cycle((0.0, end, period - end, period), (slow, fast, slow), 0.0)


def quaid_waveform(
    a_stick: float, a_max: float, period: float, direction: Direction = "up"
) -> tuple[Array, Array]:
    """:func:`quaid_cycle` as knots (times, s; velocities, m/s) over one period."""
    return quaid_cycle(a_stick, a_max, period, direction).knots()


def quaid_velocity(
    mu_s: float,
    mu_k: float,
    a_max: float,
    f_n: float,
    period: float,
    *,
    a_stick: float | None = None,
    direction: Direction = "up",
    gravity: float = GRAVITY,
) -> float:
    """The part's mean velocity, m/s, with Quaid's waveform; negative downwards.

    (a_s T/2) (1/(1 + a_s/a_max) − 1/(1 + a_s/a_k)), where a_k = µ_k F_n/m_P ± g slows the slipping
    part. ``a_stick``, m/s², is by default the limit of friction, which it must not exceed.
    """
    pair = admissible(mu_s, mu_k, a_max, f_n, period, direction, False, gravity)
    low, high = sticking_range(mu_s, f_n, gravity)
    limit = high if direction == "up" else -low
    stick = limit if a_stick is None else a_stick
    if not 0.0 < stick <= limit:
        raise BadInput(
            f"a_stick = {stick:g} m/s² must be above 0 and at most {limit:.6g} m/s², "
            "with which the part still sticks."
        )
    slowed = pair.kinetic * gravity
    share = a_max / (a_max + stick) - slowed / (slowed + stick)
    return 0.5 * stick * period * share * sign_of(direction)


def closing_cycle(
    times: tuple[float, float, float, float], accelerations: tuple[float, float, float]
) -> Cycle:
    """The cycle whose start velocity brings the surface back to where it began."""
    lengths = np.diff(times)
    gained = np.asarray(accelerations) * lengths
    travelled = float(np.sum(gained * (times[3] - np.asarray(times[1:]) + 0.5 * lengths)))
    return Cycle(times, accelerations, -travelled / times[3])
