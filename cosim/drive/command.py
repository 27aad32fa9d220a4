"""The command V1(t) at the power amplifier's input, with its jumps known to the last bit.

Every command is periodic and right-continuous: at a jump ``value`` is the new value and
``value_before`` the old one. The n-th edge stands at the float ``n / frequency`` (one rounding,
whatever n is), and every other function decides by comparing with that float. So nothing drifts,
and a solver that lands on a time from ``next_jump`` sees the jump exactly there.

All commands also stand behind the difference amplifier of the full circuit, whose netlist takes
the voltages of the DAC and of the offset pin: V1 = GAIN (v_offset - v_dac). The offset pin is held
where the highest command needs V_DAC = 0. In truth it is a PWM, of which ``v_offset`` is the mean.
"""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable
from math import floor, inf, nextafter, pi, sin
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.scene import Scene
from cosim.scene.firmware import (
    GAIN,
    PWM_FREQUENCY,
    STEPS_PER_SECOND,
    V_REFERENCE,
    nearest_code,
    offset_pin,
    passes,
    staircase,
    volts,
)

LEVEL, RISE, FALL, SINE = range(4)
"""Kinds of pieces; ``native/circuit.c`` has the same."""


class Piece(NamedTuple):
    """The command from some time until ``until`` (s), as the compiled coupling evaluates it.

    With the phase (t - origin) rate, V1 is ``offset`` for a level, offset + amplitude/2
    sin(2π phase) for a sine, and else offset + amplitude (shape - 1/2) with the shape phase / span
    in a rise and (1 - phase) / span in a fall, kept within 0 and 1. Times in s, rate in Hz, V.
    """

    until: float
    kind: int
    offset: float
    amplitude: float = 0.0
    origin: float = 0.0
    rate: float = 0.0
    span: float = 1.0


class Command(ABC):
    """V1 in V over time in s; continued periodically to times before 0."""

    v_offset: float
    """Mean voltage of the offset pin, V."""

    longest_straight: float = inf
    """Between corners the command is a straight line, or near enough over this time, s."""

    @abstractmethod
    def value(self, t: float) -> float:
        """V1 at ``t``, V; at a jump the value after it."""

    @abstractmethod
    def value_before(self, t: float) -> float:
        """Left limit of V1 at ``t``, V; differs from ``value`` at jumps only."""

    @abstractmethod
    def next_jump(self, t: float) -> float:
        """Time of the first discontinuity of V1 or of a pin strictly after ``t``, s, or inf."""

    @abstractmethod
    def piece(self, t: float) -> Piece:
        """The piece that holds at ``t``."""

    def next_corner(self, t: float) -> float:
        """Time of the first such jump or jump of V1's slope strictly after ``t``, s."""
        return self.next_jump(t)

    def values(self, times: Iterable[float]) -> npt.NDArray[np.float64]:
        """V1 at each of ``times``, V."""
        at = np.array(list(times) if not isinstance(times, np.ndarray) else times, np.float64)
        begin, last = (float(at.min()), float(at.max())) if at.size else (inf, inf)
        pieces = []
        while begin <= last < inf:
            pieces.append(self.piece(begin))
            begin = pieces[-1].until
        if not pieces:
            return at
        columns = [np.array(column) for column in zip(*pieces, strict=True)]
        place = np.searchsorted(columns[0], at, side="right")
        kind, offset, amplitude, origin, rate, span = (column[place] for column in columns[1:])
        phase = (at - origin) * rate
        shape = np.where(kind == RISE, phase / span, np.maximum((1.0 - phase) / span, 0.0))
        ramp = offset + amplitude * (np.minimum(shape, 1.0) - 0.5)
        sine = offset + 0.5 * amplitude * np.sin(2 * pi * (at - origin) * rate)
        return np.select([kind == LEVEL, kind == SINE], [offset, sine], ramp)

    def v_dac(self, t: float) -> float:
        """Voltage of the DAC at ``t``, V."""
        return self.v_offset - self.value(t) / GAIN

    def v_dac_before(self, t: float) -> float:
        """Left limit of the DAC's voltage at ``t``, V."""
        return self.v_offset - self.value_before(t) / GAIN

    def v_offset_at(self, t: float) -> float:
        """Voltage of the offset pin at ``t``, V; at a jump the voltage after it."""
        return self.v_offset

    def v_offset_before(self, t: float) -> float:
        """Left limit of the offset pin's voltage at ``t``, V."""
        return self.v_offset


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

    def next_jump(self, t: float) -> float:
        return inf

    def piece(self, t: float) -> Piece:
        return Piece(inf, LEVEL, self.level)


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

    def _falls(self, t: float, n: int) -> bool:
        return self._fall > 0.0 and t >= (n + self._rise) / self.frequency

    def value(self, t: float) -> float:
        f = self.frequency
        n = _edge_before(t, f)
        phase = (t - n / f) * f
        if self._falls(t, n):
            shape = min(max((1.0 - phase) / self._fall, 0.0), 1.0)
        else:
            shape = min(phase / self._rise, 1.0)
        return self.offset + self.amplitude * (shape - 0.5)

    def value_before(self, t: float) -> float:
        f = self.frequency
        if self._jumps and t == _edge_before(t, f) / f:
            return self.offset + 0.5 * self.amplitude
        return self.value(t)

    def next_jump(self, t: float) -> float:
        if not self._jumps:
            return inf
        return (_edge_before(t, self.frequency) + 1) / self.frequency

    def piece(self, t: float) -> Piece:
        f = self.frequency
        n = _edge_before(t, f)
        kind, span = (FALL, self._fall) if self._falls(t, n) else (RISE, self._rise)
        until = (n + self._rise) / f if self._fall and kind == RISE else (n + 1) / f
        return Piece(until, kind, self.offset, self.amplitude, n / f, f, span)

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

    def next_jump(self, t: float) -> float:
        return inf

    def piece(self, t: float) -> Piece:
        f = self.frequency
        n = _edge_before(t, f)
        return Piece((n + 1) / f, SINE, self.offset, self.amplitude, n / f, f)


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

    def next_jump(self, t: float) -> float:
        return (_edge_before(t, self._rate) + 1) / self._rate if self.amplitude else inf

    def piece(self, t: float) -> Piece:
        return Piece(self.next_jump(t), LEVEL, self.value(t))


