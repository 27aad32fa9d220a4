"""A part on a vibrating surface by rational numbers, from event to event: nothing is rounded.

In units of the paper: times in periods, accelerations in g, velocities in g T.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

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


def _part_acceleration(slip: Fraction, surface: Fraction, contact: Contact) -> Fraction:
    if slip == 0 and contact.held_low <= surface <= contact.held_high:
        return surface
    faster = slip > 0 or (slip == 0 and surface > contact.held_high)
    return contact.up if faster else contact.down
