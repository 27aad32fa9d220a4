"""The paper's misprints, each with a proof that is computed when it is asked for.

The proofs use none of the closed forms: they follow a part on a vibrating surface exactly, by
rational numbers from event to event. In the paper's units: f = F_n/(m_P g), A = a_max/g, times in
periods, accelerations in g, velocities in g T; µ_s = 0.7 and µ_k = 0.6 as in its figures.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

MU_S, MU_K = Fraction(7, 10), Fraction(6, 10)
F, A = Fraction(5), Fraction(10)  # of the paper's figure 3

WIDTH = 92  # of the text, in characters

Phase = tuple[Fraction, Fraction]  # length, the surface's acceleration


@dataclass
class Contact:
    """Friction between part and surface: Coulomb's, with the weight; accelerations in g."""

    held_low: Fraction  # the part sticks if the surface's acceleration is in this range
    held_high: Fraction
    up: Fraction  # the slipping part's acceleration where the surface is faster
    down: Fraction  # and where it is slower

    @classmethod
    def coulomb(cls, mu_s: Fraction, mu_k: Fraction, f_n: Fraction) -> "Contact":
        """Of the coefficients, and of F_n/(m_P g)."""
        return cls(-mu_s * f_n - 1, mu_s * f_n - 1, mu_k * f_n - 1, -mu_k * f_n - 1)


class Period(NamedTuple):
    """What one period came to."""

    travelled: Fraction  # by the part
    stuck: Fraction  # time in which the part stuck
    surface_gain: Fraction  # of the surface's velocity


def simulate(phases: Sequence[Phase], contact: Contact, periods: int = 3) -> list[Period]:
    """Follow the part over ``periods`` repetitions of ``phases``.

    The surface starts with the velocity that brings it back after one period, the part sticking.
    """
    surface = start_velocity(phases)
    slip = Fraction(0)  # surface minus part
    found = []
    for _ in range(periods):
        travelled = stuck = Fraction(0)
        before = surface
        for length, acceleration in phases:
            left = length
            while left > 0:
                part = _part_acceleration(slip, acceleration, contact)
                rate = acceleration - part
                step = min(left, -slip / rate) if slip * rate < 0 else left
                travelled += step * (surface - slip + part * step / 2)
                stuck += step if slip == 0 and part == acceleration else 0
                slip += rate * step
                surface += acceleration * step
                left -= step
        found.append(Period(travelled, stuck, surface - before))
    return found


def start_velocity(phases: Sequence[Phase]) -> Fraction:
    """The surface's velocity at the period's start with which the period ends at its height."""
    velocity = travelled = total = Fraction(0)
    for length, acceleration in phases:
        travelled += length * (velocity + acceleration * length / 2)
        velocity += acceleration * length
        total += length
    return -travelled / total


def closed_cycle(
    first: Fraction, slowed: Fraction, fall: Fraction, rise: Fraction | None = None
) -> list[Phase]:
    """Three phases, at ``first``, −``fall`` and +``rise`` (= fall), that bring velocities back.

    What the part gains at ``first`` while it sticks it loses at ``slowed`` in the other phases.
    """
    rise = fall if rise is None else rise
    stick = slowed / (first + slowed)
    falling = (rise * (1 - stick) + first * stick) / (fall + rise)
    return [(stick, first), (falling, -fall), (1 - stick - falling, rise)]


def _part_acceleration(slip: Fraction, surface: Fraction, contact: Contact) -> Fraction:
    if slip == 0 and contact.held_low <= surface <= contact.held_high:
        return surface
    faster = slip > 0 or (slip == 0 and surface > contact.held_high)
    return contact.up if faster else contact.down


@dataclass(frozen=True)
class Erratum:
    """A misprint: what stands there, what should, and what a simulation says."""

    where: str
    printed: str
    right: str
    proof: str
    numbers: dict[str, float]  # those of the proof
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
    right = _optimal(F, A)
    printed: list[Phase] = [(right[0][0], MU_K * F - 1), *right[1:]]
    gain, closed = (float(simulate(x, _contact(F))[0].surface_gain) for x in (printed, right))
    moved = _moved(right, F)
    return Erratum(
        where="Acceleration of the optimal waveform's first phase, with T1 and T2 as printed",
        printed="(µ_k F_n/m_P − g) on [0, T1]",
        right="(µ_s F_n/m_P − g) on [0, T1]",
        proof=f"at f = 5, A = 10 the printed waveform does not close: the surface's velocity gains "
        f"{gain:.6f} g T a period; the right one gains {closed:.6f} g T, and the part moves at "
        f"{moved:.10f} g T",
        numbers={"printed_gain": gain, "right_gain": closed, "right_velocity": moved},
        confirmed=abs(gain) > 0.1 and closed == 0.0 and moved > 0.3,
    )


