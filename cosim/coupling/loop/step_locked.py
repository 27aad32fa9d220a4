"""The mechanics follow each accepted step of the circuit.

The circuit solves [t_n, t_n+1] against the back-EMF extrapolated from t_n with its true slope (the
FMU knows the ram's acceleration); then the mechanics take the same interval with the current
linear between its two ends, which carries the circuit's charge exactly. Both sides are of second
order where nothing jumps. The extrapolation uses nothing older than t_n, so a jump of the source or
an event in the mechanics is forgotten at the next step: within its own step it costs first order.

Explicit and sequential (Gauss-Seidel) in the sense of Busch, "Continuous approximation techniques
for co-simulation methods", ZAMM 96 (2016); the step sizes are those of ngspice.
"""

from math import inf

from cosim.coupling.loop.recorder import Recorder


class StepLocked:
    """Couples through the recorder, which moves the mechanics and writes down what they do."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._mechanics = recorder.mechanics
        self._time = 0.0
        self._current = 0.0
        self._emf, self._slope = self._mechanics.step_outputs[:2]

    def back_emf(self, time: float) -> float:
        return self._emf + self._slope * (time - self._time)

    def gain(self, time: float) -> float:
        return 0.0

    def accepted(self, time: float, current: float, motional: float = 0.0) -> float:
        self._recorder.advance(time, self._current, current)
        self._time, self._current = time, current
        outputs = self._mechanics.step_outputs
        self._emf, self._slope = outputs[0], outputs[1]
        return inf
