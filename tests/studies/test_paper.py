"""The paper's closed forms against an event-driven simulation that uses none of them.

``Part`` follows a part on a surface whose velocity is linear between knots, from event to event, in
the form of the friction law alone. Published and derived numbers have µ_s = 0.7 and µ_k = 0.6.
"""

import csv
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar

import cosim
from benchmarks import knife_edge
from benchmarks.errata import errata, errata_text
from cosim.cli.main import main
from cosim.drive.surface import formulas
from cosim.drive.surface.formulas import Transport
from cosim.drive.surface.waveforms import (
    Cycle,
    optimal_cycle,
    quaid_cycle,
    quaid_limit,
    quaid_velocity,
)
from cosim.errors import BadInput
from cosim.studies.paper import figure7, figures
from cosim.studies.paper.theory import theory
from tests.helpers import needs
from tests.helpers.examples import examples
from tests.helpers.rational import Contact, simulate, start_velocity

pytestmark = pytest.mark.physics

G = 9.81
MU: Any = {"mu_s": 0.7, "mu_k": 0.6}
FIGURE_3: dict[str, Any] = {**MU, "a_max": 10 * G, "f_n": 5.0, "period": 0.05}


@dataclass
class Part:
    """Coulomb friction against a surface; accelerations in m/s², ``weight`` 0 if horizontal."""

    mu_s: float
    mu_k: float
    f_n: float
    weight: float = 1.0

    def travel(self, times, velocities, periods=3):
        """The part's way, m, in each period; it starts with the surface's velocity."""
        ways, slip = [], 0.0
        for _ in range(periods):
            way = 0.0
            for (t0, v0), (t1, v1) in pairwise(zip(times, velocities, strict=True)):
                if t1 > t0:
                    slip, step = self._phase(slip, v0, (v1 - v0) / (t1 - t0), t1 - t0)
                    way += step
            ways.append(way)
        return ways

    def _phase(self, slip, velocity, surface, left):
        """Surface minus part, and the part's way, after a phase of constant acceleration."""
        way = 0.0
        for _ in range(3):
            part = self._acceleration(slip, surface)
            rate = surface - part
            met = slip * rate < 0 and -slip / rate < left
            step = -slip / rate if met else left
            way += step * (velocity - slip + 0.5 * part * step)
            slip = 0.0 if met else slip + rate * step
            velocity += surface * step
            left -= step
            if not met:
                break
        return slip, way

    def _acceleration(self, slip, surface):
        needed = surface / G + self.weight
        if slip == 0.0 and abs(needed) <= self.mu_s * self.f_n:
            return surface
        direction = math.copysign(1.0, slip or needed)
        return (direction * self.mu_k * self.f_n - self.weight) * G


def simulated(part: Part, cycle: Cycle) -> float:
    times, velocities = cycle.knots()
    return part.travel(times, velocities)[-1] / times[-1]


def optimal_times(case: Transport) -> tuple[float, float]:
    """The ends T1, T2, s, of the first two phases, as the paper's closed forms have them."""
    pair, peak = case.coefficients(), case.a_max / case.gravity
    total = pair.static + pair.kinetic
    first = pair.kinetic / total
    second = (1.0 + pair.kinetic / peak) * pair.static / (2.0 * total)
    return first * case.period, (first + second) * case.period


# The numbers found before, to all their digits


@pytest.mark.parametrize(
    ("peak", "best", "velocity"),
    [
        (5, 3.9209390477, 0.0806031256),
        (10, 6.7083044169, 0.3356265876),
        (20, 11.0605620285, 0.9391278759),
        (50, 20.9069122418, 2.9150521251),
    ],
)
def test_the_best_normal_force(peak, best, velocity):
    f_n = formulas.optimal_force_ratio(**MU, a_max=peak * G)
    assert f_n == pytest.approx(best, abs=6e-11)
    reached = formulas.average_velocity(Transport(**MU, a_max=peak * G, f_n=f_n, period=0.02))
    assert reached / (G * 0.02) == pytest.approx(velocity, abs=6e-11)


