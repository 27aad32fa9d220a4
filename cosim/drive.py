"""The command V1(t) at the power amplifier's input, with its jumps known to the last bit.

Every command is periodic and right-continuous: at a jump ``value`` is the new value and
``value_before`` the old one. The n-th edge stands at the float ``n / frequency`` (one rounding,
whatever n is), and every other function decides by comparing with that float. So nothing drifts,
and a solver that lands on a time from ``next_jump`` sees the jump exactly there.

All commands also stand behind the difference amplifier of the full circuit, whose netlist takes
the voltages of the DAC and of the offset pin: V1 = GAIN (v_offset - v_dac). The offset pin is held
where the highest command needs V_DAC = 0.
"""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable
from math import cos, floor, inf, pi, sin

import numpy as np
import numpy.typing as npt

from cosim.firmware import (
    GAIN,
    STEPS_PER_SECOND,
    nearest_code,
    offset_pin,
    staircase,
    volts,
)
from cosim.scene import Scene


class Command(ABC):
    """V1 in V over time in s; continued periodically to times before 0."""

    v_offset: float
    """Voltage of the offset pin, V."""

    longest_straight: float = inf
    """Between corners the command is a straight line, or near enough over this time, s."""

    @abstractmethod
    def value(self, t: float) -> float:
        """V1 at ``t``, V; at a jump the value after it."""

    @abstractmethod
    def value_before(self, t: float) -> float:
        """Left limit of V1 at ``t``, V; differs from ``value`` at jumps only."""

    @abstractmethod
    def slope(self, t: float) -> float:
        """Right derivative of V1 at ``t``, V/s."""

    @abstractmethod
    def next_jump(self, t: float) -> float:
        """Time of the first discontinuity strictly after ``t``, s; inf if there is none."""

    def next_corner(self, t: float) -> float:
        """Time of the first jump of V1 or of its slope strictly after ``t``, s."""
        return self.next_jump(t)

    def values(self, times: Iterable[float]) -> npt.NDArray[np.float64]:
        """V1 at each of ``times``, V."""
        value = self.value
        return np.array([value(float(t)) for t in times], dtype=np.float64)

    def v_dac(self, t: float) -> float:
        """Voltage of the DAC at ``t``, V."""
        return self.v_offset - self.value(t) / GAIN

    def v_dac_before(self, t: float) -> float:
        """Left limit of the DAC's voltage at ``t``, V."""
        return self.v_offset - self.value_before(t) / GAIN


def _edge_before(t: float, rate: float) -> int:
    """The n of the last edge ``n / rate`` (as a float) at or before ``t``."""
    n = floor(t * rate)
    if (n + 1) / rate <= t:
        return n + 1
    return n - 1 if n / rate > t else n


class Constant(Command):
    """A command that never changes: ``level`` in V."""

    def __init__(self, level: float = 0.0) -> None:
        self.level = level
        self.v_offset = level / GAIN

    def value(self, t: float) -> float:
        return self.level

    def value_before(self, t: float) -> float:
        return self.level

    def slope(self, t: float) -> float:
        return 0.0

    def next_jump(self, t: float) -> float:
        return inf


class Sawtooth(Command):
    """V1 = offset + amplitude (t/T - 1/2) on [0, T), then a sharp fall.

    With ``reset_time`` the rise takes T - reset_time and a linear fall the rest of the period;
    the peak-to-peak voltage stays ``amplitude``.
    """

    def __init__(
        self, frequency: float, amplitude: float, offset: float, reset_time: float = 0.0
    ) -> None:
        self.frequency = frequency
        self.amplitude = amplitude
        self.offset = offset
        self.reset_time = reset_time
        self.v_offset = offset_pin(offset, amplitude)
        self._fall = reset_time * frequency
        self._rise = 1.0 - self._fall
        self._jumps = amplitude != 0.0 and reset_time == 0.0

    def value(self, t: float) -> float:
        f = self.frequency
        n = _edge_before(t, f)
        phase = (t - n / f) * f
        if self._fall and t >= (n + self._rise) / f:
            shape = min(max((1.0 - phase) / self._fall, 0.0), 1.0)
        else:
            shape = min(phase / self._rise, 1.0)
        return self.offset + self.amplitude * (shape - 0.5)

    def value_before(self, t: float) -> float:
        f = self.frequency
        if self._jumps and t == _edge_before(t, f) / f:
            return self.offset + 0.5 * self.amplitude
        return self.value(t)

    def slope(self, t: float) -> float:
        f = self.frequency
        if self._fall and t >= (_edge_before(t, f) + self._rise) / f:
            return -self.amplitude / self.reset_time
        return self.amplitude * f / self._rise

    def next_jump(self, t: float) -> float:
        if not self._jumps:
            return inf
        return (_edge_before(t, self.frequency) + 1) / self.frequency

    def next_corner(self, t: float) -> float:
        f = self.frequency
        n = _edge_before(t, f)
        peak = (n + self._rise) / f
        return peak if t < peak else (n + 1) / f


