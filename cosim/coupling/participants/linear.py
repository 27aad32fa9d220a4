"""A linear participant, solved exactly by the matrix exponential.

Its states may have a further axis: columns that are advanced together, from which a method's linear
map is read (see :mod:`cosim.coupling.rewind.stability`). Sources are states of their own: a
constant, or the two states of a sine.
"""

from collections import OrderedDict
from typing import Any

import numpy as np
from scipy.linalg import expm

from cosim.coupling.polynomials import Array, Signal, slope, value

_REMEMBERED = 64  # propagators; a variable macro step uses each but a few times


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
        self._known: OrderedDict[tuple[float, int, float], Array] = OrderedDict()

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        n, degree = len(self._a), len(inputs) - 1
        outputs = len(self._c)
        propagator = self._propagator(h, degree, gain)
        # The integral of the output starts from 0; the input and its derivatives are states.
        derivatives = [inputs[0], inputs[1]] if degree else [inputs[0]]
        derivatives += [2.0 * inputs[2]] if degree > 1 else []
        start = np.concatenate([self.state, np.zeros_like(self.mean), *derivatives])
        end = propagator @ start
        self.state = end[:n]
        total = end[n : n + outputs]
        self.mean = total / h
        self._input, self._input_slope = value(inputs, h), slope(inputs, h)
        if gain:
            self._input = self._input + gain * total
            self._input_slope = self._input_slope + gain * self._output(self._input)

    def _output(self, inputs: Array) -> Array:
        return self._c @ self.state + self._d @ inputs

    def outputs(self, inputs: Signal | None = None) -> Signal:
        if inputs is not None:
            self._input, self._input_slope = inputs
        rate = self._a @ self.state + self._b @ self._input
        return self._output(self._input), self._c @ rate + self._d @ self._input_slope

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

    def _propagator(self, h: float, degree: int, gain: float) -> Array:
        key = (h, degree, gain)
        if key in self._known:
            self._known.move_to_end(key)
            return self._known[key]
        n, outputs, inputs = len(self._a), len(self._c), self._b.shape[1]
        size = n + outputs + inputs * (degree + 1)
        m = np.zeros((size, size))
        here, there = slice(0, n), slice(n, n + outputs)
        first = slice(n + outputs, n + outputs + inputs)
        m[here, here], m[here, first] = self._a, self._b
        m[there, here], m[there, first] = self._c, self._d
        if gain:
            m[here, there], m[there, there] = gain * self._b, gain * self._d
        for k in range(degree):
            low = n + outputs + k * inputs
            m[low : low + inputs, low + inputs : low + 2 * inputs] = np.eye(inputs)
        found = np.asarray(expm(m * h)[: n + outputs], np.float64)
        self._known[key] = found
        if len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        return found


def coil(resistance: float, inductance: float, current: float = 0.0) -> LinearParticipant:
    """A coil (Ω, H) on a voltage that stands still: the input is its back-EMF, V, the output the
    current, A. A clamped output is such a circuit, with the sense resistor in ``resistance``."""
    return LinearParticipant(*_coil(resistance, inductance), state=[current])


def regulated_coil(
    resistance: float,
    inductance: float,
    sense_resistance: float,
    gain_bandwidth: float,
    open_loop_gain: float,
    current: float = 0.0,
) -> LinearParticipant:
    """A coil in the feedback of an amplifier with one pole, whose command stands still.

    ``gain_bandwidth`` in Hz, ``open_loop_gain`` a plain number; input back-EMF, output current.
    """
    matrices = _regulated(resistance, inductance, sense_resistance, gain_bandwidth, open_loop_gain)
    return LinearParticipant(*matrices, state=[current, 0.0])


def driven_regulated_coil(
    resistance: float,
    inductance: float,
    sense_resistance: float,
    gain_bandwidth: float,
    open_loop_gain: float,
    amplitude: float,
    frequency: float,
) -> LinearParticipant:
    """The same, commanded by ``amplitude`` sin(2π ``frequency`` t), V, and at rest at t = 0."""
    matrices = _regulated(resistance, inductance, sense_resistance, gain_bandwidth, open_loop_gain)
    return _on_sine(matrices, [0.0, 2.0 * np.pi * gain_bandwidth], amplitude, frequency)


_Matrices = tuple[Any, Any, Any]


def _coil(resistance: float, inductance: float) -> _Matrices:
    return [[-resistance / inductance]], [[-1.0 / inductance]], [[1.0]]


def _regulated(
    resistance: float,
    inductance: float,
    sense_resistance: float,
    gain_bandwidth: float,
    open_loop_gain: float,
) -> _Matrices:
    rate = 2.0 * np.pi * gain_bandwidth
    loop = resistance + sense_resistance
    a = [
        [-loop / inductance, 1.0 / inductance],
        [-rate * sense_resistance, -rate / open_loop_gain],
    ]
    return a, [[-1.0 / inductance], [0.0]], [[1.0, 0.0]]


def _on_sine(
    matrices: _Matrices, enters: list[float], amplitude: float, frequency: float
) -> LinearParticipant:
    """At rest at t = 0; a sine with this amplitude ``enters`` the states' rates."""
    a, b, c = (np.array(m, float) for m in matrices)
    n, w = len(a), 2.0 * np.pi * frequency
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n] = a, enters
    whole[n, n + 1], whole[n + 1, n] = w, -w
    still = np.zeros((2, b.shape[1]))
    outputs = np.hstack([c, np.zeros((len(c), 2))])
    return LinearParticipant(
        whole, np.vstack([b, still]), outputs, state=[0.0] * (n + 1) + [amplitude]
    )