@pytest.mark.parametrize(
    ("f_n", "velocity"),
    [(2, 0.0563076923), (3, 0.1832899408), (5, 0.3106508876), (8, 0.3245602811)],
)
def test_the_velocity_over_the_normal_force(f_n, velocity):
    reached = formulas.average_velocity(Transport(**MU, a_max=10 * G, f_n=f_n, period=0.1))
    assert reached / (G * 0.1) == pytest.approx(velocity, abs=6e-11)


def test_the_papers_figure_3():
    t1, t2 = optimal_times(Transport(**FIGURE_3))
    assert t1 / 0.05 == pytest.approx(0.6153846154, abs=6e-11)
    assert t2 / 0.05 == pytest.approx(0.8846153846, abs=6e-11)
    times, velocities = optimal_cycle(Transport(**FIGURE_3)).knots()
    assert times.tolist() == pytest.approx([0.0, t1, t2, 0.05], abs=1e-17)
    expected = [-0.4585798817, 1.0798816568, -1.6124260355, -0.4585798817]
    assert (velocities / (G * 0.05)).tolist() == pytest.approx(expected, abs=6e-11)


def test_down_robust_and_sticking_limit():
    unit = G * 0.05
    down = formulas.average_velocity(Transport(**FIGURE_3, direction="down"))
    assert down / unit == pytest.approx(-1.1502958580, abs=6e-11)
    robust = formulas.average_velocity(Transport(**FIGURE_3, robust=True))
    assert robust / unit == pytest.approx(0.7 / 3, rel=1e-13)
    assert formulas.largest_force_ratio(0.7, 10 * G) == pytest.approx(90 / 7, rel=1e-14)
    assert formulas.largest_force_ratio(0.6, 10 * G) == pytest.approx(15, rel=1e-14)


def test_the_conditions():
    low, high = formulas.sticking_range(0.7, 5.0)
    assert (low, high) == pytest.approx((-4.5 * G, 2.5 * G))
    assert formulas.slipping_acceleration(0.6, 5.0, +0.1) == pytest.approx(2.0 * G)
    assert formulas.slipping_acceleration(0.6, 5.0, -0.1) == pytest.approx(-4.0 * G)
    assert formulas.least_force_ratio(0.7) == pytest.approx(1 / 0.7)
    assert formulas.least_peak_acceleration(0.7, 5.0) == -low
    assert formulas.least_peak_acceleration(0.7, formulas.least_force_ratio(0.7)) == pytest.approx(
        formulas.least_peak_acceleration_at_any_force()
    )
    for f_n, words in ((1.4, "a surface at rest holds"), (12.9, "shakes the part loose")):
        with pytest.raises(BadInput, match=words):
            Transport(**{**FIGURE_3, "f_n": f_n}).coefficients()


# Against the simulation


@st.composite
def cases(draw, beyond=0.0):
    """µ_s, µ_k, a_max, f_n, T with transport upwards; f_n above ``beyond``/µ_k too."""
    mu_s = draw(st.floats(0.05, 2.0))
    mu_k = mu_s * draw(st.floats(0.2, 1.0))
    least = max(1.0 / mu_s, beyond / mu_k)
    peak = (mu_s * least + 1.0) * draw(st.floats(1.02, 50.0))
    cap = (peak - 1.0) / mu_s
    f_n = least + (cap - least) * draw(st.floats(0.02, 0.98))
    return mu_s, mu_k, peak * G, f_n, draw(st.floats(1e-3, 10.0))


@examples(120)
@given(cases())
def test_upwards_as_simulated(case):
    mu_s, mu_k, a_max, f_n, period = case
    expected = formulas.average_velocity(Transport(*case))
    reached = simulated(Part(mu_s, mu_k, f_n), optimal_cycle(Transport(*case), margin=1e-12))
    assert reached == pytest.approx(expected, rel=1e-8, abs=1e-9 * a_max * period * 1e-3)


