"""One run in which ngspice leads; ``lead.c`` controls its steps.

Steps end on jumps of the command and on macro points, and are short after a jump. Python prepares
the command and takes the log away in blocks.
"""

import ctypes
from collections.abc import Callable
from ctypes import c_int64
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.circuit import ngspice
from cosim.circuit.joined import Deck, Edges
from cosim.circuit.netlist import MOTIONAL, prepare
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import (
    FMU_FAILED,
    NOT_FINITE,
    UNKNOWN_SOURCE,
    LeadState,
    Pulse,
    address,
    array,
    callback,
)
from cosim.drive.pieces import Ahead, Command
from cosim.errors import SimulationFailed, StepTooSmall
from cosim.files.spill import Tape
from cosim.scene import Scene
from cosim.scene.firmware import GAIN

_AFTER_JUMP, _SHARE_AFTER_JUMP = 1e-7, 1e-2
"""Longest step after a jump of the command, in s and as a share of ``circuit.max_step``: ngspice
chooses its step from slopes before the jump, which mislead it. The start of a run is a jump, too.
The step after a jump is of first order without error control, so finer runs must shorten it."""

ROUNDING = 1e-13
"""s, by which ngspice may end before the requested time."""

_COARSEST = 1e-4
"""``circuit.reltol`` at which the step lengths in ``lead.c`` hold. For another one they scale with
its cube root, like the steps that ngspice chooses by a truncation error of second order."""

_EMF_CHANGE = 3e-3
"""Most change of the back-EMF in a step while the output is at its limits, over the supply."""

LOG = ("time", "emf", "owed")
"""Columns of the log: time, s; the back-EMF given to the circuit, V; by how much its integral
lagged behind the flux of the mechanics at the last macro point, V s."""

_POINTS = 4096
"""Accepted points that the log's block holds before it is emptied."""


class Lead(ngspice.Leader):
    """ngspice leads; the mechanics follow each accepted step, or at macro points set by ``use``."""

    kind = "lead"

    def __init__(
        self,
        scene: Scene,
        command: Command,
        recorder: Recorder,
        deck: Deck | None = None,
    ) -> None:
        """``deck`` replaces the scene's."""
        self._duration = scene.run.duration
        self._recorder = recorder
        self.deck = deck or prepare(scene)
        self._saved = tuple(self.deck.vectors)
        width = len(LOG) + len(self._saved)
        self._log = Tape(width)
        # With `uic`, ngspice accepts t = 0 before it has sent any value.
        self._block = np.zeros((_POINTS, width))
        self.places = (c_int64 * (len(self._saved) + 1))()
        self._time = 0.0
        motional = self._saved.index(MOTIONAL) if MOTIONAL in self._saved else -1
        swing = self._saved.index("v(swing)") if "v(swing)" in self._saved else -1
        self.state = LeadState(
            recorder=ctypes.addressof(recorder.state),
            macro_point=address("macro_point_step_locked"),
            gain=GAIN,
            v_offset=command.v_offset,
            count=scene.coil.count,
            after_jump=after_jump(scene),
            fineness=_fineness(scene),
            time_constant=scene.coil.inductance / (scene.coil.resistance + scene.sense),
            range=scene.drive.amplitude or 1.0,
            emf_change=_EMF_CHANGE * scene.circuit.supply,
            max_step=scene.circuit.max_step,
            output_high=scene.circuit.supply - scene.circuit.swing_loss_high,
            output_low=scene.circuit.swing_loss_low - scene.circuit.supply,
            places=ctypes.addressof(self.places),
            n_saved=len(self._saved),
            swing=swing,
            motional=motional,
            log=self._block.ctypes.data,
            log_rows=_POINTS,
            attend=callback(self._attend, engine().fail),
        )
        state = self.state
        named = scene.renamed
        names = named.get("machine.back_emf", "vemf"), "vgain", named.get("drive", "vcommand")
        for k, name in enumerate((*names, "vdac", "voffset")):
            state.names[k].value = name.lower().encode()
        emf, slope, flux = recorder.mechanics.step_outputs[:3]
        state.flux_at_start = flux
        segment = state.segment
        segment.c[0], segment.c[1], segment.end = emf, slope, -np.inf
        self._ahead = Ahead(state.drive, command, self._duration, lambda: state.time)
        state.drive.refill = callback(self._ahead.refill, engine().fail)
        self._ahead.refill()
        state.jump = self._ahead.pieces[0].jump

    def run(self) -> None:
        """Run to ``run.duration``. Raises SimulationFailed with the reason and the time reached."""
        state = self.state
        try:
            engine().transient(self.deck, self)
        finally:
            self._attend()
        if state.status == FMU_FAILED:
            raise self._recorder.failure()
        finished(state, self._time, self._duration)

    def loaded(self, engine: ngspice.Engine) -> None:
        """Pass on the corners of PULSE sources."""
        self._pulses = pass_corners(self.state.pulses, engine, self.deck.edges, self._duration)

    @property
    def steps(self) -> int:
        """Steps that ngspice accepted."""
        return max(0, len(self._log) - 1)

    def log(self) -> dict[str, npt.NDArray[np.float64]]:
        """LOG and the saved vectors (A, V) at the accepted points."""
        return dict(zip((*LOG, *self._saved), self._log.array().T, strict=True))

    def use(self, macro_point: Callable[[], None]) -> None:
        """Call ``macro_point`` at each macro point from now on."""
        called = callback(macro_point, engine().fail)
        self._macro_point = macro_point, called  # keeps both alive; the structure does not
        self.state.macro_point = ctypes.cast(called, ctypes.c_void_p).value

    def _attend(self) -> None:
        """Take the log away."""
        filled = self.state.n_log
        if filled:
            self._time = float(self._block[filled - 1, 0])
        self._log.append(self._block[:filled])
        self.state.n_log = 0
        self._recorder.tell()


