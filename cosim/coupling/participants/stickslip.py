"""The FMU as a participant: input the current of one coil (A), output its back-EMF (V)."""

from ctypes import c_int, c_void_p
from typing import Any

import numpy as np

from cosim.coupling.polynomials import Array, Signal, projected, slope, value
from cosim.errors import SimulationFailed
from cosim.mechanics.stickslip import STEP_OUTPUTS, Mechanics
from cosim.scene import Scene

_EVENTS = ("impacts", "stick_slip_events", "wall_contact")
_EMF, _SLOPE, _FLUX = map(STEP_OUTPUTS.index, ("back_emf", "back_emf_slope", "motional_flux"))


class FmuMechanics(Mechanics):
    """The mechanics of a scene, from rest, which can go back to a saved state.

    The FMU takes linear inputs; a parabola is replaced by the line with the same integral and first
    moment (:func:`cosim.coupling.polynomials.projected`).
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        if self.normal_force is not None:
            raise NotImplementedError("a normal force that changes in time")
        self.time = 0.0
        """Time that the mechanics have reached, s."""
        self._event_places = self.instance.places(_EVENTS)
        self._event_counts = (c_int * len(_EVENTS))()
        self._touches = 0
        self._free: list[c_void_p] = []
        self.mean: Array = np.zeros(1)
        """Mean back-EMF of the last step, V: the change of the coil's flux linkage over time."""

    def advance(self, h: float, inputs: Array, gain: float = 0.0) -> None:
        if gain:
            raise NotImplementedError("the companion belongs to the circuit's side")
        before, was = self.step_outputs[_FLUX], self._read_events()
        first, *rise = projected(tuple(inputs), h, 1)
        self._exchange(first[0], rise[0][0] if rise else 0.0, h)
        if len(inputs) > 2:
            # The output's slope must answer to the true current at the end, not to the line's.
            self._exchange(value(inputs, h)[0], slope(inputs, h)[0])
        self.mean = np.array([(self.step_outputs[_FLUX] - before) / h])
        self._touches += self._read_events() != was

    def outputs(self, inputs: Signal | None = None) -> Signal:
        if inputs is not None:
            self._exchange(inputs[0][0], inputs[1][0])
        return np.array([self.step_outputs[_EMF]]), np.array([self.step_outputs[_SLOPE]])

    def _exchange(self, current: float, rate: float, h: float = 0.0) -> None:
        """Set the current (A) and its slope (A/s), go on by ``h`` (s), read the outputs."""
        try:
            self.inputs[:] = current, rate
            self.instance.set_reals(self.places["inputs"], self.inputs)
            if h:
                self.instance.do_step(self.time, h)
            self.instance.get_reals(self.places["step_outputs"], self.step_outputs)
        except Exception as error:
            raise self.failed(error, self.time) from error
        self.time += h

    def _read_events(self) -> tuple[int, ...]:
        """Counters of impacts and stick-slip changes, and which wall is touched."""
        self.instance.get_integers(self._event_places, self._event_counts)
        return tuple(self._event_counts)

    def gain(self) -> float:
        """Bl²/m_eff now, V/(A s)."""
        return self.inertial_gain(self.time)

    def events(self) -> int:
        """Number of steps so far in which a mode changed: stick, slip, a wall met or left."""
        return self._touches

    def save(self) -> Any:
        handle = self._free.pop() if self._free else c_void_p()
        self.instance.get_state(handle)
        rest = (self.time, tuple(self.step_outputs), self.mean, self._touches)
        return _Saved(handle, self._free, rest)

    def restore(self, saved: Any) -> None:
        try:
            self.instance.set_state(saved.handle)
        except Exception as error:
            raise SimulationFailed(f"The mechanics cannot go back: {error}") from error
        self.time, outputs, self.mean, self._touches = saved.rest
        self.step_outputs[:] = outputs

    def close(self) -> None:
        for handle in self._free:
            self.instance.free_state(handle)
        self._free.clear()
        super().close()


class _Saved:
    """A saved state; its memory returns to the pool when the last reference to it is gone."""

    def __init__(self, handle: c_void_p, pool: list[c_void_p], rest: tuple[Any, ...]) -> None:
        self.handle, self.rest = handle, rest
        self._pool = pool

    def __del__(self) -> None:
        self._pool.append(self.handle)
