"""Macro steps with a circuit that leads and cannot go back: ngspice.

The circuit's steps are cut to end on the macro points, each ``macro_step`` after the last or at a
jump of the command, where the extrapolation restarts. Between macro points the circuit sees an
extrapolation of the back-EMF and the mechanics wait; at a macro point they take the whole macro
step, with what the method gives them of the current. Orders and limits are those of the same
methods in :mod:`cosim.coupling.rewind.jacobi`, :mod:`cosim.coupling.rewind.gauss_seidel` and
:mod:`cosim.coupling.rewind.companion`; since the mechanics take a linear current, at most 2.
"""

import numpy as np

from cosim.circuit.netlist import LEAK_TIME
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.polynomials import Array, History, projected
from cosim.drive.command import Command

_ON_TIME = 1e-13
"""s; times of the circuit this close to a macro point are on it."""


class Led:
    """Couples through the recorder, which moves the mechanics and writes down what they do."""

    def __init__(
        self,
        recorder: Recorder,
        command: Command,
        kind: str,
        macro_step: float,
        order: int,
        duration: float,
    ) -> None:
        """``order`` 0, 1 or 2 of the extrapolation, from the back-EMF's true slope on; the
        companion's is its own. The last macro step ends at ``duration``, s."""
        self._recorder = recorder
        self._mechanics = recorder.mechanics
        self._command = command
        self._kind = kind
        self._macro_step = macro_step
        self._of_current = History(order, False)
        self._of_emf = History(order, True)
        self._gain = 0.0
        self._duration = duration
        self._jump = 0.0  # the start is one too
        self._start = self._reached = 0.0
        self._current = 0.0
        self._charge = 0.0
        self._begin(0.0, 0.0)

    def back_emf(self, time: float) -> float:
        s, total = time - self._start, 0.0
        for c in reversed(self._emf):
            total = total * s + c
        return total

    def gain(self, time: float) -> float:
        """What the circuit's own share of the back-EMF grows with, V/(A s); see ``accepted``."""
        return self._gain

    def accepted(self, time: float, current: float, motional: float = 0.0) -> float:
        self._charge += 0.5 * (self._current + current) * (time - self._reached)
        self._reached, self._current = time, current
        if time < self._end - _ON_TIME:
            return self._end - time
        self._follow(time, current)
        self._begin(time, motional)
        return self._end - time

    def _follow(self, time: float, current: float) -> None:
        """Move the mechanics over the macro step."""
        h = time - self._start
        start, end = self._at_start, current
        if self._kind == "jacobi":
            line = projected(self._extrapolated, h, 1)
            start = end = float(line[0])
            if len(line) > 1:
                end = start + h * float(line[1])
        elif self._kind in ("mean-current", "companion"):
            start = end = self._charge / h
        self._recorder.advance(time, start, end)
        if end != current:
            self._mechanics.refresh(current)

    def _begin(self, time: float, motional: float) -> None:
        """Start a macro step."""
        self._start, self._charge, self._at_start = time, 0.0, self._current
        emf, slope = self._mechanics.step_outputs[:2]
        self._of_current.add(time, np.array(self._current), np.array(0.0))
        self._of_emf.add(time, np.array(emf), np.array(slope))
        if time >= self._jump - _ON_TIME:
            self._of_current.restart()
            self._of_emf.restart()
            self._jump = self._command.next_jump(time + _ON_TIME)
        self._end = min(time + self._macro_step, self._jump)
        if time < self._duration - _ON_TIME:
            self._end = min(self._end, self._duration)
        if self._kind == "companion":
            self._gain = self._mechanics.gain()
            # The circuit's share starts from what it stands at, and leaks away.
            own = self._gain * self._current - motional / LEAK_TIME
            self._emf = [emf - motional, slope - own]
            return
        self._emf = self._of_emf.polynomial(time).tolist()
        self._extrapolated: Array = self._of_current.polynomial(time)
