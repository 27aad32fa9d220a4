"""The command V1(t): shapes, exact jumps, no drift, and the firmware's staircase."""

import re
from cmath import exp as e
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor, inf, nextafter, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import cosim
from cosim.drive.command import (
    Command,
    Lagging,
    Lines,
    Sine,
    Staircase,
    WithPwm,
    command,
    commands,
)
from cosim.drive.periodic import held
from cosim.drive.straights import straights
from cosim.errors import BadInput
from cosim.scene import changed, load
from cosim.scene.firmware import passes, staircase
from tests.helpers.examples import examples
from tests.helpers.pins import pin, pin_before, v_dac, v_dac_before, value_before

GAIN = 15 / 4.7


class Sawtooth(Lines):
    def __init__(self, frequency: float, amplitude: float, offset: float, reset_time: float = 0.0):
        self.reset_time = reset_time
        shape = [(0.0, -0.5), (1.0 - reset_time * frequency, 0.5)]
        super().__init__(frequency, amplitude, offset, shape)


def square(frequency: float, amplitude: float, offset: float, duty: float = 0.5) -> Lines:
    return Lines(frequency, amplitude, offset, held([(0.0, 0.5), (duty, -0.5)]))


def made(*overrides: str, scene: str = "reference") -> Command:
    return command(load(scene, overrides))


@pytest.mark.parametrize(
    ("t", "v1"), [(0.0, -5.2), (0.0125, -3.2), (0.025, -1.2), (0.049, 2.64), (0.05, -5.2)]
)
def test_sawtooth(t: float, v1: float) -> None:
    drive = made()
    assert drive.value(t) == pytest.approx(v1)


def test_sawtooth_jumps() -> None:
    drive = made()
    assert drive.next_jump(0.0) == 0.05
    assert value_before(drive, 0.05) == pytest.approx(2.8)
    assert value_before(drive, 0.03) == drive.value(0.03)
    assert drive.piece(0.01).until == 0.05


def test_slow_reset() -> None:
    drive = made("drive.reset_time=0.01")
    times = [0.0, 0.02, 0.04, 0.045, 0.05]
    assert drive.values(times) == pytest.approx([-5.2, -1.2, 2.8, -1.2, -5.2])
    assert drive.next_jump(0.0) == inf
    assert [drive.piece(t).until for t in (0.0, 0.04, 0.05)] == pytest.approx([0.04, 0.05, 0.09])


def test_sine() -> None:
    drive = made("drive.waveform=sine")
    assert drive.values([0, 0.0125, 0.025, 0.0375]) == pytest.approx([-1.2, 2.8, -1.2, -5.2])
    assert drive.next_jump(0.0) == inf
    assert drive.value(1000 * 0.05 + 0.0125) == pytest.approx(2.8, abs=1e-12)


@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_straights_of_a_sine_have_its_integrals(lag: float) -> None:
    f, offset, half, periods = 20.0, -1.2, 4.0, 3
    turn = 2 * pi * f
    shapes = [Sine(f, 2 * half, offset), Lagging(Sine(f, 2 * half, offset), lag / f)]
    blocks = list(straights(shapes, periods / f))
    # Each begins where the one before ended, and so does its voltage.
    for before, after in pairwise(blocks):
        assert before[0][-1] == after[0][0]
        assert before[2][-1] == pytest.approx(after[1][0], abs=1e-13)
    times = np.concatenate([[0.0], *(edges[1:] for edges, _, _ in blocks)])
    start = np.concatenate([first for _, first, _ in blocks])
    end = np.concatenate([last for _, _, last in blocks])
    h = np.diff(times)
    for k, begin in enumerate((0.0, lag / f)):
        middle, reach = 0.5 * (times[1:] + times[:-1]) - begin, 0.5 * turn * h
        mean = offset + half * np.sin(turn * middle) * np.sin(reach) / reach
        # Those that end with a piece of either command are not all as long as the others.
        whole = h > 0.999 * h.max()
        assert whole.sum() > 0.99 * len(h)
        np.testing.assert_allclose(
            0.5 * (start[:, k] + end[:, k])[whole], mean[whole], rtol=0, atol=3e-12
        )
        squares = np.sum(h * (start[:, k] ** 2 + start[:, k] * end[:, k] + end[:, k] ** 2)) / 3
        assert squares * f / periods == pytest.approx(offset**2 + half**2 / 2, rel=1e-11)


