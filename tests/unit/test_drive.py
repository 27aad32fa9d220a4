"""The command V1(t): shapes, exact jumps, no drift, and the firmware's staircase."""

from fractions import Fraction
from math import inf, nextafter, pi

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cosim.drive import Command, Constant, Sawtooth, Sine, Square, Staircase, command
from cosim.firmware import staircase
from cosim.scene import load

GAIN = 15 / 4.7


def made(*overrides: str, scene: str = "paper") -> Command:
    return command(load(scene, overrides))


@pytest.mark.parametrize(
    ("t", "v1"), [(0.0, -5.2), (0.0125, -3.2), (0.025, -1.2), (0.049, 2.64), (0.05, -5.2)]
)
def test_paper_sawtooth(t: float, v1: float) -> None:
    drive = made()
    assert drive.value(t) == pytest.approx(v1)
    assert drive.slope(t) == pytest.approx(160.0)


def test_paper_sawtooth_jumps() -> None:
    drive = made()
    assert drive.next_jump(0.0) == 0.05
    assert drive.value_before(0.05) == pytest.approx(2.8)
    assert drive.value_before(0.03) == drive.value(0.03)
    assert drive.next_corner(0.01) == 0.05


def test_slow_reset() -> None:
    drive = made("drive.reset_time=0.01")
    times = [0.0, 0.02, 0.04, 0.045, 0.05]
    assert drive.values(times) == pytest.approx([-5.2, -1.2, 2.8, -1.2, -5.2])
    assert drive.next_jump(0.0) == inf
    assert [drive.next_corner(t) for t in (0.0, 0.04, 0.05)] == pytest.approx([0.04, 0.05, 0.09])
    assert drive.slope(0.0) == pytest.approx(200.0)
    assert drive.slope(0.041) == pytest.approx(-800.0)


def test_sine() -> None:
    drive = made("drive.waveform=sine")
    assert drive.values([0, 0.0125, 0.025, 0.0375]) == pytest.approx([-1.2, 2.8, -1.2, -5.2])
    assert drive.slope(0.0) == pytest.approx(4 * 2 * pi * 20)
    assert drive.next_jump(0.0) == inf
    assert drive.value(1000 * 0.05 + 0.0125) == pytest.approx(2.8, abs=1e-12)


def test_square() -> None:
    drive = made("drive.waveform=square")
    assert drive.values([0, 0.0249, 0.025, 0.0499]) == pytest.approx([2.8, 2.8, -5.2, -5.2])
    assert drive.next_jump(0.0) == 0.025
    assert drive.next_jump(0.025) == 0.05
    assert drive.value_before(0.05) == pytest.approx(-5.2)
    assert drive.value_before(0.0) == pytest.approx(-5.2)


def test_no_drive() -> None:
    drive = made(scene="held")
    assert isinstance(drive, Constant)
    assert (drive.value(0.3), drive.slope(0.3), drive.next_jump(0.0)) == (0.0, 0.0, inf)


@pytest.mark.parametrize("waveform", ["sawtooth", "square"])
def test_no_amplitude_no_jump(waveform: str) -> None:
    drive = made(f"drive.waveform={waveform}", "drive.amplitude=0")
    assert drive.next_jump(0.0) == inf
    assert drive.value(0.05) == drive.value_before(0.05) == -1.2


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
    falls = [t for t in jumps if drive.value(t) < drive.value_before(t)]
    assert np.diff(falls) == pytest.approx(drive.period)


def test_staircase_of_the_paper() -> None:
    drive = made(scene="paper-full")
    # by hand: 8 V / 3.1915 = 2.5067 V -> code 778; offset pin 2.8 V / 3.1915 -> code 272
    assert drive.v_dac(0.0) == pytest.approx(778 / 1024 * 3.3)
    assert drive.v_offset == pytest.approx(272 / 1024 * 3.3)
    assert drive.value(0.0) == pytest.approx(GAIN * (272 - 778) / 1024 * 3.3)
    # after k steps the counter has lost 0.778 k and is truncated
    assert drive.v_dac(10.5 * 50e-6) == pytest.approx(770 / 1024 * 3.3)
    assert drive.next_jump(0.0) == 50e-6
    assert drive.v_dac_before(50e-6) == drive.v_dac(0.0)
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
    drive = made("drive.pot_max=0.7", "drive.pot_offset=0.4", scene="paper-full")
    assert drive.v_dac(0.0) == pytest.approx(716 / 1024 * 3.3)
    assert drive.v_offset == pytest.approx(409 / 1024 * 3.3)