@examples(120)
@given(cases(beyond=1.0), st.sampled_from([("down", False), ("down", True), ("up", True)]))
def test_downwards_and_robust_as_simulated(case, variant):
    mu_s, mu_k, a_max, f_n, period = case
    options: Any = {"direction": variant[0], "robust": variant[1]}
    expected = formulas.average_velocity(Transport(*case, **options))
    waveform = optimal_cycle(Transport(*case, **options), margin=1e-12)
    reached = simulated(Part(mu_s, mu_k, f_n), waveform)
    assert reached == pytest.approx(expected, rel=1e-8, abs=1e-9 * a_max * period * 1e-3)
    assert (expected > 0) == (variant[0] == "up")


@examples(80)
@given(cases(), st.floats(0.01, 1.0))
def test_quaid_as_simulated(case, share):
    mu_s, mu_k, a_max, f_n, period = case
    stick = share * formulas.sticking_range(mu_s, f_n)[1] * (1 - 1e-12)
    expected = quaid_velocity(Transport(*case), stick)
    reached = simulated(Part(mu_s, mu_k, f_n), quaid_cycle(stick, a_max, period))
    assert reached == pytest.approx(expected, rel=1e-8, abs=1e-12 * a_max * period)
    assert expected <= formulas.average_velocity(Transport(*case)) * (1 + 1e-12)


@examples(100)
@given(cases(beyond=1.0))
def test_quaid_downwards_as_simulated(case):
    mu_s, mu_k, a_max, f_n, period = case
    stick = quaid_limit(mu_s, f_n, "down") * (1 - 1e-12)
    expected = quaid_velocity(Transport(*case, direction="down"), stick)
    waveform = quaid_cycle(stick, a_max, period, "down")
    assert simulated(Part(mu_s, mu_k, f_n), waveform) == pytest.approx(expected, rel=1e-8)


@examples(80)
@given(cases(beyond=1.0), st.sampled_from(["up", "down"]))
def test_the_horizontal_equivalent_moves_alike(case, direction):
    # A part on a level surface, pressed by its own weight, with the coefficients of the mapping.
    # Only its static friction while the surface flees is the vertical part's, not the mapping's.
    mu_s, mu_k, a_max, f_n, period = case
    static, kinetic = formulas.horizontal_equivalent(mu_s, mu_k, f_n, direction)
    assume(static * 1.001 < a_max / G)
    sign = 1.0 if direction == "up" else -1.0
    times, velocities = optimal_cycle(Transport(*case, direction=direction), margin=1e-12).knots()
    level = Part(static, kinetic, 1.0, weight=0.0)
    reached = level.travel(times, sign * velocities)[-1] / period
    expected = formulas.horizontal_velocity(static, kinetic, a_max, period)
    assert reached == pytest.approx(expected, rel=1e-8, abs=1e-9 * a_max * period * 1e-3)
    assert sign * expected == formulas.average_velocity(Transport(*case, direction=direction))


def test_the_order_of_the_horizontal_coefficients():
    for f_n, below in ((19.999, True), (20.001, False)):  # 2/(µ_s − µ_k) = 20
        pair = formulas.horizontal_equivalent(0.7, 0.6, f_n)
        assert (pair.static < pair.kinetic) is below


def test_the_optimum_is_a_knife_edge_and_the_robust_variant_is_not():
    def moved(first, early):
        end = 4.0 / (first + 4.0) - early
        second = 0.5 * (1.0 + end * (1.0 + first / 10.0))
        accelerations = [first * (1 - 1e-13), -10.0, 10.0]
        times = np.array([0.0, end, second, 1.0])
        start = -Cycle(tuple(times), tuple(accelerations), 0.0).position(1.0 - 1e-15)
        velocities = start + np.append([0.0], np.cumsum(accelerations * np.diff(times)))
        return Part(0.7, 0.6, 5.0).travel(times * 1.0, velocities * G, periods=400)[-1] / G

    assert moved(2.5, -1e-9) == pytest.approx(0.3106508876, abs=1e-8)
    assert moved(2.5, +1e-9) == pytest.approx(0.054, abs=5e-4)
    assert moved(2.0, -1e-9) == pytest.approx(0.2333333333, abs=1e-8)
    assert moved(2.0, +1e-9) == pytest.approx(0.2333333333, abs=1e-8)