class Sine(Command):
    """V1 = offset + amplitude/2 sin(2 pi f t)."""

    def __init__(self, frequency: float, amplitude: float, offset: float) -> None:
        self.frequency = frequency
        self.amplitude = amplitude
        self.offset = offset
        self.v_offset = offset_pin(offset, amplitude)
        self.longest_straight = 1e-3 / frequency  # within 5e-6 of the amplitude

    def _angle(self, t: float) -> float:
        f = self.frequency
        return 2 * pi * (t - _edge_before(t, f) / f) * f

    def value(self, t: float) -> float:
        return self.offset + 0.5 * self.amplitude * sin(self._angle(t))

    def value_before(self, t: float) -> float:
        return self.value(t)

    def slope(self, t: float) -> float:
        return pi * self.frequency * self.amplitude * cos(self._angle(t))

    def next_jump(self, t: float) -> float:
        return inf


class Square(Command):
    """V1 = offset + amplitude/2 in the first half of each period, offset - amplitude/2 after."""

    def __init__(self, frequency: float, amplitude: float, offset: float) -> None:
        self.frequency = frequency
        self.amplitude = amplitude
        self.offset = offset
        self.v_offset = offset_pin(offset, amplitude)
        self._rate = 2 * frequency

    def _level(self, half: int) -> float:
        return self.offset + self.amplitude * (-0.5 if half % 2 else 0.5)

    def value(self, t: float) -> float:
        return self._level(_edge_before(t, self._rate))

    def value_before(self, t: float) -> float:
        half = _edge_before(t, self._rate)
        return self._level(half - 1 if t == half / self._rate else half)

    def slope(self, t: float) -> float:
        return 0.0

    def next_jump(self, t: float) -> float:
        return (_edge_before(t, self._rate) + 1) / self._rate if self.amplitude else inf


class Staircase(Command):
    """The firmware's sawtooth: a DAC code each 50 us, and a 10-bit code at the offset pin.

    ``codes`` is one period of DAC codes, ``v_offset`` the offset pin in V; see
    :mod:`cosim.firmware` for where they come from.
    """

    def __init__(self, codes: tuple[int, ...], v_offset: float) -> None:
        self.codes = codes
        self.v_offset = v_offset
        self.period = len(codes) / STEPS_PER_SECOND
        """What the period has become, s."""
        self._levels = tuple(GAIN * (v_offset - volts(code)) for code in codes)
        self._edges = [k for k in range(len(codes)) if codes[k] != codes[k - 1]]

    def value(self, t: float) -> float:
        return self._levels[_edge_before(t, STEPS_PER_SECOND) % len(self._levels)]

    def _step_before(self, t: float) -> int:
        step = _edge_before(t, STEPS_PER_SECOND)
        return step - 1 if t == step / STEPS_PER_SECOND else step

    def value_before(self, t: float) -> float:
        return self._levels[self._step_before(t) % len(self._levels)]

    def slope(self, t: float) -> float:
        return 0.0

    def next_jump(self, t: float) -> float:
        if not self._edges:
            return inf
        count = len(self.codes)
        period, step = divmod(_edge_before(t, STEPS_PER_SECOND), count)
        place = bisect_right(self._edges, step)
        if place == len(self._edges):
            period, place = period + 1, 0
        return (period * count + self._edges[place]) / STEPS_PER_SECOND

    def v_dac(self, t: float) -> float:
        return volts(self.codes[_edge_before(t, STEPS_PER_SECOND) % len(self.codes)])

    def v_dac_before(self, t: float) -> float:
        return volts(self.codes[self._step_before(t) % len(self.codes)])


def command(scene: Scene) -> Command:
    """The command of a scene; 0 V for ever where its circuit is "none"."""
    drive = scene.drive
    if scene.circuit.model == "none":
        return Constant()
    if drive.quantised:
        codes = staircase(nearest_code(drive.amplitude / GAIN), drive.frequency)
        pin = nearest_code(offset_pin(drive.offset, drive.amplitude))
        return Staircase(codes, volts(pin))
    if drive.waveform == "sawtooth":
        return Sawtooth(drive.frequency, drive.amplitude, drive.offset, drive.reset_time)
    shape = {"sine": Sine, "square": Square}[drive.waveform]
    return shape(drive.frequency, drive.amplitude, drive.offset)