def _interval() -> Erratum:
    first, slowed = MU_S * F - 1, MU_K * F + 1
    best, less_down, less_up = (
        _moved(closed_cycle(first, slowed, *ends), F) for ends in ((A, A), (A / 2, A), (A, A / 2))
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
    below, at = (_moved(_optimal(f, A), f, _sliding(f)) for f in (cap - Fraction(1, 10), cap))
    down = float(-MU_K * cap - 1)
    return Erratum(
        where="The condition at f_n,max",
        printed="(its sign and interval are misprinted)",
        right="−µ_k F_n/m_P − g = −a_max, on [T1, T2]",
        proof=f"at A = 10 and f = {float(cap):g} a part that slides is slowed at {down:g} g, as "
        f"the surface on [T1, T2]: it moves at {at:.6f} g T on average; at f = "
        f"{float(cap) - 0.1:g}, at {below:.2e} g T",
        numbers={"f": float(cap), "slowed": down, "at": at, "below": below},
        confirmed=down == -10.0 and at == 0.0 and below > 0.0,
    )


def _sticking_limit() -> Erratum:
    cap, printed, small = (A - 1) / MU_S, (A - 1) / MU_K, Fraction(1, 1000)
    below, above = (_moved(_optimal(f, A), f) for f in (cap - small, cap + small))
    return Erratum(
        where="The largest normal force at which a part that sticks is transported",
        printed="f_n,max = (A − 1)/µ_k",
        right="(A − 1)/µ_s; (A − 1)/µ_k holds only for a part that slides already",
        proof=f"at A = 10 the part moves at {below:+.6f} g T at f = {float(cap - small):.3f}, but "
        f"at {above:+.6f} g T at f = {float(cap + small):.3f}, far below {float(printed):g}: "
        "there it sticks on [T1, T2] too, and slips when the surface rises at a_max",
        numbers={"f": float(cap), "below": below, "above": above, "printed_f": float(printed)},
        confirmed=below > 0.0 > above,
    )


def _force_guideline() -> Erratum:
    best = [_best_f(Fraction(peak)) for peak in (10, 50)]
    right = [float(MU_S) * f for f in best]
    printed = [f / float(MU_S) for f in best]
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
    limit, peak = 2 / (MU_S - MU_K), Fraction(50)
    forces = (limit - 5, limit + 5)
    below, above = (float(simulate(_optimal(f, peak), _contact(f))[-1].stuck) for f in forces)
    return Erratum(
        where="µ̃_s < µ̃_k in the mapping to horizontal transport",
        printed="without a condition on the normal force",
        right="only for f < 2/(µ_s − µ_k)",
        proof=f"the part sticks for the share µ̃_k/(µ̃_s + µ̃_k) of the time, more than half only if "
        f"µ̃_s < µ̃_k; simulated at A = 50: {below:.4f} at f = {float(limit) - 5:g}, {above:.4f} at "
        f"f = {float(limit) + 5:g}; the limit is {float(limit):g}",
        numbers={"limit": float(limit), "below": below, "above": above},
        confirmed=below > 0.5 > above,
    )


def _growth() -> Erratum:
    best = [_best_f(Fraction(peak)) for peak in (1000, 8000)]
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


def _contact(f: Fraction) -> Contact:
    return Contact.coulomb(MU_S, MU_K, f)


def _sliding(f: Fraction) -> Contact:
    """A part that, once it is not pushed up, offers no more than kinetic friction."""
    contact = _contact(f)
    return replace(contact, held_low=contact.down)


def _optimal(f: Fraction, peak: Fraction) -> list[Phase]:
    return closed_cycle(MU_S * f - 1, MU_K * f + 1, peak)


def _moved(phases: list[Phase], f: Fraction, contact: Contact | None = None) -> float:
    """The part's simulated mean velocity, g T, in the third period."""
    return float(simulate(phases, contact or _contact(f))[-1].travelled)


def _best_f(peak: Fraction) -> float:
    """The ratio at which the simulated transport is fastest."""
    from scipy.optimize import minimize_scalar

    def loss(f: float) -> float:
        exact = Fraction(f).limit_denominator(10**8)
        return -_moved(_optimal(exact, peak), exact)

    bounds = (float(1 / MU_S), float((peak - 1) / MU_S))
    found: Any = minimize_scalar(loss, bounds=bounds, options={"xatol": 1e-7})
    return float(found.x)