@examples(80)
@given(cases(), st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(-1, 1)), min_size=2, max_size=6))
def test_no_other_waveform_is_faster(case, phases):
    # Any periodic waveform of piecewise constant acceleration, once the part's motion repeats.
    mu_s, mu_k, a_max, f_n, period = case
    lengths = np.array([length for length, _ in phases])
    lengths *= period / lengths.sum()
    accelerations = np.array([a for _, a in phases])
    accelerations -= np.dot(accelerations, lengths) / period
    assume(np.abs(accelerations).max() > 1e-3)
    accelerations *= a_max / np.abs(accelerations).max()
    times = np.append(0.0, np.cumsum(lengths))
    velocities = np.append(0.0, np.cumsum(accelerations * lengths))
    velocities[-1] = 0.0
    velocities -= np.trapezoid(velocities, times) / times[-1]
    ways = Part(mu_s, mu_k, f_n).travel(times, velocities, periods=60)
    assume(math.isclose(ways[-1], ways[-2], rel_tol=1e-9))
    assert ways[-1] / period <= formulas.average_velocity(Transport(*case)) * (1 + 1e-8)


# The waveform as a function of time


@examples(60)
@given(cases(beyond=1.0), st.sampled_from(["up", "down"]), st.booleans())
def test_the_waveform_repeats_and_its_functions_agree(case, direction, robust):
    *_, a_max, _, period = case
    transport = Transport(*case, direction=direction, robust=robust)
    cycle = optimal_cycle(transport)
    assert cycle.times[1:3] == pytest.approx(optimal_times(transport), rel=1e-13)
    times, velocities = cycle.knots()
    assert velocities[0] == velocities[-1]
    assert abs(np.trapezoid(velocities, times)) < 1e-13 * a_max * period**2
    assert max(np.abs(cycle.accelerations)) <= a_max

    dense = np.unique(np.concatenate([np.linspace(0, period, 20_001), times]))
    speed = np.interp(dense, times, velocities)
    scale = a_max * period
    height = cumulative_trapezoid(speed, dense, initial=0.0)
    np.testing.assert_allclose(cycle.position(dense), height, atol=1e-8 * scale * period)
    assert cycle.stroke() == pytest.approx(np.ptp(height), abs=1e-7 * scale * period)
    np.testing.assert_allclose(  # and in the third period
        cycle.position(dense[1:-1] + 2 * period), height[1:-1], atol=1e-8 * scale * period
    )
    slopes = np.diff(velocities) / np.diff(times)
    np.testing.assert_allclose(slopes, cycle.accelerations, rtol=1e-9)


def test_the_margin_delays_the_meeting_by_that_share_of_the_period():
    margin = 1e-3
    times, velocities = optimal_cycle(Transport(**FIGURE_3), margin=margin).knots()
    first = (velocities[1] - velocities[0]) / times[1]
    assert first == pytest.approx((0.7 * (1 - margin) * 5 - 1) * G, rel=1e-12)
    part_end = velocities[1] - 4.0 * G * (times[3] - times[1])
    closing = first + 4.0 * G
    assert (part_end - velocities[3]) / closing == pytest.approx(margin * 0.05, rel=1e-9)
    reached = Part(0.7, 0.6, 5.0).travel(times, velocities)[-1] / 0.05
    assert reached == pytest.approx(formulas.average_velocity(Transport(**FIGURE_3)), rel=5e-3)


# The optimum and the limits of the normal force


