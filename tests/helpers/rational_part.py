"""The part on a prescribed surface, in rational numbers: no rounding, and nothing shared.

Between events all accelerations are constant, so that with rational data every event, velocity and
height is rational. A mode is found by trying all of them and keeping the one that contradicts
neither Coulomb's law nor itself.
"""

from fractions import Fraction
from itertools import pairwise, product

Q = Fraction


def sign(x: Fraction) -> int:
    return (x > 0) - (x < 0)


def acceleration(
    law: dict[str, Fraction], v: Fraction, speed: Fraction, slope: Fraction
) -> tuple[Fraction, bool]:
    """The part's acceleration and whether it sticks; law: static, kinetic, plate, g in m/s²."""
    g, plate = law["g"], law["plate"]
    if v == speed:
        way = sign(v) or sign(slope)
        # The plate's force is known where the part moves, any up to its limit where it rests.
        least, most = (-plate, plate) if way == 0 else (-way * plate, -way * plate)
        needed = [slope + g - most, slope + g - least]
        if needed[0] <= law["static"] and needed[1] >= -law["static"]:
            return slope, True
    found = set()
    for side, way in product((-1, 1), (-1, 0, 1)):
        pull = -side * law["kinetic"] - g
        if way == 0:
            if abs(pull) > plate:
                continue
            a = Q(0)
        else:
            a = pull - way * plate
        agrees_side = side == (sign(v - speed) or sign(a - slope))
        agrees_way = way == (sign(v) or sign(a))
        if agrees_side and agrees_way:
            found.add(a)
    assert len(found) == 1, f"{len(found)} modes at v = {v}, speed = {speed}, slope = {slope}"
    return found.pop(), False


def motion(
    knots: list[tuple[Fraction, Fraction]], law: dict[str, Fraction], v: Fraction
) -> tuple[list[Fraction], list[Fraction], list[Fraction]]:
    """Heights, velocities and the time spent sticking so far, at the knots."""
    z = stuck = Q(0)
    heights, velocities, times = [z], [v], [stuck]
    for (t0, begin), (t1, end) in pairwise(knots):
        t, slope = t0, (end - begin) / (t1 - t0) if t1 > t0 else Q(0)
        while t < t1:
            speed = begin + slope * (t - t0)
            a, sticks = acceleration(law, v, speed, slope)
            ends = [t1 - t]
            for value, rate in ((v - speed, a - slope), (v, a)):
                if value * rate < 0:
                    ends.append(-value / rate)
            tau = min(ends)
            z += v * tau + a * tau**2 / 2
            v += a * tau
            t += tau
            stuck += tau if sticks else 0
        heights.append(z)
        velocities.append(v)
        times.append(stuck)
    return heights, velocities, times
