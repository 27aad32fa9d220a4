"""The part on a prescribed surface against closed forms and a solution in rational numbers."""

import math
import subprocess
import sys
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cosim.errors import BadInput
from cosim.mechanics.part import exact, moreau, threshold
from tests.helpers import rational_part
from tests.helpers.examples import examples

pytestmark = pytest.mark.physics

G = 9.81
FRICTION: dict[str, Any] = {"mu_s": 0.72, "mu_k": 0.59, "force_per_mass": 50.0}
STATIC, KINETIC = 36.0, 29.5  # m/s², of these


# Closed forms


def test_without_normal_force_the_part_falls_freely():
    time = np.linspace(0, 0.3, 7)
    motion = exact(time, np.sin(40 * time), mu_s=0.7, mu_k=0.6, force_per_mass=0.0, z0=0.1, v0=0.5)
    np.testing.assert_allclose(motion.v, 0.5 - G * time, rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.z, 0.1 + 0.5 * time - G * time**2 / 2, rtol=0, atol=1e-14)
    assert motion.stick_fraction == 0.0


def test_a_sticking_part_moves_as_the_surface_to_the_last_bit():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(1e-3, 2e-3, 500))
    slopes = rng.uniform(-STATIC - G, STATIC - G, 499) * (1 - 1e-9)
    speed = np.concatenate([[0.0], np.cumsum(slopes * np.diff(time))])
    motion = exact(time, speed, **FRICTION)
    assert (motion.v == speed).all()
    assert motion.stick_fraction == pytest.approx(1.0, abs=1e-12)
    assert motion.stick_slip_events == 0
    area = np.concatenate([[0.0], np.cumsum(np.diff(time) * (speed[1:] + speed[:-1]) / 2)])
    np.testing.assert_allclose(motion.z, area, rtol=0, atol=1e-14)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("excess", "sticks"), [(0.0, True), (1e-9, False), (-1e-9, True)])
def test_the_limit_of_friction_belongs_to_sticking(way: int, excess: float, sticks: bool):
    slope = way * STATIC * (1 + excess) - G
    motion = exact([0.1, 0.4], [0.2, 0.2 + 0.3 * slope], **FRICTION)
    assert motion.sticking.tolist() == [1.0 if sticks else 0.0]
    gained = slope if sticks else way * KINETIC - G
    assert motion.v[-1] - 0.2 == pytest.approx(0.3 * gained, rel=1e-14)


def test_a_jump_of_the_surface_leaves_the_part_behind_until_it_catches_up():
    # The surface jumps from 0 to v: the part gains (mu_k F/m − g) t, and sticks from then on.
    jump, gain = 0.4, KINETIC - G
    caught = jump / gain
    motion = exact([0.0, 0.1, 0.1, 0.2], [0.0, 0.0, jump, jump], **FRICTION)
    assert motion.v.tolist() == [0.0, 0.0, 0.0, jump]
    assert motion.z[-1] == pytest.approx(jump * 0.1 - jump**2 / gain / 2, rel=1e-13)
    assert motion.sticking == pytest.approx([1.0, 0.0, 1 - caught / 0.1], rel=1e-13)
    assert motion.stick_slip_events == 2


def test_slip_is_reversed_without_sticking():
    # The surface falls faster than friction can follow: slip, first up then down, is one crossing.
    slope = -3 * STATIC
    up, down = KINETIC - G, -KINETIC - G
    motion = exact([0.0, 0.2], [1.0, 1.0 + 0.2 * slope], v0=0.0, **FRICTION)
    meet = 1.0 / (up - slope)
    speed = up * meet
    rest = 0.2 - meet
    assert motion.v[-1] == pytest.approx(speed + down * rest, rel=1e-14)
    expected = up * meet**2 / 2 + speed * rest + down * rest**2 / 2
    assert motion.z[-1] == pytest.approx(expected, rel=1e-14)
    assert motion.stick_fraction == 0.0