@examples(100)
@given(st.floats(0.05, 2.0), st.floats(0.05, 1.0), st.floats(2.01, 1000.0))
def test_the_cubics_root_is_the_maximiser(mu_s, ratio, peak):
    mu_k = mu_s * ratio
    root = formulas.cubic_force_ratio(mu_s, mu_k, peak * G)
    cubic = mu_s * mu_k**2 * root**3 + mu_s * mu_k * root**2 + mu_k * root + 1
    assert cubic == pytest.approx(peak**2, rel=1e-12)

    cap = formulas.largest_force_ratio(mu_s, peak * G)
    best = formulas.optimal_force_ratio(mu_s, mu_k, peak * G)
    assert best == min(root, cap)
    found: Any = minimize_scalar(
        lambda f: -formulas.average_velocity(Transport(mu_s, mu_k, peak * G, f, 1.0)),
        bounds=((1 + 1e-12) / mu_s, cap * (1 - 1e-12)),
        method="bounded",
        options={"xatol": 1e-9 / mu_s},
    )
    assert best == pytest.approx(found.x, rel=2e-5)


def test_the_optimum_grows_as_the_power_two_thirds():
    low, high = (formulas.optimal_force_ratio(0.7, 0.6, peak * G) for peak in (1e6, 1e9))
    assert math.log(high / low) / math.log(1e3) == pytest.approx(2 / 3, abs=1e-4)


def test_with_little_kinetic_friction_the_optimum_is_the_sticking_limit():
    assert formulas.optimal_force_ratio(0.7, 0.1, 10 * G) == pytest.approx(90 / 7)
    assert formulas.cubic_force_ratio(0.7, 0.1, 10 * G) > 90 / 7


def test_the_limits_of_the_velocity():
    unit = G * 0.05
    least, cap = 1 / 0.7, 90 / 7
    just_held = formulas.average_velocity(Transport(**{**FIGURE_3, "f_n": least * (1 + 1e-9)}))
    assert 0 < just_held / unit < 1e-15
    sliding = formulas.horizontal_equivalent(0.7, 0.6, 15 * (1 - 1e-9))
    assert 0 < formulas.horizontal_velocity(*sliding, 10 * G, 0.05) / unit < 1e-7
    at_cap = formulas.average_velocity(Transport(**{**FIGURE_3, "f_n": cap * (1 - 1e-9)}))
    assert at_cap / unit == pytest.approx(64 * 1179 / (40 * 13689), rel=1e-7)
    # Beyond it the same waveform carries the part down: it slips only when the surface rises.
    first, slowed, f_n = 0.7 * 12.9 - 1, 0.6 * 12.9 + 1, 12.9
    times = np.array([0.0, t1 := slowed / (first + slowed), 0.5 * (1 + t1 + first * t1 / 10), 1.0])
    velocities = np.append(0.0, np.cumsum([first, -10.0, 10.0] * np.diff(times))) * G
    velocities -= np.trapezoid(velocities, times)
    assert Part(0.7, 0.6, f_n).travel(times, velocities, periods=9)[-1] < 0


def test_v_ave_scales_with_gravity_and_period():
    moon = formulas.average_velocity(Transport(0.7, 0.6, 10 * 1.62, 5.0, 0.2, gravity=1.62))
    assert moon / (1.62 * 0.2) == pytest.approx(0.31065088757396, rel=1e-13)
    huge = formulas.average_velocity(Transport(0.7, 0.6, 1e30, 1e14, 1e-10))
    assert huge == pytest.approx(1e30 * 1e-10 * (7 / 13) ** 2 / 4, rel=1e-12)
    assert formulas.cubic_force_ratio(0.7, 0.6, 1e30) > 1e19


# Misprints


def test_every_misprint_is_proved():
    found = errata()
    assert len(found) == 7
    assert all(item.confirmed for item in found), [i.where for i in found if not i.confirmed]
    first, _, _, sticking, guideline, order, growth = found
    assert first.numbers["right_velocity"] == pytest.approx(105 / 338, rel=1e-8)
    assert first.numbers["printed_gain"] == pytest.approx(-4 / 13, rel=1e-15)
    assert sticking.numbers["f"] == pytest.approx(90 / 7)
    assert guideline.numbers["f_10"] == pytest.approx(6.7083044169, rel=1e-6)
    assert order.numbers["limit"] == pytest.approx(20)
    assert growth.numbers["exponent"] == pytest.approx(2 / 3, abs=2e-3)