def pass_corners(pulses: Any, engine: ngspice.Engine, edges: Edges, duration: float) -> Any:
    """Fill the structure ``pulses`` with the corners of a run's PULSE sources, and give the array
    that must live as long as it does."""
    found = (engine.ask(f"@{name}[pulse]") for name in edges.pulses)
    each = [_pulse(values, duration, edges.length) for values in found if len(values) > 2]
    kept = array(Pulse, each)
    pulses.all, pulses.n, pulses.duration = ctypes.addressof(kept), len(each), duration
    pulses.announce = engine.address("ngSpice_SetBkpt")
    return kept


def _pulse(values: list[float], duration: float, edge: float) -> Any:
    """A PULSE source's corners in a period (s), from ngspice's values (low, high, delay, rise,
    fall, width, period) with ngspice's defaults for those not given: the length of an ``edge``, and
    the run's."""
    given = dict(enumerate(values))
    delay, rise, fall = (given.get(k, 0.0) for k in (2, 3, 4))
    rise, fall = rise or edge, fall or edge
    width = given.get(5) or duration
    period = given.get(6) or 2.0 * (duration + rise + width + fall)
    corners = [0.0, rise, rise + width, rise + width + fall]
    inside = [corner for corner in corners if corner < period]
    pulse = Pulse(delay=delay, period=period, n=len(inside), corner=-1)
    pulse.corners[: len(inside)] = inside
    pulse.previous = pulse.announced = -np.inf
    return pulse


def after_jump(scene: Scene) -> float:
    """Longest step after a jump of the command, s."""
    return min(_AFTER_JUMP / _fineness(scene), _SHARE_AFTER_JUMP * scene.circuit.max_step)


def _fineness(scene: Scene) -> float:
    """The factor by which steps are shorter than at the tolerance _COARSEST."""
    return (_COARSEST / scene.circuit.reltol) ** (1.0 / 3.0)


def engine() -> ngspice.Engine:
    """This process's ngspice, which calls the loop. Raises BadInput."""
    return ngspice.engine(*map(address, ("lead_data", "lead_source", "lead_step")))


def finished(state: Any, reached: float, duration: float) -> None:
    """Raise SimulationFailed where ngspice has only ``reached`` a time (s) before ``duration``, or
    the loop's ``state`` reports an error of the circuit."""
    if state.status == NOT_FINITE:
        raise SimulationFailed(f"The circuit left the range of numbers at t = {state.told:.6g} s.")
    if state.status == UNKNOWN_SOURCE:
        name = state.source.decode().lower()
        raise SimulationFailed(f"The netlist has an external source {name} that nothing feeds.")
    if reached < duration - max(1e-9 * duration, ROUNDING):
        why = engine().said(begun=reached > 0.0)
        told = f"ngspice stopped at t = {reached:.6g} s of {duration:g} s: {why}."
        kind = StepTooSmall if engine().too_small else SimulationFailed
        if reached > 0.0:  # else it has not read the netlist, or found no operating point
            told += (
                " If the circuit is right, a smaller circuit.max_step or another circuit.reltol "
                "may help."
            )
        raise kind(told)