@given(
    shape=st.sampled_from(
        [
            [],
            ["drive.waveform=square"],
            ["drive.waveform=falling-sawtooth"],
            ["drive.waveform=pieces", "drive.table=[[0.1, 0.5], [0.3, -0.2], [0.3, 0.1]]"],
            ["drive.quantised=true"],
            ["drive.reset_time=1e-4"],
        ]
    ),
    frequency=st.one_of(st.floats(1.0, 3000.0), st.integers(1, 500)),
    amplitude=st.sampled_from([0.0, 0.3, 7.0]),
    duration=st.floats(0.002, 0.4),
)
@example(shape=["drive.quantised=true"], frequency=20.0, amplitude=7.0, duration=0.4)
@example(shape=[], frequency=20, amplitude=7.0, duration=0.1)
def test_straights_at_once_are_those_one_after_the_other(
    shape: list[str], frequency: float, amplitude: float, duration: float
) -> None:
    """Many corners of one command are made at once; of two commands, here equal ones, piece by
    piece. To the last bit."""
    offset = 0.0 if "drive.quantised=true" in shape else -1.2
    settings = {"frequency": frequency, "amplitude": amplitude, "offset": offset}
    drive = made(*(f"drive.{key}={value}" for key, value in settings.items()), *shape)
    alone, both = (list(straights([drive] * count, duration)) for count in (1, 2))
    for one, two in zip(alone, both, strict=True):
        np.testing.assert_array_equal(one[0], two[0])
        for ends, twice in zip(one[1:], two[1:], strict=True):
            np.testing.assert_array_equal(ends[:, 0], twice[:, 0])


def test_square() -> None:
    drive = made("drive.waveform=square")
    assert drive.values([0, 0.0249, 0.025, 0.0499]) == pytest.approx([2.8, 2.8, -5.2, -5.2])
    assert drive.next_jump(0.0) == 0.025
    assert drive.next_jump(0.025) == 0.05
    assert value_before(drive, 0.05) == pytest.approx(-5.2)
    assert value_before(drive, 0.0) == pytest.approx(-5.2)


SHAPES: dict[str, tuple[list[str], Any]] = {
    "falling-sawtooth": ([], lambda n: 1 / (pi * n)),
    "square": (["drive.duty=0.3"], lambda n: 2 * abs(sin(0.3 * pi * n)) / (pi * n)),
    "steps": (
        ["drive.table=[[0, 0.5], [0.2, 0.0], [0.5, -0.5], [0.7, 0.0]]"],  # three levels
        lambda n: abs(sum(0.5 * b * e(2j * pi * n * p) for p, b in
                          ((0, 1), (0.2, -1), (0.5, -1), (0.7, 1)))) / (pi * n),
    ),
    "pieces": (
        ["drive.table=[[0.25, 0.5], [0.75, -0.5]]"],  # a triangle
        lambda n: 4 / (pi * n) ** 2 if n % 2 else 0.0,
    ),
}  # fmt: skip
"""Shapes, and the amplitudes of their harmonics for 1 V peak-to-peak, in closed form."""


@pytest.mark.parametrize("shape", SHAPES)
def test_harmonics_of_a_shape(shape: str) -> None:
    settings, harmonic = SHAPES[shape]
    drive = made(f"drive.waveform={shape}", *settings)
    count = 10 << 12
    # In the middle between instants, so that none is on a jump.
    values = drive.values((np.arange(count) + 0.5) / count / 20.0)
    found = np.abs(np.fft.rfft(values)) / count * 2
    expected = [8.0 * harmonic(n) for n in range(1, 12)]
    assert found[1:12] == pytest.approx(expected, abs=2e-6)
    assert np.ptp(values) == pytest.approx(8.0, rel=1e-3)