def test_the_misprints_as_text():
    text = errata_text()
    assert text.count("confirmed.") == 7
    assert "NOT CONFIRMED" not in text
    assert max(len(line) for line in text.splitlines()) <= 92


def test_the_command_says_what_it_takes_and_writes(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["theory", "--help"])
    told = capsys.readouterr().out
    assert "the figures 3 and 4" in told and "(default: 98.1)" in told


@examples(50)
@given(st.fractions(1, 20, max_denominator=50), st.fractions(4, 40, max_denominator=50))
def test_the_exact_simulation_agrees_with_this_one(f_n, peak):
    mu_s, mu_k = Fraction(7, 10), Fraction(3, 5)
    phases = [(Fraction(1, 2), peak / 3), (Fraction(1, 5), -peak), (Fraction(3, 10), peak / 9)]
    # At the very limit of sticking rounding decides, and there is no rounding in rational numbers.
    assume(all(abs(a + 1) != mu_s * f_n for _, a in phases))
    periods = simulate(phases, Contact.coulomb(mu_s, mu_k, f_n), 4)
    times = [0.0, 0.5, 0.7, 1.0]
    start = start_velocity(phases)
    velocities = [float(start + v) * G for v in (0, peak / 6, peak / 6 - peak / 5, 0)]
    part = Part(0.7, 0.6, float(f_n))
    ways = part.travel(times, velocities, periods=4)
    exactly = [float(period.travelled) for period in periods]
    assert np.array(ways) / G == pytest.approx(exactly, abs=1e-9)


# What cannot be, and the files


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"f_n": 1.428}, "f_n = 1.428 is too small"),
        ({"f_n": 12.9}, "a_max = 98.1 m/s² is too small"),
        ({"a_max": 19.0}, "a_max = 19 m/s² is too small"),
        ({"mu_k": 0.71}, "mu_k = 0.71 must not exceed mu_s = 0.7"),
        ({"mu_k": 0.0}, "mu_k = 0 must be above 0, from 1e-30 to 1e+30"),
        ({"period": math.nan}, "period = nan must be"),
        ({"a_max": math.inf}, "a_max = inf must be"),
        ({"mu_k": 0.19, "direction": "down"}, "too small for transport downwards"),
        ({"mu_k": 0.19, "robust": True}, "too small for robust transport"),
        ({"direction": "sideways"}, 'direction = "sideways" must be "up" or "down"'),
        ({"gravity": 0.0}, "gravity = 0 must be"),
    ],
)
def test_what_cannot_be_is_told_in_a_sentence(change, words):
    case = Transport(**{**FIGURE_3, **change})
    for function in (formulas.average_velocity, optimal_cycle, quaid_velocity):
        with pytest.raises(BadInput, match=r"^[^\n]+\.$") as caught:
            function(case)
        assert words in str(caught.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda: optimal_cycle(Transport(**{**FIGURE_3, "f_n": 1.43}), margin=0.05),
        lambda: quaid_cycle(0.0, 98.1, 0.05),
        lambda: formulas.average_velocity(Transport(0.7, 0.6, 1e308, 5.0, 1e10)),
    ],
)
def test_other_impossible_numbers(call):
    with pytest.raises(BadInput, match=r"\.$"):
        call()


def test_solvers_at_the_knife_edge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # the finest steps take seconds, and write what the others write
    monkeypatch.setattr(knife_edge, "METHODS", dict([*knife_edge.METHODS.items()][:2]))
    found = knife_edge.report()
    found.save(tmp_path)
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".md", ".png"}
    assert "Of the 152 mm/s" in repr(found) and "27 mm/s are left" in repr(found)