def test_the_spring_loaded_plate_holds_a_part_that_the_surface_cannot_lift():
    # mu_p F/m > mu_k F/m + g: at rest behind a surface that slides either way
    time, speed = [0.0, 0.1, 0.2, 0.2, 0.3], [0.0, 9.0, -9.0, 5.0, 5.0]
    motion = exact(time, speed, mu_plate=0.79, v0=0.0, **FRICTION)
    assert not motion.v.any()
    assert not motion.z.any()


def test_the_spring_loaded_plate_brakes_to_rest_and_no_further():
    # thrown upwards with no grip on the surface: brakes with g + mu_p F/m, then stays
    friction: dict[str, Any] = {"mu_s": 0.0, "mu_k": 0.0, "force_per_mass": 50.0, "mu_plate": 0.2}
    motion = exact([0.0, 1.0], [7.0, 7.0], v0=3.0, **friction)
    assert motion.v[-1] == 0.0
    assert motion.z[-1] == pytest.approx(3.0**2 / 2 / (G + 10.0), rel=1e-14)
    friction["mu_plate"] = 0.1
    sliding = exact([0.0, 1.0], [7.0, 7.0], v0=3.0, **friction)
    assert sliding.v[-1] == pytest.approx(-(G - 5.0) * (1 - 3.0 / (G + 5.0)), rel=1e-14)


def test_the_spring_loaded_plate_and_the_surface_share_the_weight():
    # Neither holds m g alone; together they do, and a little less of either lets go.
    both: dict[str, Any] = {"mu_s": 0.5, "mu_k": 0.5, "gravity": 10.0}
    held = exact([0.0, 1.0], [0.0, 0.0], force_per_mass=12.5, mu_plate=0.3, **both)
    assert held.v[-1] == 0.0
    falls = exact([0.0, 1.0], [0.0, 0.0], force_per_mass=12.5, mu_plate=0.299, **both)
    assert falls.v[-1] == pytest.approx(-0.0125, rel=1e-12)


# The optimal waveform: a knife edge, at which part and surface meet where the period ends


def optimal(f: float, a: float, period: float, mu_s: float = 0.7, mu_k: float = 0.6, down: int = 1):
    """Knots of the surface that moves a part with F_n = f m g best; a the largest |a|/g.

    Up to T1 as fast as the part sticks, then down, then up, at the largest acceleration. With
    `down` = −1 gravity helps, which is the downward optimum upside down.
    """
    kinetic, first = mu_k * f + down, (mu_s * f - down) * G
    t1 = period * kinetic / ((mu_s + mu_k) * f)
    t2 = t1 + (a + kinetic) * (mu_s * f - down) * period / (2 * a * (mu_s + mu_k) * f)
    time = np.array([0.0, t1, t2, period])
    v = np.cumsum(np.diff(time, prepend=0.0) * np.array([0.0, first, -a * G, a * G]))
    return time, v - np.sum(np.diff(time) * (v[1:] + v[:-1]) / 2) / period


def transport(motion: Any, period: float) -> float:
    """Mean velocity over g T, from all periods but the first half."""
    half = len(motion.z) // 2
    return (motion.z[-1] - motion.z[half]) / (len(motion.z) - 1 - half) / (G * period**2)


# v_ave/(gT) at µ_s 0.7, µ_k 0.6 from the paper's closed form.
TABLE = [
    (2, 10, 0.0563076923),
    (3, 10, 0.1832899408),
    (5, 10, 0.3106508876),
    (8, 10, 0.3245602811),
    (3.9209390477, 5, 0.0806031256),
    (6.7083044169, 10, 0.3356265876),
    (11.0605620285, 20, 0.9391278759),
    (20.9069122418, 50, 2.9150521251),
]


@pytest.mark.parametrize(("f", "a", "expected"), TABLE)
@pytest.mark.parametrize("period", [0.05, 0.026, 1 / 30])
def test_the_optimal_waveform_transports_as_the_closed_form_says(
    f: float, a: float, expected: float, period: float
):
    time, v = optimal(f, a, period)
    case: dict[str, Any] = {"mu_s": 0.7, "mu_k": 0.6, "force_per_mass": f * G, "periods": 200}
    motion = exact(time, v, output=period * np.arange(201), **case)
    assert transport(motion, period) == pytest.approx(expected, abs=2e-10)
    assert motion.stick_fraction == pytest.approx(time[1] / period, rel=1e-9)
    assert motion.stick_slip_events == 2 * 200 - 1