def test_pieces_in_closed_form() -> None:
    """Straight from corner to corner, over the period's end too; a jump where a phase is twice."""
    table = "[[0.1, -0.5], [0.4, 0.25], [0.4, 0.5], [0.9, -0.1]]"
    drive = made("drive.waveform=pieces", f"drive.table={table}")
    phases = [0.1, 0.25, 0.4, 0.65, 0.9, 1.0, 1.05]
    levels = [-0.5, -0.125, 0.5, 0.2, -0.1, -0.3, -0.4]
    expected = [-1.2 + 8.0 * level for level in levels]
    assert drive.values([phase / 20.0 for phase in phases]) == pytest.approx(expected, abs=1e-12)
    assert (drive.next_jump(0.0), drive.next_jump(0.021)) == (0.4 / 20, 1.4 / 20)
    assert value_before(drive, 0.02) == pytest.approx(-1.2 + 8.0 * 0.25)
    corners = [0.005, 0.02, 0.045, 0.055]
    assert [drive.piece(t).until for t in (0.0, *corners[:3])] == pytest.approx(corners)


@examples(50)
@given(levels=st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=9), f=st.floats(1.0, 500.0))
@pytest.mark.slow
def test_a_table_of_steps_in_codes(levels: list[float], f: float) -> None:
    """The nearest codes of the levels, held for whole steps of 50 us; the mean at the pin's."""
    table = [list(pair) for pair in evenly(levels)]
    given_table = [f"drive.table={table}", f"drive.frequency={f!r}", "drive.offset=0"]
    drive = made("drive.waveform=steps", *given_table, "drive.quantised=true")
    assert isinstance(drive, Staircase)
    place = [int(k * 5e-5 * f * len(levels) * (1 + 1e-12)) for k in range(len(drive.codes))]
    held_levels = 8.0 * np.array(levels)[np.minimum(place, len(levels) - 1)]
    made_volts = np.array([GAIN * (drive.v_offset - 3.3 * code / 1024) for code in drive.codes])
    near = np.abs(np.array(place) - 5e-5 * f * len(levels) * np.arange(len(place))) > 1e-6
    # The codes of step, of maximum and of pin are each off by half of one at most.
    assert np.abs(made_volts - held_levels)[near].max(initial=0) <= 1.5 * GAIN * 3.3 / 1024 + 1e-9
    assert (
        round(drive.period * 20_000, 9) == len(drive.codes) == ceil(Fraction(20_000) / Fraction(f))
    )


@pytest.mark.parametrize("shape", ["steps", "pieces"])
@pytest.mark.parametrize(
    ("table", "why"),
    [
        ("[]", "1 to 64 pairs of numbers"),
        ("[[0.0, 0.1, 0.2]]", "pairs of numbers, [[phase, level]"),
        ("[[0.5, 0.1], [0.2, 0.3]]", "phases from 0 to 1 that do not fall"),
        ("[[0.5, 0.1], [1.2, 0.3]]", "phases from 0 to 1 that do not fall"),
        ("[[0.5, 0.1], [0.50000000001, 0.3]]", "at least 1e-09 s apart"),
        ("[[0.5, 0.6]]", "levels from -0.5 to 0.5"),
        ("[[0.5, nan]]", "pairs of numbers, [["),
        ("[[0.5, true]]", "pairs of numbers, [["),
        ("7", "pairs of numbers, [["),
        (str([[k / 65, 0.0] for k in range(65)]), "1 to 64 pairs"),
    ],
)
def test_tables_that_are_refused(shape: str, table: str, why: str) -> None:
    with pytest.raises(BadInput, match=re.escape(why)):
        made(f"drive.waveform={shape}", f"drive.table={table}")


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (["drive.waveform=pieces"], "needs drive.table"),
        (["drive.table=[[0, 0.5]]"], 'drive.table is for drive.waveform = "steps" or "pieces"'),
        (["drive.waveform=sine", "drive.duty=0.3"], "drive.duty is for"),
        (["drive.waveform=sine", "drive.reset_time=1e-3"], '"sawtooth" or "falling-sawtooth"'),
        (["drive.waveform=pieces", "drive.table=[[0, 0.5]]", "drive.table.2=0.1"], "as many pairs"),
        (["drive.table.1=0.1"], "as many pairs"),
        (["drive.waveform=steps", "drive.table=[1, 2]", "drive.table.1=0.1"], "pairs of numbers"),
        (["coil.polarity=0"], "must be one of -1, 1"),
    ],
)
def test_keys_of_another_shape_are_refused(settings: list[str], why: str) -> None:
    with pytest.raises(BadInput, match=re.escape(why)):
        made(*settings)


