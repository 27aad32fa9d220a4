"""The paper's misprints, each with a proof that is computed at each call.

    python -m benchmarks.errata

prints them, in about a second.

The proofs use none of the closed forms: they simulate a part on a vibrating surface from event to
event. In the paper's units: f = F_n/(m_P g), A = a_max/g, times in periods, accelerations in g,
velocities in g T; µ_s = 0.7 and µ_k = 0.6 as in the paper's figures.
"""

import math
import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from cosim.arrays import Array
from cosim.drive.surface.waveforms import ROUNDING_MARGIN
from cosim.mechanics.part import PartMotion, exact

MU_S, MU_K = 0.7, 0.6
F, A = 5.0, 10.0  # of the paper's figure 3

WIDTH = 92  # of the text, in characters

Surface = tuple[Array, Array]  # times, and velocities that are linear between them


@dataclass(frozen=True)
class Erratum:
    """A misprint: the printed text, the right one, and the result of a simulation."""

    where: str
    printed: str
    right: str
    proof: str
    numbers: dict[str, float]  # of the proof
    confirmed: bool  # the simulation agrees with ``right`` and not with ``printed``


def errata() -> list[Erratum]:
    """The misprints; computing the proofs takes about a second."""
    first = _first_phase(), _interval(), _force_limit(), _sticking_limit()
    return [*first, _force_guideline(), _order_of_coefficients(), _growth()]


def errata_text() -> str:
    """The misprints as text to print."""
    head = (
        "Misprints in Yako, Nowak, Yuan, Salisbury, “Vertical Vibratory Transport of Grasped Parts "
        "Using Impacts”, with proofs computed now, by exact event-driven simulation. "
        "f = F_n/(m_P g), A = a_max/g; mu_s = 0.7, mu_k = 0.6."
    )
    blocks = [textwrap.fill(head, WIDTH)]
    for number, item in enumerate(errata(), start=1):
        verdict = "confirmed" if item.confirmed else "NOT CONFIRMED"
        rows = (
            f"{number}. {item.where}",
            f"   printed: {item.printed}",
            f"   right:   {item.right}",
            f"   proof:   {item.proof} — {verdict}.",
        )
        filled = (textwrap.fill(row, WIDTH, subsequent_indent=" " * 12) for row in rows)
        blocks.append("\n".join(filled))
    return "\n\n".join(blocks) + "\n"


def _first_phase() -> Erratum:
    # Durations of the three phases, times their accelerations: velocity that a period gains.
    lengths = np.diff(_cycle(F, A, A, margin=0.0)[0])
    gain, closed = (float(lengths @ (mu * F - 1, -A, A)) for mu in (MU_K, MU_S))
    moved = _moved(_cycle(F, A, A), F)
    return Erratum(
        where="Acceleration of the optimal waveform's first phase, with T1 and T2 as printed",
        printed="(µ_k F_n/m_P − g) on [0, T1]",
        right="(µ_s F_n/m_P − g) on [0, T1]",
        proof=f"at f = 5, A = 10 the printed waveform does not close: the surface's velocity gains "
        f"{gain:.6f} g T a period; the right one gains {abs(closed):.6f} g T, and the part moves "
        f"at {moved:.6f} g T",
        numbers={"printed_gain": gain, "right_gain": closed, "right_velocity": moved},
        confirmed=abs(gain) > 0.1 and abs(closed) < 1e-12 and moved > 0.3,
    )


def _interval() -> Erratum:
    best, less_down, less_up = (
        _moved(_cycle(F, *ends), F) for ends in ((A, A), (A / 2, A), (A, A / 2))
    )
    return Erratum(
        where="The interval that the surface's acceleration is taken from",
        printed="(its ends are misprinted)",
        right="[−a_max, a_max]",
        proof=f"at f = 5 the part moves at {best:.6f} g T with the cycle that reaches both ends "
        f"of [−10 g, 10 g], at {less_down:.6f} g T within [−5 g, 10 g] and at {less_up:.6f} g T "
        "within [−10 g, 5 g]: both ends are used",
        numbers={"both": best, "less_down": less_down, "less_up": less_up},
        confirmed=best > max(less_down, less_up) and min(less_down, less_up) > 0.0,
    )


def _force_limit() -> Erratum:
    cap = (A - 1) / MU_K
    below, at = (_moved_sliding(f) for f in (cap - 0.1, cap))
    down = -MU_K * cap - 1
    return Erratum(
        where="The condition at f_n,max",
        printed="(its sign and interval are misprinted)",
        right="−µ_k F_n/m_P − g = −a_max, on [T1, T2]",
        proof=f"at A = 10 and f = {cap:g} a part that slides is slowed at {down:g} g, as "
        f"the surface on [T1, T2]: it moves at {at:.6f} g T on average; at f = "
        f"{cap - 0.1:g}, at {below:.2e} g T",
        numbers={"f": cap, "slowed": down, "at": at, "below": below},
        confirmed=math.isclose(down, -A) and abs(at) < 1e-6 < below,
    )


def _sticking_limit() -> Erratum:
    cap, printed, small = (A - 1) / MU_S, (A - 1) / MU_K, 1e-3
    below, above = (_moved(_cycle(f, A, A), f) for f in (cap - small, cap + small))
    return Erratum(
        where="The largest normal force at which a part that sticks is transported",
        printed="f_n,max = (A − 1)/µ_k",
        right="(A − 1)/µ_s; (A − 1)/µ_k holds only for a part that slides already",
        proof=f"at A = 10 the part moves at {below:+.6f} g T at f = {cap - small:.3f}, but "
        f"at {above:+.6f} g T at f = {cap + small:.3f}, far below {printed:g}: "
        "there it sticks on [T1, T2] too, and slips when the surface rises at a_max",
        numbers={"f": cap, "below": below, "above": above, "printed_f": printed},
        confirmed=below > 0.0 > above,
    )