# --- everything at once -----------------------------------------------------------------------

FREQUENCY = st.floats(0.5, 2000)
AMPLITUDE = st.floats(0.1, 10)
OFFSET = st.floats(-5, 5)
COMMANDS = st.one_of(
    st.builds(Sawtooth, FREQUENCY, AMPLITUDE, OFFSET),
    st.builds(lambda f, a, o, r: Sawtooth(f, a, o, r / f), FREQUENCY, AMPLITUDE, OFFSET,
              st.floats(1e-3, 0.9)),
    st.builds(Sine, FREQUENCY, AMPLITUDE, OFFSET),
    st.builds(Square, FREQUENCY, AMPLITUDE, OFFSET),
    st.builds(lambda m, f, v: Staircase(staircase(m, f), v), st.integers(0, 1023), FREQUENCY,
              st.floats(0, 3.3)),
)  # fmt: skip
TIME = st.floats(0, 1e4)


@given(drive=COMMANDS, t=TIME)
@example(drive=Sawtooth(20.0, 8.0, -1.2), t=50.0)
@example(drive=Sawtooth(0.1 + 0.2, 8.0, -1.2), t=1e4)
def test_jumps_are_exact(drive: Command, t: float) -> None:
    for _ in range(5):
        jump = drive.next_jump(t)
        assert jump > t
        assert t < drive.next_corner(t) <= jump
        if jump == inf:
            return
        left, right = nextafter(jump, -inf), nextafter(jump, inf)
        old, new = drive.value_before(jump), drive.value(jump)
        assert old != new
        slack = 1e-9 + 4 * abs(drive.slope(left)) * (right - left)
        assert drive.value(left) == pytest.approx(old, abs=slack)
        assert drive.value_before(left) == drive.value(left)
        assert drive.value(right) == pytest.approx(new, abs=slack)
        assert drive.value_before(right) == drive.value(right)
        assert drive.next_jump(left) == jump
        assert drive.next_jump(jump) > right
        t = jump


@given(drive=COMMANDS, t=TIME, share=st.floats(0, 1))
def test_smooth_between_corners(drive: Command, t: float, share: float) -> None:
    end = drive.next_corner(t)
    end = min(end, t + 0.01)
    late = min(t + share * (end - t), nextafter(end, -inf))
    steepest = getattr(drive, "amplitude", 0.0) * getattr(drive, "frequency", 0.0) * pi
    if isinstance(drive, Sawtooth):
        expected = drive.value(t) + drive.slope(t) * (late - t)
        slack = 1e-9 + 1e-9 * abs(drive.slope(t)) * t
        assert drive.value(late) == pytest.approx(expected, abs=slack)
    elif isinstance(drive, Sine):
        assert abs(drive.value(late) - drive.value(t)) <= 1e-9 + steepest * (late - t) * 1.001
    else:
        assert drive.value(late) == drive.value(t)


@given(drive=COMMANDS, t=TIME)
def test_pins_make_the_command(drive: Command, t: float) -> None:
    assert GAIN * (drive.v_offset - drive.v_dac(t)) == pytest.approx(drive.value(t), abs=1e-9)
    before = GAIN * (drive.v_offset - drive.v_dac_before(t))
    assert before == pytest.approx(drive.value_before(t), abs=1e-9)
    assert drive.v_dac(t) >= -1e-9


@pytest.mark.parametrize("frequency", [20.0, 50.8, 1 / 3, 21.37])
def test_no_drift_after_many_periods(frequency: float) -> None:
    drive = Sawtooth(frequency, 8.0, -1.2)
    t = 0.0
    for n in range(1, 2001):
        t = drive.next_jump(t)
        assert t == n / frequency
    late = float(Fraction(100_000) / Fraction(frequency) + Fraction(1, 4) / Fraction(frequency))
    assert drive.value(late) == pytest.approx(-3.2, abs=1e-6)