def test_a_level_is_a_key() -> None:
    base = load("reference", ["drive.waveform=pieces", "drive.table=[[0, 0.5], [0.5, -0.5]]"])
    assert changed(base, {"drive.table.2": 0.25}, "test").drive.table == [[0, 0.5], [0.5, 0.25]]
    array = np.array([[0.0, 0.5], [0.5, 0.25]])
    assert load(base, {"drive.table": array}).drive.table == array.tolist()


@pytest.mark.parametrize("waveform", ["sawtooth", "square"])
def test_no_amplitude_no_jump(waveform: str) -> None:
    drive = made(f"drive.waveform={waveform}", "drive.amplitude=0")
    assert drive.next_jump(0.0) == inf
    assert drive.value(0.05) == value_before(drive, 0.05) == -1.2


# --- the firmware's staircase -----------------------------------------------------------------


def firmware(maximum: int, frequency: float, number: type, steps: int) -> list[int]:
    """What the device does, pass by pass of its loop (1 us each): DAC codes amid the 50 us steps.

    Its rules: decrement when 50 us have passed and the counter is above zero; else, when the
    counter is not above zero, write the maximum and start over after 1 us.
    """
    top, counter = number(maximum), number(0)
    decrement = top / (number(1_000_000) / number(frequency) / number(50))
    since_decrement, since_high, high = 50, 0, False
    dac, codes, start = 0, [], None
    now = 0
    while len(codes) < steps:
        if since_decrement >= 50 and counter > 0:
            counter -= decrement
            dac = max(0, int(counter))
            since_decrement = 0
        elif counter <= 0:
            if not high:
                high, since_high, dac = True, 0, maximum
            if since_high >= 1:
                high, counter = False, top
                if start is None:  # from here on each step is 50 us
                    start, since_decrement = now, 0
        if start is not None and (now - start) % 50 == 25:
            codes.append(dac)
        now, since_decrement, since_high = now + 1, since_decrement + 1, since_high + 1
    return codes


def device(maximum: int, frequency: float, loop_time: Fraction, count: int) -> list[int]:
    """The same rules with passes of ``loop_time`` s: the DAC code after each, from a reset on.

    A timer is read in whole microseconds. The code written is truncated and never below 0.
    """
    counter, dac, high = Fraction(0), 0, False
    decremented = raised = Fraction(0)
    codes: list[int] = []
    before = 0
    for n in range(1, 10**6):
        now = n * loop_time
        if floor((now - decremented) * 10**6) >= 50 and counter > 0:
            counter -= maximum * Fraction(frequency) / 20_000
            dac, decremented = max(0, int(counter)), now
        elif counter <= 0:
            if not high:
                high, raised, dac = True, now, maximum
            if floor((now - raised) * 10**6) >= 1:
                high, counter = False, Fraction(maximum)
        # the first reset after the start is like all later ones
        if codes or (dac == maximum and n > 10 and before == 0):
            codes.append(dac)
        if len(codes) == count:
            return codes
        before = dac
    raise AssertionError


CASES = [(778, 20.0), (1023, 50.8), (100, 99.5), (1, 30.0), (512, 7.3)]


@pytest.mark.parametrize(("maximum", "frequency"), CASES)
def test_staircase_is_the_firmware(maximum: int, frequency: float) -> None:
    codes = staircase(maximum, frequency)
    there = firmware(maximum, frequency, Fraction, 2 * len(codes) + 5)
    assert there == [codes[k % len(codes)] for k in range(len(there))]


@pytest.mark.parametrize(("maximum", "frequency"), CASES)
def test_staircase_is_close_to_single_precision(maximum: int, frequency: float) -> None:
    codes = staircase(maximum, frequency)
    there = firmware(maximum, frequency, np.float32, len(codes) + 1)
    assert max(abs(a - b) for a, b in zip(codes, there, strict=False)) <= 1
    # one step more, should the counter end just above zero
    assert there[len(codes)] in (maximum, 0)


@pytest.mark.parametrize("loop_time", [5e-6, 22e-6, 25e-6, 32e-6, 60e-6])
@pytest.mark.parametrize(("maximum", "frequency"), [(778, 20.0), (1023, 50.8), (100, 99.5)])
def test_loop_time_is_the_firmware(maximum: int, frequency: float, loop_time: float) -> None:
    codes = passes(staircase(maximum, frequency), loop_time)
    exact = Fraction(round(loop_time * 1e6), 10**6)
    there = device(maximum, frequency, exact, 2 * len(codes) + 5)
    assert there == [codes[k % len(codes)] for k in range(len(there))]


