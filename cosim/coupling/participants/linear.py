"""A linear participant, solved exactly by the matrix exponential.

Its state may be a matrix, whose columns are advanced together: so the linear map of a method is
read (see :mod:`cosim.coupling.rewind.stability`). Sources are states, too: a constant, or the two
states of a sine.
"""

from functools import lru_cache
from math import factorial
from typing import Any

import numpy as np
from scipy.linalg import expm

from cosim.coupling.polynomials import Array, Signal, slope, value
from cosim.scene import Scene

_REMEMBERED = 64  # propagators in the cache; variable macro steps use each only a few times


class LinearParticipant:
    """dx/dt = A x + B u, y = C x + D u."""

    def __init__(self, a: Any, b: Any, c: Any, d: Any = None, state: Any = None) -> None:
        self._a = np.atleast_2d(np.array(a, float))
        n = len(self._a)
        self._b = np.array(b, float).reshape(n, -1)
        self._c = np.array(c, float).reshape(-1, n)
        inputs, outputs = self._b.shape[1], len(self._c)
        self._d = np.zeros((outputs, inputs)) if d is None else np.array(d, float)
        self._d = self._d.reshape(outputs, inputs)
        self.state = np.zeros(n) if state is None else np.array(state, float)
        self.mean: Array = np.zeros(outputs)
        self._input: Array = np.zeros(inputs)
        self._input_slope: Array = np.zeros(inputs)
        self._propagator = lru_cache(_REMEMBERED)(self._new_propagator)

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        # The augmented state: x, the integral of the output (from 0), u and its derivatives.
        derivatives = [factorial(k) * c for k, c in enumerate(inputs)]
        start = np.concatenate([self.state, np.zeros_like(self.mean), *derivatives])
        end = self._propagator(h, len(inputs) - 1, gain) @ start
        self.state, total = np.split(end, [len(self._a)])
        self.mean = total / h
        self._input, self._input_slope = value(inputs, h), slope(inputs, h)
        if gain:
            self._input = self._input + gain * total
            self._input_slope = self._input_slope + gain * self._output()

    def _output(self) -> Array:
        return self._c @ self.state + self._d @ self._input

    def outputs(self, inputs: Signal | None = None) -> Signal:
        if inputs is not None:
            self._input, self._input_slope = inputs
        rate = self._a @ self.state + self._b @ self._input
        return self._output(), self._c @ rate + self._d @ self._input_slope

    def gain(self) -> float:
        """Derivative of the (first) output's slope with respect to the (first) input, now."""
        return float(self._c[0] @ self._b[:, 0])

    def events(self) -> int:
        """A linear system has none."""
        return 0

    def save(self) -> Any:
        return (self.state, self.mean, self._input, self._input_slope)

    def restore(self, saved: Any) -> None:
        self.state, self.mean, self._input, self._input_slope = saved

    def _new_propagator(self, h: float, degree: int, gain: float) -> Array:
        n, outputs, inputs = len(self._a), len(self._c), self._b.shape[1]
        size = n + outputs + inputs * (degree + 1)
        # d/dt (x, ∫y dt, u, u', ...) = m (x, ∫y dt, u, u', ...): exp(m h) advances all of them by
        # h, the integral exactly, too (Van Loan, IEEE Trans. Autom. Control 23 (1978) 395). With
        # ``gain`` the input is u + gain ∫y dt. Only the rows of x and ∫y dt are returned.
        m = np.zeros((size, size))
        state, integral = slice(0, n), slice(n, n + outputs)
        first = slice(n + outputs, n + outputs + inputs)
        m[state, state], m[state, first] = self._a, self._b
        m[integral, state], m[integral, first] = self._c, self._d
        if gain:
            m[state, integral], m[integral, integral] = gain * self._b, gain * self._d
        for k in range(degree):
            low = n + outputs + k * inputs
            m[low : low + inputs, low + inputs : low + 2 * inputs] = np.eye(inputs)
        return np.asarray(expm(m * h)[: n + outputs], np.float64)


def coil(resistance: float, inductance: float, current: float = 0.0) -> LinearParticipant:
    """A coil (Ω, H) at a constant voltage: the input is its back-EMF (V), the output its current
    (A). A clamped amplifier is such a circuit, with the sense resistor in ``resistance``."""
    a, b = [[-resistance / inductance]], [[-1.0 / inductance]]
    return LinearParticipant(a, b, [[1.0]], state=[current])


def regulated_coil(
    scene: Scene, current: float = 0.0, sine: tuple[float, float] | None = None
) -> LinearParticipant:
    """A scene's coil in the feedback of its amplifier with one pole, which never saturates; input
    back-EMF, output current.

    The states are the current, A, at first ``current``, and the amplifier's output voltage. The
    command is constant (then states are deviations from the equilibrium), or A sin(2π f t) with
    ``sine`` = (A, f) in V and Hz, whose A sin and A cos are two more states.
    """
    circuit, inductance = scene.circuit, scene.coil.inductance
    sense, rate = scene.sense, 2.0 * np.pi * circuit.gain_bandwidth
    leak = rate / 10.0 ** (circuit.open_loop_gain / 20.0)
    loop = scene.coil.resistance + sense
    a = [[-loop / inductance, 1.0 / inductance], [-rate * sense, -leak]]
    b, c = [[-1.0 / inductance], [0.0]], [[1.0, 0.0]]
    if sine is None:
        return LinearParticipant(a, b, c, state=[current, 0.0])
    amplitude, w = sine[0], 2.0 * np.pi * sine[1]
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[1, 2] = a, rate
    whole[2, 3], whole[3, 2] = w, -w
    state = [current, 0.0, 0.0, amplitude]
    return LinearParticipant(whole, [*b, [0.0], [0.0]], [[1.0, 0.0, 0.0, 0.0]], state=state)