def test_the_downward_optimum():
    time, v = optimal(5.0, 10.0, 0.05, down=-1)
    case: dict[str, Any] = {
        "mu_s": 0.7,
        "mu_k": 0.6,
        "force_per_mass": 5 * G,
        "gravity": -G,
        "periods": 20,
    }
    motion = exact(time, v, output=0.05 * np.arange(21), **case)
    assert transport(motion, 0.05) == pytest.approx(1.1502958580, abs=1e-9)


def test_the_optimum_is_a_knife_edge():
    # A little more kinetic friction: they meet before the period ends, and then all is slip.
    time, v = optimal(5.0, 10.0, 0.05)
    case: dict[str, Any] = {
        "mu_s": 0.7,
        "mu_k": 0.6 * (1 + 1e-8),
        "force_per_mass": 5 * G,
        "periods": 20,
    }
    motion = exact(time, v, output=0.05 * np.arange(21), **case)
    assert transport(motion, 0.05) == pytest.approx(0.0543, abs=2e-3)


def test_threshold_schemes_fall_off_the_knife_edge_and_moreau_does_not():
    time, v = optimal(5.0, 10.0, 0.026)  # its knots are multiples of 1 ms
    case: dict[str, Any] = {"mu_s": 0.7, "mu_k": 0.6, "force_per_mass": 5 * G, "periods": 40}
    case["output"] = 0.026 * np.arange(41)
    for step in (1e-3, 1e-4, 1e-5):
        assert transport(threshold(time, v, step=step, v_min=1e-5, **case), 0.026) < 0.5 * 0.3106
        implicit = transport(moreau(time, v, step=step, **case), 0.026)
        assert implicit == pytest.approx(0.3106508876, rel=1e-8)


# Against rational numbers

FEW = st.integers(-24, 24).map(lambda n: Fraction(n, 8))
NOT_NEGATIVE = st.integers(0, 16).map(lambda n: Fraction(n, 4))


@st.composite
def cases(draw: st.DrawFn) -> tuple[Any, ...]:
    lengths = draw(st.lists(st.integers(0, 4), min_size=1, max_size=12).filter(any))
    times = [Fraction(0)]
    for length in lengths:
        times.append(times[-1] + Fraction(length, 4))
    knots = [(time, draw(FEW)) for time in times]
    kinetic, more = draw(NOT_NEGATIVE), draw(st.sampled_from([Fraction(0), Fraction(1, 4)]))
    law = {
        "static": kinetic + more * kinetic,
        "kinetic": kinetic,
        "plate": draw(st.one_of(st.just(Fraction(0)), NOT_NEGATIVE)),
        "g": draw(st.sampled_from([Fraction(0), Fraction(1), Fraction(5, 2)])),
    }
    return knots, law, draw(FEW)


def floats(law: dict[str, Fraction]) -> dict[str, Any]:
    """The arguments of `exact` for a law of `rational_part`."""
    force = max(law["static"], law["plate"], Fraction(1))
    return {
        "mu_s": float(law["static"] / force),
        "mu_k": float(law["kinetic"] / force),
        "mu_plate": float(law["plate"] / force),
        "force_per_mass": float(force),
        "gravity": float(law["g"]),
    }