def test_loop_time_lowers_the_frequency() -> None:
    drive = made("drive.loop_time=22e-6", "drive.quantised=true", "circuit.model=full")
    assert isinstance(drive, Staircase)
    # by hand: 50 us are reached at the third pass; 999 steps of three passes, the maximum for two
    # passes and 0 for one
    assert drive.period == pytest.approx((999 * 3 + 2 + 1) * 22e-6)
    assert v_dac(drive, 0.0) == pytest.approx(778 / 1024 * 3.3)
    assert drive.next_jump(0.0) == pytest.approx(44e-6)
    assert drive.next_jump(44e-6 + 1e-9) == pytest.approx(110e-6)
    reset = drive.period
    assert v_dac(drive, reset - 11e-6) == 0.0
    assert v_dac(drive, reset + 11e-6) == v_dac(drive, 0.0)


@pytest.mark.parametrize(
    ("frequency", "steps"), [(20.0, 1000), (50.8, 394), (99.9, 201), (100.0, 200), (30.0, 667)]
)
def test_real_period_is_rounded_up_to_whole_steps(frequency: float, steps: int) -> None:
    drive = made("drive.quantised=true", f"drive.frequency={frequency}")
    assert isinstance(drive, Staircase)
    assert drive.period == pytest.approx(steps * 50e-6)
    # the reset is the one downward jump of V1
    jumps = [0.0]
    while len(jumps) < 5000:
        jumps.append(drive.next_jump(jumps[-1]))
    falls = [t for t in jumps if drive.value(t) < value_before(drive, t)]
    assert np.diff(falls) == pytest.approx(drive.period)


def test_staircase_of_the_paper() -> None:
    drive = made("drive.quantised=true", "circuit.model=full")
    # by hand: 8 V / 3.1915 = 2.5067 V -> code 778; offset pin 2.8 V / 3.1915 -> code 272
    assert v_dac(drive, 0.0) == pytest.approx(778 / 1024 * 3.3)
    assert drive.v_offset == pytest.approx(272 / 1024 * 3.3)
    assert drive.value(0.0) == pytest.approx(GAIN * (272 - 778) / 1024 * 3.3)
    # after k steps the counter has lost 0.778 k and is truncated
    assert v_dac(drive, 10.5 * 50e-6) == pytest.approx(770 / 1024 * 3.3)
    assert drive.next_jump(0.0) == 50e-6
    assert v_dac_before(drive, 50e-6) == v_dac(drive, 0.0)
    smooth = made()
    times = np.arange(0, 0.2, 1e-5)
    assert np.abs(drive.values(times) - smooth.values(times)).max() < 0.03


def test_few_codes_jump_seldom() -> None:
    drive = made(
        "drive.quantised=true", "drive.pot_max=0.002", "drive.frequency=1", "drive.pot_offset=0.1"
    )
    assert isinstance(drive, Staircase) and max(drive.codes) == 2
    # in exact arithmetic code 2 lasts one step, 1 half of the period, 0 the rest
    jumps = [drive.next_jump(t) for t in (0.0, 50e-6, 0.6)]
    assert jumps == pytest.approx([50e-6, 0.5 + 50e-6, 1.0])


def test_silent_knob() -> None:
    drive = made("drive.quantised=true", "drive.pot_max=0", "drive.pot_offset=0.25")
    assert drive.next_jump(0.0) == inf
    assert drive.value(0.3) == pytest.approx(GAIN * 3.3 / 4)


def test_knobs_reach_the_pins() -> None:
    drive = made(
        "drive.pot_max=0.7", "drive.pot_offset=0.4", "drive.quantised=true", "circuit.model=full"
    )
    assert v_dac(drive, 0.0) == pytest.approx(716 / 1024 * 3.3)
    assert drive.v_offset == pytest.approx(409 / 1024 * 3.3)


# --- the offset pin's PWM ---------------------------------------------------------------------

PWM = 488.28125


