"""Macro steps with a circuit that leads and cannot repeat a step: ngspice.

The circuit's steps end on the macro points, each ``macro_step`` after the last or at a jump of the
command, where the extrapolation restarts. Between macro points the circuit sees the method's
back-EMF and the mechanics wait; at a macro point the mechanics take the whole macro step with the
method's current. The FMU takes a linear current: a parabola is replaced by the line with the same
integral and first moment, so methods are at most of order 2.
"""

from cosim.circuit.netlist import LEAK_TIME
from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import FMU_FAILED
from cosim.coupling.method import Method, Past
from cosim.coupling.methods import methods
from cosim.coupling.polynomials import projected
from cosim.drive.command import command
from cosim.scene import Scene
from cosim.scene.rungs import METHODS

_ON_TIME = 1e-13
"""s; times of the circuit closer than this to a macro point are at the macro point."""


def coupled(scene: Scene, recorder: Recorder) -> Lead:
    """A run ready to start; "auto" must be resolved to a ``coupling.method`` before."""
    lead = Lead(scene, command(scene), recorder)
    chosen = scene.coupling
    if chosen.method != "step-locked":
        kind = methods()[chosen.method]
        has_degree = "order" in METHODS[chosen.method].keys
        MacroSteps(scene, lead, recorder, kind(chosen.order) if has_degree else kind())
    return lead


class MacroSteps:
    """Exchanges the signals by a method at each macro point of a run."""

    def __init__(self, scene: Scene, lead: Lead, recorder: Recorder, method: Method) -> None:
        self._method, self._mechanics = method, recorder.mechanics
        self._exchange = recorder.exchange
        self._outputs = self._mechanics.step_outputs
        self._state, self._segment = lead.state, lead.state.segment
        self._coefficients = self._segment.c
        self._macro_step, self._duration = scene.coupling.macro_step, scene.run.duration
        self._past = Past(method)
        lead.use(self._macro_point)
        self._begin(0.0, 0.0)

    def _macro_point(self) -> None:
        """End a macro step: advance the mechanics by the method's current; begin the next step."""
        state, past = self._state, self._past
        time, current = state.time, state.current
        past.stepped(time, current, self._segment.charge / (time - past.time))
        line = projected(self._method.current(past), past.h, 1)
        start = line[0]
        end = start + past.h * line[1] if len(line) > 1 else start
        if self._exchange(time, start, end, current):
            self._begin(time, current)
        else:
            state.status = FMU_FAILED

    def _begin(self, time: float, current: float) -> None:
        """Start a macro step."""
        state, past, segment, outputs = self._state, self._past, self._segment, self._outputs
        past.met(time, current, None, outputs[0], outputs[1])
        if state.at_jump:
            past.restart()
        if self._method.carries_inertia:
            past.gain = self._mechanics.inertial_gain(time)
            # The circuit's capacitor keeps its voltage from before, and leaks with LEAK_TIME.
            past.carried = state.carried
            past.carried_slope = past.gain * current - state.carried / LEAK_TIME
            segment.gain = past.gain
        emf = self._method.emf(past)
        for k in range(3):
            self._coefficients[k] = emf[k] if k < len(emf) else 0.0
        end = min(time + self._macro_step, state.jump)
        segment.end = min(end, self._duration) if time < self._duration - _ON_TIME else end
        segment.origin, segment.start, segment.charge = time, current, 0.0