class Staircase(Command):
    """The firmware's sawtooth: ``rate`` DAC codes a second, and a 10-bit code at the offset pin.

    ``codes`` is one period of DAC codes, ``v_offset`` the offset pin in V; see
    :mod:`cosim.scene.firmware` for where they come from.
    """

    def __init__(
        self, codes: tuple[int, ...], v_offset: float, rate: float = STEPS_PER_SECOND
    ) -> None:
        self.codes = codes
        self.v_offset = v_offset
        self._rate = rate
        self.period = len(codes) / rate
        """What the period has become, s."""
        self._levels = tuple(GAIN * (v_offset - volts(code)) for code in codes)
        self._edges = [k for k in range(len(codes)) if codes[k] != codes[k - 1]]

    def value(self, t: float) -> float:
        return self._levels[_edge_before(t, self._rate) % len(self._levels)]

    def _step_before(self, t: float) -> int:
        step = _edge_before(t, self._rate)
        return step - 1 if t == step / self._rate else step

    def value_before(self, t: float) -> float:
        return self._levels[self._step_before(t) % len(self._levels)]

    def next_jump(self, t: float) -> float:
        if not self._edges:
            return inf
        count = len(self.codes)
        period, step = divmod(_edge_before(t, self._rate), count)
        place = bisect_right(self._edges, step)
        if place == len(self._edges):
            period, place = period + 1, 0
        return (period * count + self._edges[place]) / self._rate

    def piece(self, t: float) -> Piece:
        return Piece(self.next_jump(t), LEVEL, self.value(t))

    def v_dac(self, t: float) -> float:
        return volts(self.codes[_edge_before(t, self._rate) % len(self.codes)])

    def v_dac_before(self, t: float) -> float:
        return volts(self.codes[self._step_before(t) % len(self.codes)])