def test_pwm_of_the_paper() -> None:
    drive = made("drive.pwm_ripple=true", "drive.quantised=true", "circuit.model=full")
    # by hand: code 272 of 1024, a period of 2048 us; a pulse is 544 us wide, its middle at 0
    mean = 272 / 1024 * 3.3
    assert drive.v_offset == pytest.approx(mean)
    assert pin(drive, -1.0) == pin_before(drive, 0.0) == drive.v_offset
    levels = [pin(drive, t * 1e-6) for t in (0, 271, 273, 1775, 1777, 2319, 2321)]
    assert levels == [3.3, 3.3, 0.0, 0.0, 3.3, 3.3, 0.0]
    edges, t = [], 0.0
    while t < 0.1:
        t = drive.next_jump(t)
        if pin_before(drive, t) != pin(drive, t):
            edges.append(t)
    expected = [272e-6, *((k * 2048 + s * 272) * 1e-6 for k in range(1, 49) for s in (-1, 1))]
    assert edges[: len(expected)] == pytest.approx(expected, abs=1e-12)


def test_pwm_changes_nothing_else() -> None:
    stairs = "drive.quantised=true"
    plain = made(stairs, "circuit.model=full")
    drive = made(stairs, "drive.pwm_ripple=true", "circuit.model=full")
    times = np.linspace(0, 0.2, 7001)
    assert list(drive.values(times)) == list(plain.values(times))
    for t in map(float, times[:300]):
        assert value_before(drive, t) == value_before(plain, t)
        for of in (v_dac, v_dac_before):
            assert of(drive, t) == of(plain, t)


@pytest.mark.parametrize("pot", [0, 1])
def test_pwm_without_edges(pot: int) -> None:
    drive = made("drive.pwm_ripple=true", "drive.pot_max=0", f"drive.pot_offset={pot}",
                 "drive.quantised=true", "circuit.model=full")  # fmt: skip
    assert drive.next_jump(0.0) == (inf if pot == 0 else 1023 / 1024 / 2 / PWM)
    assert pin(drive, 0.3) in (0.0, 3.3)


@pytest.mark.slow
def test_pwm_edges_do_not_stand_beside_those_of_the_staircase() -> None:
    # every 25 periods an edge meets one of the 50 us steps, within rounding
    drive = made("drive.pwm_ripple=true", "drive.pot_max=1", "drive.pot_offset=0.2442",
                 "drive.frequency=20", "drive.quantised=true", "circuit.model=full")  # fmt: skip
    gaps, both, t = [], 0, 0.0
    while t < 3.0:
        before, t = t, drive.next_jump(t)
        gaps.append(t - before)
        both += pin_before(drive, t) != pin(drive, t) and (
            v_dac_before(drive, t) != v_dac(drive, t)
        )
    assert min(gaps) > 1e-9
    assert both > 50


@given(code=st.integers(1, 1023), inner=st.sampled_from(["sawtooth", "square", "staircase"]),
       t=st.floats(0, 1e4))  # fmt: skip
def test_pwm_edges_are_exact(code: int, inner: str, t: float) -> None:
    mean = code / 1024 * 3.3
    command: Command = {
        "sawtooth": Sawtooth(20.0, 8.0, -1.2),
        "square": square(31.7, 8.0, -1.2),
        "staircase": Staircase(staircase(778, 20.0), mean),
    }[inner]
    command.v_offset = mean
    drive, fresh = WithPwm(command), WithPwm(command)
    for _ in range(5):
        jump = drive.next_jump(t)
        assert jump > t
        old, new = pin_before(drive, jump), pin(drive, jump)
        assert old != new or value_before(drive, jump) != drive.value(jump)
        left, right = nextafter(jump, -inf), nextafter(jump, inf)
        assert pin(drive, left) == pin_before(drive, left) == old
        assert pin(drive, right) == pin_before(drive, right) == new
        assert {old, new} <= {0.0, 3.3}
        assert drive.next_jump(left) == jump
        assert pin(fresh, t) == pin(drive, t)  # whatever was asked before
        t = jump


# --- a second surface's command ---------------------------------------------------------------


def test_a_lagging_command_is_the_other_one_later() -> None:
    every = ["drive.frequency=20", "drive.phase_deg=90"]
    first, second = commands(
        load("two-surfaces", ["drive.amplitude=8", "drive.offset=-1.2", *every])
    )
    times = np.linspace(1e-5, 0.3, 997)
    np.testing.assert_allclose(second.values(times + 0.0125), first.values(times), atol=1e-9)
    assert second.next_jump(0.0) == 0.0125
    assert (value_before(second, 0.0125), second.value(0.0125)) == pytest.approx((2.8, -5.2))
    assert len(commands(load("reference"))) == 1