def test_the_files(tmp_path: Path):
    found = theory()
    found.save(tmp_path / "out")
    numbers = found.numbers
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"theory.json", "figure3.png", "figure4.png"}
    assert json.loads((tmp_path / "out/theory.json").read_text("utf-8")) == numbers
    assert numbers["up"]["v_average_over_gT"] == pytest.approx(0.31065088757, abs=1e-11)
    assert numbers["normal_force"]["f_optimal"] == pytest.approx(6.7083044169, abs=1e-10)
    assert [row["a_max"] / G for row in numbers["figure4"]] == pytest.approx([5, 10, 15, 20])
    for name in ("figure3.png", "figure4.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
    assert "+152.37 mm/s" in repr(found)


def test_variants_that_are_not_possible_are_named():
    found = theory(mu_s=0.72, mu_k=0.2, a_max=2.1 * G, f_n=1.45, period=0.01)
    assert "not_possible" in found.numbers["down"]
    assert "not_possible" in found.numbers["up_robust"]
    assert "none: f_n = 1.45 is too small" in repr(found)


def test_there_is_no_theory_without_transport():
    with pytest.raises(BadInput, match="too small"):
        theory(f_n=1.0)


def test_formulas_do_without_matplotlib():
    code = "import sys, cosim.studies.paper.theory; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_line_of_optima_runs_through_the_best_of_each_curve():
    case = Transport(**FIGURE_3)
    ratios, speeds = figures.optima(case, 20 * G)
    assert (np.diff(ratios) > 0).all() and (np.diff(speeds) > 0).all()
    for peak in (5 * G, 10 * G, 20 * G):
        found: Any = minimize_scalar(
            lambda f, a=peak: -formulas.average_velocity(Transport(0.7, 0.6, a, f, 0.05)),
            bounds=(1.0001 / 0.7, (peak / G - 1) / 0.7 * 0.9999),
            method="bounded",
            options={"xatol": 1e-8},
        )
        assert np.interp(found.x, ratios, speeds) == pytest.approx(-found.fun, rel=1e-4)


def test_the_figures_show_the_surface_and_the_line_of_optima():
    found = theory()
    drawn = found.plot().axes[0].get_lines()
    starts = {str(line.get_label()): np.asarray(line.get_ydata())[0] for line in drawn}
    assert starts["surface"] == pytest.approx(0.7 * 5 - 1)
    (curves, _) = figures.draw_velocities(found.case, [10 * G]).axes
    assert figures.OPTIMA in {line.get_label() for line in curves.get_lines()}


@needs.ngspice_library
def test_figure_7_has_the_published_errors_and_the_machines_own(trials: Path, tmp_path: Path):
    told: list[int] = []
    found = figure7.paper(trials, progress=lambda done, total, what: told.append(total))
    found.save(tmp_path)
    assert told == [10] * 10
    rows = list(csv.DictReader((tmp_path / "figure7.csv").read_text().splitlines()))
    numbers = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    # the published mean error; that of the same parameters solved exactly
    assert numbers["error_theirs [mm]"].mean() == pytest.approx(0.1611, abs=5e-5)
    assert numbers["error_exact [mm]"].mean() == pytest.approx(0.1569, abs=5e-5)
    # trial 5 in the paper's figure: from 0 to 4.2 mm in 0.319 s, the last of its 16 kicks at 4.55
    every = cosim.fit(trials, evaluate="published", solver="published").shown
    shown = every[figure7.TRIAL - 1]
    assert shown.simulated[0][-1] == pytest.approx(0.319, abs=1e-3)
    assert shown.simulated[1][-1] == pytest.approx(4.2e-3, abs=0.05e-3)
    assert shown.simulated[1].max() == pytest.approx(4.55e-3, abs=0.05e-3)
    # which the whole machine repeats, too
    apart = numbers["v_machine [mm/s]"] - numbers["v_measured [mm/s]"]
    assert np.abs(apart).mean() < 0.65
    assert (tmp_path / "figure7.png").read_bytes().startswith(b"\x89PNG")
