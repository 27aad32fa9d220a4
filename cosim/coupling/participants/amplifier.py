"""The behavioural amplifier with coil, solved exactly piece by piece: it can repeat its steps.

The same equations as ``circuits/amplifier.cir``: one pole whose output v_a obeys
dv_a/dt = clip(2π GBW (V1 - R_s i) - 2π GBW v_a / A_ol, ±slew) and stays within its swing, then coil
and sense resistor. Between the instants at which a limit begins or ceases to act the circuit is
linear and advanced by a matrix exponential; these instants are found by checks whose spacing is a
fraction of the loop's ringing.
Input: back-EMF of one coil (V); output: its current (A). Commands of straight pieces only.
"""

from functools import lru_cache
from typing import Any, Literal

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from cosim.coupling.polynomials import Array, Signal, shifted, value
from cosim.drive.pieces import Command
from cosim.drive.straights import straight
from cosim.errors import SimulationFailed
from cosim.scene import Scene

_SAME_TIME = 1e-13  # s
_CHECKS_PER_RADIAN = 4.0  # of the loop's ringing
_MOST_PIECES = 10_000  # linear pieces in one step
_REMEMBERED = 64  # stacks of propagators in the cache
_SIZE = 9
_I, _VA, _Q, _E, _DE, _DDE, _V1, _DV1, _ONE = range(_SIZE)
"""States: current, output voltage, charge of the step, back-EMF with two derivatives, command with
its slope, and the constant 1. Inputs are states, so that one matrix exponential advances all."""

Mode = tuple[Literal["linear", "slew", "clamp"], int]
"""No limit, the slew rate or the swing acts; the sign is that of the slewing or the limit."""