@pytest.mark.parametrize(("start", "phase"), [(0.0, 0.0), (0.0, 0.1), (0.03, 0.0), (0.03, 0.6)])
def test_both_commands_are_switched_on_at_once(start: float, phase: float) -> None:
    """The second is 0 V before, and from then on a quarter of a period behind the first."""
    keys = [f"drive.start_time={start}", f"drive.start_phase={phase}", "drive.phase_deg=90"]
    _, second = commands(load("two-surfaces", [*keys, "drive.amplitude=8", "drive.offset=-1.2"]))
    for t in np.linspace(1e-4, 0.2, 399):
        cycles = (t - start) * 20.0 + phase - 0.25
        expected = -1.2 + 8.0 * (cycles % 1.0 - 0.5) if t >= start else 0.0
        assert second.value(t) == pytest.approx(expected, abs=1e-9)


def test_a_staircase_lags_by_a_share_of_its_own_period() -> None:
    staircase_of = ["drive.quantised=true", "drive.phase_deg=180"]
    first, second = commands(load("two-surfaces", staircase_of))
    assert isinstance(first, Staircase)
    times = np.linspace(1e-5, 0.1, 333)
    late = second.values(times + 0.5 * first.period)
    np.testing.assert_allclose(late, first.values(times), atol=1e-9)


# --- everything at once -----------------------------------------------------------------------

FREQUENCY = st.floats(0.5, 2000)
AMPLITUDE = st.floats(0.1, 10)
OFFSET = st.floats(-5, 5)


def evenly(levels: list[float]) -> list[tuple[float, float]]:
    return [(k / len(levels), level) for k, level in enumerate(levels)]


COMMANDS = st.one_of(
    st.builds(Sawtooth, FREQUENCY, AMPLITUDE, OFFSET),
    st.builds(lambda f, a, o, r: Sawtooth(f, a, o, r / f), FREQUENCY, AMPLITUDE, OFFSET,
              st.floats(1e-3, 0.9)),
    st.builds(Sine, FREQUENCY, AMPLITUDE, OFFSET),
    st.builds(square, FREQUENCY, AMPLITUDE, OFFSET, st.floats(0.01, 0.99)),
    st.builds(lambda f, a, o, levels: Lines(f, a, o, held(evenly(levels))), FREQUENCY, AMPLITUDE,
              OFFSET, st.lists(st.sampled_from([-0.5, -0.1, 0.3, 0.5]), min_size=2, max_size=9)),
    st.builds(lambda m, f, v: Staircase(staircase(m, f), v), st.integers(0, 1023), FREQUENCY,
              st.floats(0, 3.3)),
    st.builds(lambda f, a, o, lag: Lagging(square(f, a, o), lag / f), FREQUENCY, AMPLITUDE, OFFSET,
              st.floats(0, 1)),
)  # fmt: skip
TIME = st.floats(0, 1e4)


def steepest(drive: Command) -> float:
    """Largest |dV1/dt| apart from jumps, V/s."""
    if isinstance(drive, Sine):
        return pi * drive.amplitude * drive.frequency
    if isinstance(drive, Sawtooth):
        rise = 1 / drive.frequency - drive.reset_time
        return drive.amplitude / min(rise, drive.reset_time or rise)
    return 0.0


@given(drive=COMMANDS, t=TIME)
@example(drive=Sawtooth(20.0, 8.0, -1.2), t=50.0)
@example(drive=Sawtooth(0.1 + 0.2, 8.0, -1.2), t=1e4)
def test_jumps_are_exact(drive: Command, t: float) -> None:
    for _ in range(5):
        jump = drive.next_jump(t)
        assert jump > t
        assert t < drive.piece(t).until <= jump
        if jump == inf:
            return
        left, right = nextafter(jump, -inf), nextafter(jump, inf)
        old, new = value_before(drive, jump), drive.value(jump)
        assert old != new
        slack = 1e-9 + 4 * steepest(drive) * (right - left)
        assert drive.value(left) == pytest.approx(old, abs=slack)
        assert value_before(drive, left) == drive.value(left)
        assert drive.value(right) == pytest.approx(new, abs=slack)
        assert value_before(drive, right) == drive.value(right)
        assert drive.next_jump(left) == jump
        assert drive.next_jump(jump) > right
        t = jump