class WithPwm(Command):
    """Another command, with the offset pin as its PWM: 0 or 3.3 V, its duty the mean's share.

    Times count from the middle of a pulse, which is where the filter behind the pin, settled at the
    mean, has its mean; how the real PWM lies to the sawtooth is left to chance. Before 0 there is
    the mean itself, so that all begins settled. Edges within a nanosecond of a jump of the command
    are moved onto it.
    """

    _SAME = 1e-9  # s

    def __init__(self, command: Command) -> None:
        self._command = command
        self.v_offset = command.v_offset
        self.longest_straight = command.longest_straight
        duty = command.v_offset / V_REFERENCE
        self._half = 0.5 * duty
        self._still = not 1e-5 < duty < 1 - 1e-5  # pulses or gaps not wider than _SAME
        self._span = (0.0, 0.0)  # of the level last asked for
        self._level = self.v_offset

    def _edge(self, k: int) -> float:
        """Time of the PWM's edge k >= 0, s: even ones fall, odd ones rise."""
        place = 1 - self._half if k % 2 else self._half
        time = (k // 2 + place) / PWM_FREQUENCY
        jump = self._command.next_jump(time - self._SAME)
        return jump if jump <= time + self._SAME else time

    def _last_edge(self, t: float) -> int:
        """The last edge at or before ``t`` >= 0; -1 if there is none."""
        k = 2 * floor(t * PWM_FREQUENCY) + 2
        while k >= 0 and self._edge(k) > t:
            k -= 1
        return k

    def v_offset_at(self, t: float) -> float:
        if self._still or t < 0:
            return self.v_offset
        start, end = self._span
        if not start <= t < end:
            k = self._last_edge(t)
            self._span = (self._edge(k) if k >= 0 else 0.0, self._edge(k + 1))
            self._level = V_REFERENCE if k % 2 else 0.0
        return self._level

    def v_offset_before(self, t: float) -> float:
        if self._still or t <= 0:
            return self.v_offset
        k = self._last_edge(t)
        if k >= 0 and self._edge(k) == t:
            k -= 1
        return V_REFERENCE if k % 2 else 0.0

    def _next_edge(self, t: float) -> float:
        if self._still:
            return inf
        return 0.0 if t < 0 else self._edge(self._last_edge(t) + 1)

    def next_jump(self, t: float) -> float:
        return min(self._command.next_jump(t), self._next_edge(t))

    def next_corner(self, t: float) -> float:
        return min(self._command.next_corner(t), self._next_edge(t))

    def piece(self, t: float) -> Piece:
        piece = self._command.piece(t)
        return piece._replace(until=min(piece.until, self._next_edge(t)))

    def value(self, t: float) -> float:
        return self._command.value(t)

    def value_before(self, t: float) -> float:
        return self._command.value_before(t)

    def v_dac(self, t: float) -> float:
        return self._command.v_dac(t)

    def v_dac_before(self, t: float) -> float:
        return self._command.v_dac_before(t)


class Lagging(Command):
    """Another command, later by ``lag`` (s)."""

    def __init__(self, command: Command, lag: float) -> None:
        self._command = command
        self._lag = lag
        self.v_offset = command.v_offset
        self.longest_straight = command.longest_straight

    def _own(self, t: float) -> float:
        """The other command's time: on, before or after its corner as ``t`` is here."""
        own = t - self._lag
        corner = self._command.next_corner(own - 1e-12 - 1e-15 * abs(t))
        edge = corner + self._lag
        if t == edge:
            return corner
        return min(own, nextafter(corner, -inf)) if t < edge else max(own, nextafter(corner, inf))

    def value(self, t: float) -> float:
        return self._command.value(self._own(t))

    def value_before(self, t: float) -> float:
        return self._command.value_before(self._own(t))

    def next_jump(self, t: float) -> float:
        return self._command.next_jump(self._own(t)) + self._lag

    def next_corner(self, t: float) -> float:
        return self._command.next_corner(self._own(t)) + self._lag

    def piece(self, t: float) -> Piece:
        piece = self._command.piece(self._own(t))
        # Behind t, whatever rounding makes of the sum.
        until = max(piece.until + self._lag, nextafter(t, inf))
        return piece._replace(until=until, origin=piece.origin + self._lag)


def commands(scene: Scene) -> list[Command]:
    """The commands of a scene's surfaces: one, or two where they move by themselves."""
    first = command(scene)
    if scene.drive.phase_deg is None:
        return [first]
    period = getattr(first, "period", 1.0 / scene.drive.frequency)
    return [first, Lagging(first, scene.drive.phase_deg / 360.0 * period)]


def command(scene: Scene) -> Command:
    """The command of a scene; 0 V for ever where nothing drives the coil."""
    if not scene.rung.driven:
        return Constant()
    made = _shape(scene)
    return WithPwm(made) if scene.drive.pwm_ripple else made


def _shape(scene: Scene) -> Command:
    drive = scene.drive
    if drive.quantised:
        codes = staircase(nearest_code(drive.amplitude / GAIN), drive.frequency)
        pin = volts(nearest_code(offset_pin(drive.offset, drive.amplitude)))
        if drive.loop_time:
            return Staircase(passes(codes, drive.loop_time), pin, 1 / drive.loop_time)
        return Staircase(codes, pin)
    if drive.waveform == "sawtooth":
        return Sawtooth(drive.frequency, drive.amplitude, drive.offset, drive.reset_time)
    shape = {"sine": Sine, "square": Square}[drive.waveform]
    return shape(drive.frequency, drive.amplitude, drive.offset)
