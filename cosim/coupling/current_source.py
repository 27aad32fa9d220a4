"""A behavioural current source with coil, solved exactly piece by piece: it can repeat its steps.

Within its output swing the source regulates: the current is the command over the sense resistor,
whatever voltage that takes. Where that voltage is beyond the swing the output is clamped, and
L di/dt = V_limit - (R_c + R_s) i - e until current and command meet again. Input the back-EMF of
one coil (V), output its current (A).
"""

from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from cosim.coupling.participant import Signal
from cosim.coupling.polynomials import Array, shifted, value
from cosim.drive import Command
from cosim.errors import SimulationFailed
from cosim.scene import Scene

_SAME_TIME = 1e-13  # s
_LOOKS = 16  # per piece, for the current to meet the command
_MOST_PIECES = 10_000  # in one step


class CurrentSource:
    """The source of a scene with its command, from rest at t = 0."""

    def __init__(self, scene: Scene, command: Command) -> None:
        circuit, coil = scene.circuit, scene.coil
        self._command = command
        self._share = 1.0 / (circuit.sense_resistance * coil.count)
        self._resistance = coil.resistance + circuit.sense_resistance * coil.count
        self._inductance = coil.inductance
        self._high = circuit.supply - circuit.swing_loss_high
        self._low = circuit.swing_loss_low - circuit.supply
        self.time = 0.0
        self._current = 0.0
        self._clamped = 0  # +1, -1 at a limit of the swing
        self._events = 0
        self._emf = 0.0
        self.mean: Array = np.zeros(1)
        self._corner = 0.0
        self._known: tuple[object, Array] = (None, np.zeros(0))
        self._straight()

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        start, end, charge = self.time, self.time + h, 0.0
        for _ in range(_MOST_PIECES):
            if self.time >= self._corner - _SAME_TIME:
                self._straight()
            length = min(self._corner, end) - self.time
            emf = shifted(inputs.reshape(len(inputs)), self.time - start)
            emf[0] += gain * charge
            if self._clamped:
                used, gained = self._clamp(length, emf, gain)
            else:
                used, gained = self._regulate(length, emf, gain)
            charge += gained
            self.time = end if end - self.time - used <= _SAME_TIME else self.time + used
            if self.time == end:
                break
        else:
            raise SimulationFailed(f"The current source chatters at t = {self.time:.6g} s.")
        if self.time >= self._corner - _SAME_TIME:
            self._straight()
        self.mean = np.array([charge / h])
        self._emf = float(value(inputs, h)[0]) + gain * charge

    def _straight(self) -> None:
        """Take the straight piece of the command that begins now."""
        command, now = self._command, max(self.time, self._corner)
        self._corner = min(command.next_corner(now), now + command.longest_straight)
        self._begin = now
        self._asked = self._share * command.value(now)
        last = self._share * command.value_before(self._corner)
        self._rise = (last - self._asked) / (self._corner - now)
        gap = self._asked - self._current
        if abs(gap) > 1e-12 and not self._clamped * gap > 0.0:
            self._turn(1 if gap > 0.0 else -1)

    def _turn(self, clamped: int) -> None:
        self._events += clamped != self._clamped
        self._clamped = clamped

    def _regulate(self, length: float, emf: Array, gain: float) -> tuple[float, float]:
        """Follow the command until the output leaves its swing; time used (s) and charge (C)."""
        here = self._asked + self._rise * (self.time - self._begin)
        needed = np.zeros(3)
        needed[: len(emf)] = emf
        needed[0] += self._resistance * here + self._inductance * self._rise
        needed[1] += self._resistance * self._rise + gain * here
        needed[2] += 0.5 * gain * self._rise
        used, clamped = length, 0
        for limit, side in ((self._high, 1), (self._low, -1)):
            beyond = side * (needed - [limit, 0.0, 0.0])
            if beyond[0] > 1e-9 or (abs(beyond[0]) <= 1e-9 and beyond[1] > 0.0):
                used, clamped = 0.0, side
                break
            for root in np.roots(beyond[::-1]) if beyond[1] or beyond[2] else ():
                rising = beyond[1] + 2.0 * beyond[2] * root.real > 0.0
                if abs(root.imag) < 1e-12 and rising and 0.0 < root.real < used:
                    used, clamped = float(root.real), side
        if clamped:
            self._turn(clamped)
        self._current = here + self._rise * used
        return used, (here + 0.5 * self._rise * used) * used

    def _clamp(self, length: float, emf: Array, gain: float) -> tuple[float, float]:
        """Stay at a limit until current and command meet; time used (s) and charge (C)."""
        limit = self._high if self._clamped > 0 else self._low
        # Current, charge, and the back-EMF with its derivatives, all that is left once known.
        a = np.zeros((6, 6))
        a[0, 0], a[0, 1] = -self._resistance / self._inductance, -gain / self._inductance
        a[0, 2], a[0, 5] = -1.0 / self._inductance, limit / self._inductance
        a[1, 0] = a[2, 3] = a[3, 4] = 1.0
        terms = np.zeros(3)
        terms[: len(emf)] = emf
        state = np.array([self._current, 0.0, terms[0], terms[1], 2.0 * terms[2], 1.0])
        begun = self.time - self._begin

        def gap(s: float, y: Array) -> float:
            return self._clamped * (self._asked + self._rise * (begun + s) - float(y[0]))

        piece = length / _LOOKS
        look = self._propagator(piece, gain, a)
        at = 0.0
        for _ in range(_LOOKS):
            after = look @ state
            if gap(at + piece, after) <= 0.0:
                break
            at, state = at + piece, after
        else:
            self._current = float(state[0])
            return length, float(state[1])

        def then(s: float) -> Array:
            return np.asarray(expm(a * s) @ state, np.float64)

        rest = piece
        if gap(at, state) > 0.0 > gap(at + piece, after):
            rest = float(brentq(lambda s: gap(at + s, then(s)), 0.0, piece, xtol=1e-16))  # type: ignore[arg-type]
        at += rest
        self._turn(0)
        self._current = self._asked + self._rise * (begun + at)
        return at, float(then(rest)[1])

    def _propagator(self, piece: float, gain: float, a: Array) -> Array:
        """exp(a ``piece``): of all in ``a``, what varies is the gain and the limit's sign."""
        key = (piece, gain, self._clamped)
        if self._known[0] != key:
            self._known = (key, np.asarray(expm(a * piece), np.float64))
        return self._known[1]

    def outputs(self, inputs: Signal | None = None) -> Signal:
        if inputs is not None:
            self._emf = float(inputs[0][0])
        rise = self._rise
        if self._clamped:
            limit = self._high if self._clamped > 0 else self._low
            rise = (limit - self._resistance * self._current - self._emf) / self._inductance
        return np.array([self._current]), np.array([rise])

    def events(self) -> int:
        """Changes between regulating and clamped so far."""
        return self._events

    def save(self) -> Any:
        line = (self._corner, self._begin, self._asked, self._rise)
        return (self.time, self._current, self._clamped, self._events, self._emf, self.mean, line)

    def restore(self, saved: Any) -> None:
        self.time, self._current, self._clamped, self._events, self._emf, self.mean, line = saved
        self._corner, self._begin, self._asked, self._rise = line