def _force_guideline() -> Erratum:
    best = [_best_f(peak) for peak in (10.0, 50.0)]
    right = [MU_S * f for f in best]
    printed = [f / MU_S for f in best]
    return Erratum(
        where="The guideline for the normal force",
        printed="4–16 times µ_s m_P g",
        right="µ_s F_n = 4–16 times m_P g",
        proof=f"the simulated transport is fastest at f = {best[0]:.4f} (A = 10) and {best[1]:.4f} "
        f"(A = 50): µ_s F_n/(m_P g) = {right[0]:.2f} and {right[1]:.2f}, within 4…16, but "
        f"F_n/(µ_s m_P g) = {printed[0]:.2f} and {printed[1]:.2f}, not",
        numbers={"f_10": best[0], "f_50": best[1], "right_10": right[0], "right_50": right[1]},
        confirmed=4 <= min(right) <= max(right) <= 16 < max(printed),
    )


def _order_of_coefficients() -> Erratum:
    limit, peak = 2 / (MU_S - MU_K), 50.0
    forces = (limit - 5, limit + 5)
    below, above = (_stuck(_cycle(f, peak, peak), f) for f in forces)
    return Erratum(
        where="µ̃_s < µ̃_k in the mapping to horizontal transport",
        printed="without a condition on the normal force",
        right="only for f < 2/(µ_s − µ_k)",
        proof=f"the part sticks for the share µ̃_k/(µ̃_s + µ̃_k) of the time, more than half only if "
        f"µ̃_s < µ̃_k; simulated at A = 50: {below:.4f} at f = {limit - 5:g}, {above:.4f} at "
        f"f = {limit + 5:g}; the limit is {limit:g}",
        numbers={"limit": limit, "below": below, "above": above},
        confirmed=below > 0.5 > above,
    )


def _growth() -> Erratum:
    best = [_best_f(peak) for peak in (1000.0, 8000.0)]
    exponent = math.log(best[1] / best[0]) / math.log(8.0)
    return Erratum(
        where="How the optimal normal force grows with a_max",
        printed="quadratically",
        right="as a_max^(2/3): µ_s µ_k² f³ + µ_s µ_k f² + µ_k f + 1 = A²",
        proof=f"the simulated transport is fastest at f = {best[0]:.3f} (A = 1000) and "
        f"{best[1]:.3f} (A = 8000): an exponent of {exponent:.4f}",
        numbers={"f_1000": best[0], "f_8000": best[1], "exponent": exponent},
        confirmed=abs(exponent - 2 / 3) < 0.01,
    )


def _cycle(f: float, fall: float, rise: float, margin: float = ROUNDING_MARGIN) -> Surface:
    """A surface with three phases, at µ_s f − 1, −``fall`` and +``rise``, that ends at the velocity
    and height at which it begins.

    The velocity that the part gains in the first phase, while it sticks, it loses in the others by
    sliding at −(µ_k f + 1). A ``margin`` makes up for rounding: the first acceleration stays below
    the limit of sticking, and the part reaches the surface's velocity only after the period.
    """
    first, slowed = (MU_S - margin * MU_S) * f - 1, MU_K * f + 1
    stick = slowed / (first + slowed) + margin  # duration of the first phase
    falling = (rise * (1 - stick) + first * stick) / (fall + rise)
    times = np.array([0.0, stick, stick + falling, 1.0])
    velocities = np.array([0.0, first * stick, first * stick - fall * falling, 0.0])
    return times, velocities - np.trapezoid(velocities, times)  # so that the mean velocity is 0


def _third_period(surface: Surface, f: float) -> PartMotion:
    """The part's motion in three periods, starting with the surface's velocity. The surface has
    three phases, so rows −4 to −1 are the knots of the last period."""
    return exact(*surface, mu_s=MU_S, mu_k=MU_K, force_per_mass=f, gravity=1.0, periods=3)


def _moved(surface: Surface, f: float) -> float:
    """The part's simulated mean velocity, g T, in the third period."""
    height = _third_period(surface, f).z
    return float(height[-1] - height[-4])


def _stuck(surface: Surface, f: float) -> float:
    """The share of the third period in which the part sticks."""
    motion = _third_period(surface, f)
    return float(motion.sticking[-3:] @ np.diff(motion.time[-4:]))


def _moved_sliding(f: float) -> float:
    """The mean velocity, g T, of a part that is carried up in the first phase, and has no more than
    kinetic friction afterwards (µ_s = µ_k), so that it slides."""
    times, velocities = _cycle(f, A, A, margin=0.0)
    pushed = times[1] * (velocities[0] + velocities[1]) / 2  # height gained in the first phase
    later = exact(times[1:], velocities[1:], mu_s=MU_K, mu_k=MU_K, force_per_mass=f, gravity=1.0)
    return float(pushed + later.z[-1])


def _best_f(peak: float) -> float:
    """The ratio f = F_n/(m_P g) at which the simulated transport is fastest, A = ``peak``."""
    found: Any = minimize_scalar(
        lambda f: -_moved(_cycle(f, peak, peak), f),
        bounds=(1 / MU_S, (peak - 1) / MU_S),
        options={"xatol": 1e-7},
    )
    return float(found.x)


if __name__ == "__main__":
    print(errata_text())