@given(drive=COMMANDS, t=TIME, share=st.floats(0, 1))
def test_smooth_between_corners(drive: Command, t: float, share: float) -> None:
    end = drive.piece(t).until
    end = min(end, t + 0.01)
    late = min(t + share * (end - t), nextafter(end, -inf))
    if isinstance(drive, Sawtooth):
        middle = drive.value(0.5 * (t + late))
        slack = 1e-9 + 1e-9 * steepest(drive) * t
        mean = 0.5 * (drive.value(t) + drive.value(late))
        assert middle == pytest.approx(mean, abs=slack)
    elif isinstance(drive, Sine):
        change = abs(drive.value(late) - drive.value(t))
        assert change <= 1e-9 + steepest(drive) * (late - t) * 1.001
    else:
        assert drive.value(late) == drive.value(t)


@given(drive=COMMANDS, times=st.lists(st.floats(-0.02, 0.02), max_size=9), ripple=st.booleans())
def test_values_are_those_of_each_time(drive: Command, times: list[float], ripple: bool) -> None:
    edge = drive.next_jump(0.0)
    times = sorted([*times, *(t for t in (edge, nextafter(edge, -inf)) if t < 0.05)])
    made = WithPwm(drive) if ripple else drive
    expected = [drive.value(t) for t in times]
    assert made.values(times) == pytest.approx(expected, rel=1e-15, abs=1e-15)


@given(drive=COMMANDS, t=TIME)
def test_pins_make_the_command(drive: Command, t: float) -> None:
    assert GAIN * (drive.v_offset - v_dac(drive, t)) == pytest.approx(drive.value(t), abs=1e-9)
    before = GAIN * (drive.v_offset - v_dac_before(drive, t))
    assert before == pytest.approx(value_before(drive, t), abs=1e-9)
    assert v_dac(drive, t) >= -1e-9


@pytest.mark.parametrize("frequency", [20.0, 50.8, 1 / 3, 21.37])
def test_no_drift_after_many_periods(frequency: float) -> None:
    drive = Sawtooth(frequency, 8.0, -1.2)
    t = 0.0
    for n in range(1, 2001):
        t = drive.next_jump(t)
        assert t == n / frequency
    late = float(Fraction(100_000) / Fraction(frequency) + Fraction(1, 4) / Fraction(frequency))
    assert drive.value(late) == pytest.approx(-3.2, abs=1e-6)


@given(start=st.floats(0.0, 0.2), phase=st.floats(0.0, 1.0), t=st.floats(0.0, 0.4))
@example(start=0.1, phase=0.0, t=0.1)
@example(start=0.0, phase=0.25, t=0.0)
def test_a_drive_that_is_switched_on(start: float, phase: float, t: float) -> None:
    """0 V before; from then on the sawtooth, with a share of its period gone by."""
    drive = made(f"drive.start_time={start!r}", f"drive.start_phase={phase!r}")
    if t < start:
        assert drive.value(t) == 0.0
        assert t < drive.next_jump(t) <= start
        return
    cycles = (t - start) * 20.0 + phase
    if abs(cycles - round(cycles)) > 1e-9:
        assert drive.value(t) == pytest.approx(-1.2 + 8.0 * (cycles % 1.0 - 0.5), abs=1e-9)
    following = (floor(cycles) + 1.0 - phase) / 20.0 + start
    if abs(cycles - round(cycles)) > 1e-9:
        assert drive.next_jump(t) == pytest.approx(following, abs=1e-12)
    assert v_dac(drive, t) == pytest.approx(drive.v_offset - drive.value(t) / GAIN, abs=1e-9)


@pytest.mark.parametrize("model", ["ideal", "limited"])
def test_a_sine_that_starts_late_is_zero_before(model: str) -> None:
    """Nothing drives the coil before, and at rest the mechanics do not either."""
    late = {"drive.waveform": "sine", "drive.start_time": 0.05, "circuit.model": model}
    rows = cosim.run("reference", late | {"run.duration": 0.15, "run.settle": 0.05}).waveforms
    before = rows.sel(time=slice(0.0, 0.0499))
    assert abs(before.command).max() == abs(before.current).max() == 0.0
    assert abs(rows.current).max() > 0.1
