"""The sawtooth source of the device: a Teensy 3.6 and the difference amplifier behind it.

Sources: the driver's schematic (rev 1.0), its firmware, and the Teensy core library, which writes
a 10-bit code into the upper bits of the 12-bit DAC and compares a 10-bit PWM value with 1024; so a
code c stands for 3.3 V · c/1024 at either pin.

The firmware's counter starts at the maximum code, falls every 50 µs by ``maximum · f · 50 µs``, is
truncated when written, and starts again in the step in which it has reached zero or less. So the
period is 1/f rounded **up** to whole steps. Assumed here: steps of exactly 50 µs and exact
arithmetic (in the firmware's single precision a code or a step differs now and then). The code 0
that the firmware writes for one pass of its loop before the maximum is left out.

The real steps are longer: the firmware looks at its clock once a pass of ``loop()``
(:func:`passes`). A pass reads three potentiometers, each by four conversions of 20 + 2 cycles and 3
more at 15 MHz, 6.2 µs by the core library's settings; at 12 bits, where the same sum gives 7.2 µs,
8 µs were measured (forum.pjrc.com, thread 57683). With 1 to 2 µs assumed for the rest a pass takes
about 22 µs, a step three of them, and the real frequency is three quarters of the commanded one.
Nobody has published a measurement; hence a parameter, and the plain 50 µs without it.
"""

from collections.abc import Callable
from fractions import Fraction
from math import ceil

V_REFERENCE = 3.3
"""Full scale of the DAC and of the offset pin, V."""
COUNTS = 1024
"""Counts of a 10-bit converter; codes run from 0 to ``COUNTS - 1``."""
STEPS_PER_SECOND = 20_000
"""The firmware's decrements a second: one every 50 µs."""
PWM_FREQUENCY = 488.28125
"""The offset pin's PWM, Hz: 60 MHz / 2 / 61440, what analogWrite sets up at 180 MHz."""
GAIN = 15.0 / 4.7
"""Difference amplifier: V1 = GAIN (V_offset - V_DAC), from R2 = R3 = 4.7 kΩ, R4 = R5 = 15 kΩ."""


def reading(pot: float) -> int:
    """The 10-bit reading, 0…1023, of a linear potentiometer at ``pot`` in 0…1."""
    return min(COUNTS - 1, int(pot * COUNTS))


def volts(code: int) -> float:
    """Voltage of a 10-bit code at the DAC or, as a mean, at the offset pin, V."""
    return V_REFERENCE * code / COUNTS


def nearest_code(voltage: float) -> int:
    """The 10-bit code nearest to ``voltage`` in V, within 0…1023."""
    return max(0, min(COUNTS - 1, round(voltage / V_REFERENCE * COUNTS)))


def knob_amplitude(pot_max: float) -> float:
    """Peak-to-peak voltage at V1, V, of the first knob, which sets the DAC's maximum code."""
    return GAIN * volts(reading(pot_max))


def knob_frequency(pot_frequency: float) -> float:
    """Commanded frequency, Hz, of the second knob: 100 Hz at 0, just above 1 Hz at 1."""
    return (1 - reading(pot_frequency) / COUNTS) * 99 + 1


def knob_offset(pot_offset: float, amplitude: float) -> float:
    """Mean of V1, V, of the third knob, which sets the offset pin, where the ramp ends (V_DAC = 0);
    ``amplitude`` is peak-to-peak, V."""
    return GAIN * volts(reading(pot_offset)) - amplitude / 2


def knobs(amplitude: float, frequency: float, offset: float) -> dict[str, float]:
    """The three potentiometers whose readings come nearest to a drive (V, Hz, V); beyond 0…1 where
    no reading does."""
    shares = {
        "pot_max": amplitude / GAIN / V_REFERENCE,
        "pot_frequency": 1 - (frequency - 1) / 99,
        "pot_offset": offset_pin(offset, amplitude) / V_REFERENCE,
    }
    return {knob: (round(share * COUNTS) + 0.5) / COUNTS for knob, share in shares.items()}


def offset_pin(offset: float, amplitude: float) -> float:
    """Voltage at the offset pin, V, for a mean ``offset`` and peak-to-peak ``amplitude`` at V1."""
    return (offset + amplitude / 2) / GAIN


def staircase(maximum: int, frequency: float) -> tuple[int, ...]:
    """The DAC codes of one period, one each 50 µs, for a commanded ``frequency`` in Hz."""
    share = Fraction(frequency) / STEPS_PER_SECOND  # of a period, that a step takes
    p, q = share.as_integer_ratio()  # step k has the code maximum · (1 - k p/q)
    return tuple(maximum * (q - k * p) // q for k in range(_steps(frequency)))


def _steps(frequency: float) -> int:
    """The number of steps of 50 µs in a period."""
    return ceil(STEPS_PER_SECOND / Fraction(frequency))


def sampled(share: Callable[[float], float], maximum: int, frequency: float) -> tuple[int, ...]:
    """The DAC codes of one period of any shape, as many as :func:`staircase` has: the nearest ones
    to ``share`` (of ``maximum``) at the beginning of each 50 µs step, s."""
    times = (k / STEPS_PER_SECOND for k in range(_steps(frequency)))
    return tuple(round(maximum * share(t)) for t in times)


def period(frequency: float, loop_time: float | None) -> float:
    """The period, s, for a commanded ``frequency`` (Hz): of the staircase in steps of 50 µs, or,
    with a ``loop_time`` (s), in passes of the loop."""
    steps = _steps(frequency)
    if not loop_time:
        return steps / STEPS_PER_SECOND
    first, each = _lasting(loop_time)
    return (first + (steps - 1) * each + 1) * loop_time


def _lasting(loop_time: float) -> tuple[int, int]:
    """The passes of the loop for which the first code of a period stays, and each later one."""
    each = ceil(round(1 / (STEPS_PER_SECOND * loop_time), 9))  # exact quotients stay whole
    return max(2, each - 1), each


def passes(codes: tuple[int, ...], loop_time: float) -> tuple[int, ...]:
    """The DAC codes of one period, one each pass of a loop of ``loop_time`` in s.

    ``codes`` are those of :func:`staircase`. A step is the fewest passes that take 50 µs. The
    maximum is written one pass after the code 0. In the next pass the counter is set to it; the
    first decrement comes later, once a step has passed since the code 0.
    """
    first, each = _lasting(loop_time)
    falling = (code for code in codes[1:] for _ in range(each))
    return (*(codes[0],) * first, *falling, 0)