@examples(700)
@given(cases())
@example(
    (  # all at rest, friction at its limit, and a surface that turns back on a knot
        [(Fraction(0), Fraction(0)), (Fraction(1), Fraction(0)), (Fraction(2), Fraction(-1))],
        {"static": Fraction(1), "kinetic": Fraction(1), "plate": Fraction(0), "g": Fraction(1)},
        Fraction(0),
    )
)
def test_exact_agrees_with_rational_numbers(case: tuple[Any, ...]):
    knots, law, v0 = case
    z, v, stuck = rational_part.motion(knots, law, v0)
    motion = exact(
        [float(time) for time, _ in knots],
        [float(speed) for _, speed in knots],
        **floats(law),
        v0=float(v0),
    )
    np.testing.assert_allclose(motion.v, [float(x) for x in v], rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.z, [float(x) for x in z], rtol=0, atol=1e-11)
    spent = np.concatenate([[0.0], np.cumsum(motion.sticking * np.diff(motion.time))])
    np.testing.assert_allclose(spent, [float(x) for x in stuck], rtol=0, atol=1e-11)


TINY = st.floats(0.0, 1e-14)
"""Seconds, down to those that are no normal number; just above and below what time resolves."""


@examples(500)
@given(cases(), st.integers(0, 12), st.lists(TINY, max_size=6), TINY)
def test_knots_that_almost_coincide_change_nothing(
    case: tuple[Any, ...], place: int, splits: list[float], rise: float
):
    """The knots at one time, set to 0 where the smallest distances can be told, are spread out."""
    knots, law, v0 = case
    z, v, _ = rational_part.motion(knots, law, v0)
    origin = knots[place % len(knots)][0]
    knots = [(time - origin, speed) for time, speed in knots]
    before = [knot for knot in knots if knot[0] < 0]
    jump = [speed for time, speed in knots if time == 0]
    after = [knot for knot in knots if knot[0] > 0]
    risen = [(Fraction(rise) * i / len(jump), speed) for i, speed in enumerate(jump)]
    distances = [Fraction(t) for t in sorted(splits)]
    if before:
        slope = (jump[0] - before[-1][1]) / -before[-1][0]
        before += [(-t, jump[0] - slope * t) for t in reversed(distances)]
    if after:
        slope = (after[0][1] - jump[-1]) / after[0][0]
        after[:0] = [(risen[-1][0] + t, jump[-1] + slope * t) for t in distances]
    spread = [*before, *risen, *after]
    motion = exact(
        [float(time) for time, _ in spread],
        [float(speed) for _, speed in spread],
        output=[float(time) for time, _ in knots],
        **floats(law),
        v0=float(v0),
    )
    np.testing.assert_allclose(motion.v, [float(x) for x in v], rtol=0, atol=1e-11)
    np.testing.assert_allclose(motion.z, [float(x) for x in z], rtol=0, atol=1e-11)


@examples(300)
@given(
    st.lists(st.floats(-2, 2), min_size=3, max_size=30),
    st.floats(0, 60),
    st.floats(0, 0.3),
    st.lists(st.floats(0, 1) | st.floats(0, 1e-300), min_size=1, max_size=20),
)
@example([2.683346770898818e-308, -0.4375, 0.0, 0.0], 51.0, 0.03125, [1.0, 2.683346770898818e-308])
def test_more_knots_mirrors_and_outputs_change_nothing(
    speeds: list[float], force: float, mu_plate: float, places: list[float]
):
    time = np.arange(len(speeds)) * 0.01
    case: dict[str, Any] = {"mu_s": 0.7, "mu_k": 0.6, "force_per_mass": force, "mu_plate": mu_plate}
    at = np.sort(places) * time[-1]
    plain = exact(time, speeds, output=at, **case)
    mirrored = exact(time, np.negative(speeds), output=at, gravity=-G, **case)
    np.testing.assert_allclose(mirrored.z, -plain.z, rtol=0, atol=1e-13)
    knots = np.sort(np.concatenate([time, at]))
    finer = exact(knots, np.interp(knots, time, speeds), output=at, **case)
    np.testing.assert_allclose(finer.z, plain.z, rtol=0, atol=1e-9)


