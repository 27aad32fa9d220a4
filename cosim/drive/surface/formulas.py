"""The closed forms of vertical vibratory transport, corrected where the paper is misprinted.

The paper is Yako, Nowak, Yuan, Salisbury, *Vertical Vibratory Transport of Grasped Parts Using
Impacts* (ICRA 2024, arXiv 2502.05693). A surface moves periodically along the vertical; a part of
mass m_P is pressed against it by the normal force F_n. Up is positive, units are SI. Numbers in
brackets, as in (3), are the paper's equations. :meth:`Transport.coefficients` checks a case; the
closed forms take the numbers of one that it has passed.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from cosim.errors import BadInput

GRAVITY = 9.81  # m/s²

LEAST, GREATEST = 1e-30, 1e30  # of any quantity: nothing computed here overflows

Direction = Literal["up", "down"]


class Friction(NamedTuple):
    """Coefficients of friction, without unit."""

    static: float
    kinetic: float


@dataclass(frozen=True)
class Transport:
    """One case of transport with the optimal waveform.

    The ``robust`` waveform has its first phase at (µ_k f_n − 1) g instead of (µ_s f_n − 1) g. It is
    slower, but loses nothing when part and surface meet a little too early.
    """

    mu_s: float
    mu_k: float
    a_max: float  # m/s², the surface's largest acceleration
    f_n: float  # F_n/(m_P g), without unit
    period: float  # T, s
    direction: Direction = "up"
    robust: bool = False
    gravity: float = GRAVITY

    def coefficients(self) -> Friction:
        """The pair of :func:`horizontal_equivalent`; BadInput where no transport is possible."""
        mu_s, mu_k, a_max, f_n = self.mu_s, self.mu_k, self.a_max, self.f_n
        positive(mu_s=mu_s, mu_k=mu_k)
        if mu_k > mu_s:
            raise BadInput(f"mu_k = {mu_k:g} must not exceed mu_s = {mu_s:g}.")
        positive(a_max=a_max, f_n=f_n, period=self.period, gravity=self.gravity)
        if f_n <= least_force_ratio(mu_s):
            raise BadInput(
                f"f_n = {f_n:g} is too small: a surface at rest holds the part only above "
                f"F_n/(m_P g) = 1/mu_s = {1.0 / mu_s:.6g}."
            )
        least = least_peak_acceleration(mu_s, f_n, self.gravity)
        if a_max <= least:
            raise BadInput(
                f"a_max = {a_max:g} m/s² is too small: at f_n = {f_n:g} only more than "
                f"mu_s F_n/m_P + g = {least:.6g} m/s² shakes the part loose."
            )
        pair = horizontal_equivalent(mu_s, mu_k, f_n, self.direction, self.robust)
        if min(pair) <= 0.0:
            what = "robust transport" if self.direction == "up" else "transport downwards"
            raise BadInput(
                f"f_n = {f_n:g} is too small for {what}: a slipping part is slowed only above "
                f"F_n/(m_P g) = 1/mu_k = {1.0 / mu_k:.6g}."
            )
        return pair


def average_velocity(case: Transport) -> float:
    """v_ave, the part's mean velocity, m/s, with the optimal waveform; negative downwards.

    Up: (µ_s f − 1)² (A² − (µ_k f + 1)²) g T/(4 A (µ_s + µ_k)² f²), f = F_n/(m_P g), A = a_max/g.
    """
    pair = case.coefficients()
    speed = horizontal_velocity(*pair, case.a_max, case.period, case.gravity)
    return sign_of(case.direction) * speed


# The conditions (1) to (5)


def sticking_range(mu_s: float, f_n: float, gravity: float = GRAVITY) -> tuple[float, float]:
    """(1) The surface's least and greatest acceleration with which a part at rest on it stays so.

    −µ_s F_n/m_P − g ≤ z̈_S ≤ µ_s F_n/m_P − g, in m/s².
    """
    return -(mu_s * f_n + 1.0) * gravity, (mu_s * f_n - 1.0) * gravity


def slipping_acceleration(
    mu_k: float, f_n: float, relative_velocity: float, gravity: float = GRAVITY
) -> float:
    """(2) The slipping part's acceleration (µ_k F_n/m_P) sgn(ż_S − ż_P) − g, in m/s².

    ``relative_velocity`` is ż_S − ż_P, of which only the sign counts.
    """
    return (math.copysign(mu_k * f_n, relative_velocity) - 1.0) * gravity


def least_force_ratio(mu_s: float) -> float:
    """(3) The ratio F_n/(m_P g) = 1/µ_s above which a resting surface holds the part."""
    return 1.0 / mu_s


def least_peak_acceleration(mu_s: float, f_n: float, gravity: float = GRAVITY) -> float:
    """(4) The acceleration µ_s F_n/m_P + g, in m/s², that a_max must exceed to shake it loose."""
    return -sticking_range(mu_s, f_n, gravity)[0]


def least_peak_acceleration_at_any_force(gravity: float = GRAVITY) -> float:
    """(5) The bound 2 g, in m/s², on a_max that (3) and (4) leave whatever friction and force."""
    return 2.0 * gravity


# The mapping to horizontal transport


def horizontal_equivalent(
    mu_s: float, mu_k: float, f_n: float, direction: Direction = "up", robust: bool = False
) -> Friction:
    """The coefficients µ̃_s, µ̃_k with which horizontal transport moves in the same way.

    Up: µ̃_s = µ_s F_n/(m_P g) − 1 and µ̃_k = µ_k F_n/(m_P g) + 1; down, + and − exchanged.
    Unlike true coefficients µ̃_s is below µ̃_k, for transport up, when
    F_n/(m_P g) < 2/(µ_s − µ_k). The ``robust`` variant has µ_k in µ̃_s too.
    """
    weight = sign_of(direction)
    return Friction((mu_k if robust else mu_s) * f_n - weight, mu_k * f_n + weight)


def horizontal_velocity(
    mu_s: float, mu_k: float, a_max: float, period: float, gravity: float = GRAVITY
) -> float:
    """Mean velocity, m/s, in optimal horizontal transport with the coefficients given.

    v = µ_s² (A² − µ_k²) g T/(4 A (µ_s + µ_k)²); 0 where a_max = µ_k g. The first phase is at
    µ_s g; where a_max is less it is at a_max, so that A stands for µ_s.
    """
    peak = a_max / gravity
    share = min(mu_s, peak) / (min(mu_s, peak) + mu_k)
    return share * share * (1.0 - mu_k / peak) * (1.0 + mu_k / peak) * a_max * period / 4.0


# The limits and the optimum of the normal force


def largest_force_ratio(mu: float, a_max: float, gravity: float = GRAVITY) -> float:
    """The ratio F_n/(m_P g) = (A − 1)/µ from which a part cannot be shaken loose.

    With µ_s it holds for a part that sticks. With µ_k it holds for a part that slides already: then
    −µ_k F_n/m_P − g = −a_max on [T1, T2] and v_ave is 0, which it is not yet at the former ratio.
    """
    return (a_max / gravity - 1.0) / mu


def cubic_force_ratio(mu_s: float, mu_k: float, a_max: float, gravity: float = GRAVITY) -> float:
    """The ratio f = F_n/(m_P g) where the formula of v_ave has its maximum.

    It solves µ_s µ_k² f³ + µ_s µ_k f² + µ_k f + 1 = A², and grows as A^(2/3).
    """
    peak = largest_force_ratio(1.0, a_max, gravity) + 1.0
    ratio, low, high = mu_s / mu_k, 0.0, peak - 1.0
    # In x = µ_k f: (x + 1)(x² µ_s/µ_k + 1) = A² has one positive root, below A − 1 as µ_s ≥ µ_k.
    while (middle := 0.5 * (low + high)) not in (low, high):
        below = (middle + 1.0) / peak * ((ratio * middle * middle + 1.0) / peak) < 1.0
        low, high = (middle, high) if below else (low, middle)
    return middle / mu_k


def optimal_force_ratio(mu_s: float, mu_k: float, a_max: float, gravity: float = GRAVITY) -> float:
    """The ratio F_n/(m_P g) at which the part is transported upwards fastest.

    The root of :func:`cubic_force_ratio`. Where µ_k is far below µ_s that root exceeds what a
    sticking part allows; then the optimum is the least upper bound of the ratios allowed.
    """
    cubic = cubic_force_ratio(mu_s, mu_k, a_max, gravity)
    return min(cubic, largest_force_ratio(mu_s, a_max, gravity))


def force_limits(case: Transport, a_max: float) -> dict[str, float]:
    """The limits of F_n/(m_P g) and its optimum, and v_ave there in m/s and over g T, with
    ``a_max``, m/s², in place of the case's."""
    mu_s, mu_k, gravity = case.mu_s, case.mu_k, case.gravity
    best = optimal_force_ratio(mu_s, mu_k, a_max, gravity)
    pair = horizontal_equivalent(mu_s, mu_k, best)
    velocity = horizontal_velocity(*pair, a_max, case.period, gravity)
    return {
        "a_max": a_max,
        "f_min": least_force_ratio(mu_s),
        "f_optimal": best,
        "f_cubic": cubic_force_ratio(mu_s, mu_k, a_max, gravity),
        "f_max_sticking": largest_force_ratio(mu_s, a_max, gravity),
        "f_max_sliding": largest_force_ratio(mu_k, a_max, gravity),
        "v_at_optimal": velocity,
        "v_at_optimal_over_gT": velocity / (gravity * case.period),
    }


def positive(**values: float) -> None:
    """Raise BadInput unless all values are positive, and from LEAST to GREATEST."""
    for name, value in values.items():
        if not LEAST <= value <= GREATEST:
            raise BadInput(f"{name} = {value:g} must be above 0, from {LEAST:g} to {GREATEST:g}.")


def sign_of(direction: Direction) -> float:
    """1 for up, −1 for down."""
    if direction not in ("up", "down"):
        raise BadInput(f'direction = "{direction}" must be "up" or "down".')
    return 1.0 if direction == "up" else -1.0