class Amplifier:
    """The circuit of a scene with its command, from rest at t = 0."""

    def __init__(self, scene: Scene, command: Command) -> None:
        circuit, coil = scene.circuit, scene.coil
        self._command = command
        self._sense = scene.sense
        self._loop = coil.resistance + self._sense
        self._inductance = coil.inductance
        self._pole = 2.0 * np.pi * circuit.gain_bandwidth
        self._leak = 10.0 ** (-circuit.open_loop_gain / 20.0)
        self._slew = circuit.slew_rate
        high, low = circuit.swing_loss_high, circuit.swing_loss_low
        self._limits = {1: circuit.supply - high, -1: low - circuit.supply}
        ringing = np.sqrt(self._pole * self._sense / self._inductance)
        self._check_every = 1.0 / (_CHECKS_PER_RADIAN * ringing)
        self._propagators = lru_cache(_REMEMBERED)(self._new_propagators)
        self.time = 0.0
        self.mean: Array = np.zeros(1)
        self._x = np.zeros(_SIZE)
        self._x[_ONE] = 1.0
        self._mode: Mode = ("linear", 0)
        self._corner = 0.0
        self._straight()

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        start, end = self.time, self.time + h
        self._x[_Q] = 0.0
        polynomial = inputs.reshape(len(inputs))
        for _ in range(_MOST_PIECES):
            # The back-EMF's derivatives at the present time: coefficient k times k!.
            now = shifted(polynomial, self.time - start)
            self._x[_E:_V1] = 0.0
            self._x[_E : _E + len(now)] = now
            self._x[_DDE] *= 2.0
            length = min(self._corner, end) - self.time
            used = self._piece(length, gain)
            self.time = end if end - self.time - used <= _SAME_TIME else self.time + used
            if self.time >= self._corner - _SAME_TIME:
                self._straight()
            if self.time == end:
                break
        else:
            raise SimulationFailed(f"The amplifier chatters at t = {self.time:.6g} s.")
        charge = float(self._x[_Q])
        self.mean = np.array([charge / h])
        self._x[_E] = float(value(polynomial, h)) + gain * charge

    def _straight(self) -> None:
        """Take the straight piece of the command that begins now."""
        command, now = self._command, max(self.time, self._corner)
        self._corner, first, last = straight(command.piece(now), now)
        self._x[_V1], self._x[_DV1] = first, (last - first) / (self._corner - now)
        self._choose()

    def _choose(self) -> None:
        """Choose the mode from the state, at each new straight piece of the command."""
        rate = self._rate(self._x)
        side = 1 if rate > 0.0 else -1
        if side * self._x[_VA] >= side * self._limits[side]:
            self._mode = ("clamp", side)
        else:
            self._mode = ("slew", side) if abs(rate) > self._slew else ("linear", 0)

    def _rate(self, x: Array) -> Any:
        """Slope that v_a would have without limits, V/s, for each state (row) of ``x``."""
        return self._pole * (x[..., _V1] - self._sense * x[..., _I] - self._leak * x[..., _VA])

    def _margins(self, x: Array) -> list[Array]:
        """Functions that are positive as long as the mode lasts, for each state (row) of ``x``."""
        kind, side = self._mode
        rate = self._rate(x)
        if kind == "clamp":
            return [side * rate]
        swing = [self._limits[1] - x[..., _VA], x[..., _VA] - self._limits[-1]]
        if kind == "slew":
            return [side * rate - self._slew, *swing]
        return [self._slew - np.abs(rate), *swing]

    def _piece(self, length: float, gain: float) -> float:
        """Advance by at most ``length`` s, up to the end of the mode; gives the time used, s."""
        stack = self._propagators(length, self._mode, gain)
        states = stack @ self._x  # checks × states: the state at each check
        ended = np.min(self._margins(states), axis=0) < 0.0
        if not ended.any():
            self._x = states[-1]
            return length
        # The mode ends within step k of the checks; bisect for the zero of the least margin there.
        k = int(np.argmax(ended))
        step = length / len(stack)
        before = self._x if k == 0 else states[k - 1]
        a = self._matrix(self._mode, gain)

        def then(s: float) -> Array:
            return np.asarray(expm(a * s) @ before, np.float64)

        def least(s: float) -> float:
            return float(np.min(self._margins(then(s))))

        # A margin of 0 at the start may be negative by rounding: then the whole step is taken.
        rest = step
        if least(0.0) > 0.0:
            rest = float(brentq(least, 0.0, step, xtol=1e-16))  # pyright: ignore[reportArgumentType]
        self._x = then(rest)
        values = [float(m) for m in self._margins(self._x)]
        self._turn(values.index(min(values)))
        return k * step + rest

    def _turn(self, ended: int) -> None:
        """Change the mode after its margin number ``ended`` (see ``_margins``) has reached zero."""
        kind, _ = self._mode
        if ended:
            side = 1 if ended == 1 else -1
            self._x[_VA] = self._limits[side]
            outward = side * self._rate(self._x) > 0.0
            self._mode = ("clamp", side) if outward else ("linear", 0)
        elif kind == "linear":
            self._mode = ("slew", 1 if self._rate(self._x) > 0.0 else -1)
        else:
            self._mode = ("linear", 0)

    def _matrix(self, mode: Mode, gain: float) -> Array:
        """A of dx/dt = A x; with ``gain`` the charge adds ``gain`` q to the back-EMF."""
        kind, side = mode
        a = np.zeros((_SIZE, _SIZE))
        a[_I, [_I, _VA, _E, _Q]] = np.array([-self._loop, 1.0, -1.0, -gain]) / self._inductance
        a[_Q, _I] = a[_E, _DE] = a[_DE, _DDE] = a[_V1, _DV1] = 1.0
        if kind == "linear":
            a[_VA, [_V1, _I, _VA]] = self._pole * np.array([1.0, -self._sense, -self._leak])
        elif kind == "slew":
            a[_VA, _ONE] = side * self._slew
        return a

    def _new_propagators(self, length: float, mode: Mode, gain: float) -> Array:
        """exp(A s) at the equally spaced times s of the checks up to ``length``."""
        checks = max(1, int(np.ceil(length / self._check_every)))
        first = expm(self._matrix(mode, gain) * (length / checks))
        found = np.empty((checks, _SIZE, _SIZE))
        found[0] = first
        for k in range(1, checks):
            found[k] = first @ found[k - 1]
        return found

    def outputs(self, inputs: Signal | None = None) -> Signal:
        x = self._x
        if inputs is not None:
            x[_E] = float(inputs[0][0])
        slope = (x[_VA] - self._loop * x[_I] - x[_E]) / self._inductance
        return np.array([x[_I]]), np.array([slope])

    def save(self) -> Any:
        return (self.time, self._x.copy(), self._mode, self.mean, self._corner)

    def restore(self, saved: Any) -> None:
        self.time, x, self._mode, self.mean, self._corner = saved
        self._x = x.copy()