def test_periods_follow_on_each_other():
    rng = np.random.default_rng(3)
    time, v = np.arange(9) / 64, rng.normal(0, 0.5, 9)
    repeated = exact(time, v, mu_plate=0.05, periods=50, **FRICTION)
    shifts = np.arange(50)[:, None] * time[-1]
    written_out = exact((shifts + time).ravel(), np.tile(v, 50), mu_plate=0.05, **FRICTION)
    np.testing.assert_allclose(repeated.time, written_out.time, rtol=0, atol=1e-14)
    np.testing.assert_allclose(repeated.z, written_out.z, rtol=0, atol=1e-12)
    assert repeated.stick_slip_events == written_out.stick_slip_events


# The schemes that step


def sine(step: float, scheme: Any, **more: float) -> float:
    """Largest difference in height from the exact motion over a sine with stick and slip."""
    time = np.linspace(0, 0.2, 401)
    v = 0.35 * np.sin(2 * math.pi * 20 * time)
    at = np.linspace(0, 0.2, 101)
    truth = exact(time, v, output=at, **FRICTION)
    assert 0.2 < truth.stick_fraction < 0.8
    return float(
        np.abs(scheme(time, v, step=step, output=at, **more, **FRICTION).z - truth.z).max()
    )


def test_moreau_is_of_first_order():
    errors = [sine(step, moreau) for step in (1e-4, 1e-5, 1e-6)]
    assert errors[1] < errors[0] / 5
    assert errors[2] < errors[1] / 5
    assert errors[2] < 1e-6


def test_a_threshold_sticks_only_if_a_step_changes_less_than_it():
    # Here a step of 1 µs changes the relative velocity by up to 70 µm/s.
    assert sine(1e-6, threshold, v_min=1e-4) < 3e-5
    assert sine(1e-6, threshold, v_min=1e-5) > 5e-5
    assert sine(1e-4, threshold, v_min=1e-5) > 1e-4


def test_the_threshold_scheme_is_by_default_that_of_the_authors():
    time = np.linspace(0, 0.1, 31)
    v = 0.3 * np.sin(130 * time)
    one = threshold(time, v, **FRICTION)
    other = threshold(time, v, step=1e-4, v_min=1e-5, **FRICTION)
    assert (one.z == other.z).all()
    assert len(one.time) == 1001


# Arguments


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time": [0.0]}, "two knots"),
        ({"time": [0.0, 2.0, 1.0]}, "must not decrease"),
        ({"time": [1.0, 1.0, 1.0]}, "must not decrease"),
        ({"v_surface": [0.0, math.nan, 1.0]}, "finite"),
        ({"time": [0.0, 1e-320, 1e-300]}, "accelerations must be finite"),
        ({"v_surface": [-1e308, 1e308, 0.0]}, "accelerations must be finite"),
        ({"mu_k": 0.8}, "µ_k"),
        ({"mu_k": -0.1}, "µ_k"),
        ({"force_per_mass": -1.0}, "negative"),
        ({"force_per_mass": math.inf}, "finite"),
        ({"mu_plate": -0.1}, "negative"),
        ({"v0": math.inf}, "finite"),
        ({"periods": 0}, "0 times"),
        ({"output": [0.0, 3.0]}, "between 0 and 2 s"),
        ({"output": [1.0, 0.0]}, "not decrease"),
        ({"output": []}, "list"),
    ],
)
def test_senseless_arguments_are_refused(change: dict[str, Any], words: str):
    arguments: dict[str, Any] = {"time": [0.0, 1.0, 2.0], "v_surface": [0.0, 1.0, 0.0], **FRICTION}
    arguments |= change
    with pytest.raises(BadInput, match=words):
        exact(arguments.pop("time"), arguments.pop("v_surface"), **arguments)


def test_senseless_steps_are_refused():
    for step in (0.0, -1.0, math.nan, 1e-12):
        with pytest.raises(BadInput, match="step"):
            moreau([0.0, 1.0], [0.0, 0.0], step=step, **FRICTION)
    with pytest.raises(BadInput, match="threshold"):
        threshold([0.0, 1.0], [0.0, 0.0], step=1e-3, v_min=-1.0, **FRICTION)


def test_importing_it_brings_nothing_heavy():
    heavy = "{'matplotlib', 'fmpy', 'scipy'}"
    code = f"import sys, cosim.mechanics.part; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
