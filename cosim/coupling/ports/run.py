"""One run of a circuit that ngspice leads, joined to FMUs; the steps are those of ``ports.c``."""

import ctypes
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int64

import numpy as np

from cosim.circuit import ngspice
from cosim.coupling.loop.lead import after_jump, engine, finished, pass_corners
from cosim.coupling.loop.structures import (
    FMU_FAILED,
    NO_AGREEMENT,
    Back,
    PortsState,
    Slope,
    Source,
    StrangerState,
    Through,
    array,
    callback,
)
from cosim.coupling.ports.plan import Plan
from cosim.drive.command import command
from cosim.drive.pieces import Ahead
from cosim.errors import SimulationFailed, plain
from cosim.files.spill import Tape
from cosim.scene import Scene
from cosim.toolchain.serving import end_used

_POINTS = 2048
"""Points that the blocks of the logs hold before they are emptied."""

ENOUGH, BEGINNING, BUDGET = 1_000_000, 10_000_000, 1e9
"""Steps from which on a run is judged, from which on it no longer is, and that it may take in all
(hours)."""

ORDINARY = 1000
"""Ratio of steps to those that ``circuit.max_step`` asks for which is always allowed."""

_AGREEMENT = 2.0
"""Largest difference between FMU and ngspice where steps are repeated, over ``circuit.reltol``."""

_WRONG = 12
"""As in ports.c: so many changes that disagree with the reported slope make it wrong."""

_DISCARDED = 2
"""Status of an FMU that does not make a step."""

_ONE_LENGTH = (
    "one that takes steps of one length alone needs coupling.method = "
    '"macro-steps", with a coupling.macro_step that is a whole number of them'
)

_STATUSES = {
    _DISCARDED: "it discards the step, or asks to end the run",
    3: "it has an error, and does not say which",
    4: "it has a fatal error, and does not say which",
    5: "it goes on with the step in the background, for which nobody waits",
}
"""Words for the status of an FMU's call, used where the FMU gives no message."""


class Run(ngspice.Leader):
    """A run under way, and its logs."""

    kind = "ports"

    def __init__(self, scene: Scene, progress: Callable[[float], None]) -> None:
        self._scene, self._progress = scene, progress
        end_used()  # ends instances of earlier runs: an FMU may allow one instance at a time
        self.plan = plan = Plan(scene)
        self.deck = plan.deck()
        self._failure: BaseException | None = None
        count, width = len(self.deck.vectors), plan.width
        self.places = array(c_int64, length=count + 1)
        self._rows = [array(c_double, length=width) for _ in range(3)]
        self._saved = [array(c_double, length=count) for _ in range(4)]
        self._sources = array(Source, plan.sources)
        self._asked = array(c_char_p, [each.encode() or None for each in self.deck.devices])
        self.log = Tape(1 + len(plan.sources) + count)
        """Time (s), each source and each saved value at the accepted points."""
        self.points = Tape(1 + width)
        """Time (s) and the outputs of all FMUs at the communication points."""
        self._blocks = [np.zeros((_POINTS, 1 + len(plan.sources) + count))]
        self._blocks.append(np.zeros((_POINTS, 1 + width)))
        repeats = plan.method == "redo"
        rows, saved = (list(map(ctypes.addressof, each)) for each in (self._rows, self._saved))
        states = [side.state(rows[0] + 8 * side.first, repeats) for side in plan.sides]
        self.fmus = array(StrangerState, states)
        for through, feed in plan.throughs:
            through.input = feed.input
        self._throughs = array(Through, [through for through, _ in plan.throughs])
        self.odd = array(c_double, length=2 * width)
        """For each output: not 0 if a repeated step gave another value; then working space."""
        self._backs = array(Back, length=width)
        for place in plan.backs:
            self._backs[place].is_one = 1
        slopes = [Slope(place=of.place, slope=of.slope_place) for *_, of in plan.told]
        self._slopes = array(Slope, slopes)
        macro = scene.coupling.macro_step if plan.method == "macro-steps" else 0.0
        self.state = PortsState(
            fmus=ctypes.addressof(self.fmus),
            n_fmus=len(states),
            sources=ctypes.addressof(self._sources),
            n_sources=len(plan.sources),
            **dict(zip(("outputs", "before", "rates"), rows, strict=True)),
            n_outputs=width,
            **dict(zip(("now", "last", "start", "charges"), saved, strict=True)),
            places=ctypes.addressof(self.places),
            n_saved=count,
            driven=int(plan.driven),
            macro_step=macro,
            ends=int(not plan.circle),
            fixed=int(any(not side.varies for side in plan.sides)),
            duration=scene.run.duration,
            after_jump=after_jump(scene),
            end=-np.inf,
            repeats=int(repeats),
            throughs=ctypes.addressof(self._throughs),
            n_throughs=len(plan.throughs),
            slopes=ctypes.addressof(self._slopes),
            n_slopes=len(slopes),
            odd=ctypes.addressof(self.odd),
            backs=ctypes.addressof(self._backs),
            tolerance=_AGREEMENT * scene.circuit.reltol,
            asked=ctypes.addressof(self._asked),
            n_probed=len(plan.probes),
            log=self._blocks[0].ctypes.data,
            points=self._blocks[1].ctypes.data,
            log_rows=_POINTS,
            attend=callback(self._attend_and_judge, engine().fail),
        )
        state = self.state
        self._ahead = Ahead(state.drive, command(scene), scene.run.duration, lambda: state.origin)
        state.drive.refill = callback(self._ahead.refill, engine().fail)
        self._ahead.refill()

    def run(self) -> None:
        """Run to ``run.duration``. Raises SimulationFailed with the reason and the time reached."""
        state, duration = self.state, self._scene.run.duration
        self._progress(0.0)  # the FMUs are instantiated
        try:
            engine().transient(self.deck, self)
        finally:
            self._attend()
            for side, state_of in zip(self.plan.sides, self.fmus, strict=False):
                side.saved = state_of.state
        if state.status == FMU_FAILED:
            raise self._fmu_failure()
        self._refuse_what_is_said_wrongly()
        self._refuse_what_is_no_number()
        if state.status == NO_AGREEMENT:
            raise SimulationFailed(
                f"Circuit and FMUs do not agree at t = {state.told:.6g} s, however often the step "
                "is repeated; a smaller circuit.max_step may help."
            )
        finished(state, float(self.log.column()[-1]) if len(self.log) else 0.0, duration)

    @property
    def steps(self) -> int:
        """Steps that ngspice accepted."""
        return max(0, len(self.log) - 1)

    def _refuse_what_is_no_number(self) -> None:
        """Raise SimulationFailed for an output that is not finite: ngspice stops at it, too, but
        would only report its own steps."""
        for _, name, place, read in self.plan.outputs():
            if read and not np.isfinite(self._rows[0][place]):
                raise SimulationFailed(
                    f"The output {name} is not a finite number at t = {self.state.time:.6g} s: the "
                    "FMU has failed, or the circuit has given it values without bound."
                )

    def _refuse_what_is_said_wrongly(self) -> None:
        """Raise BadInput for an FMU that does not behave as it declares."""
        for side, name, place, read in self.plan.outputs():
            if read and self.odd[place]:
                raise side.of.bad(
                    f"a step repeated from a saved state gives another {name}, so it does not "
                    'restore its state; take coupling.method = "step-locked"'
                )
        for (side, name, _), told in zip(self.plan.told, self._slopes, strict=False):
            if told.wrong >= _WRONG:
                words = 'does not change by its slope; take slope = "difference"'
                raise side.of.bad(f'[[port]] from = "{name}": it {words}')

    def _fmu_failure(self) -> SimulationFailed:
        side = self.plan.sides[self.state.failed]
        status = side.fmu.status
        said = side.instance.messages or [_STATUSES.get(status, f"status {status}")]
        words = plain(said[-1].strip().rstrip("."), 400)
        cure = f"; {_ONE_LENGTH}" if status == _DISCARDED else ""
        return SimulationFailed(
            f"The FMU {side.name} failed at t = {self.state.told:.6g} s: {words}{cure}."
        )

    def loaded(self, engine: ngspice.Engine) -> None:
        """Pass on the addresses of ngspice's functions, and the corners of PULSE sources."""
        state = self.state
        state.command = engine.address("ngSpice_Command")
        state.ask = engine.address("ngGet_Vec_Info")
        state.plot = engine.address("ngSpice_CurPlot")
        self._pulses = pass_corners(state.pulses, engine, self.deck.edges, self._scene.run.duration)

    def _attend(self) -> None:
        """Take the logs away."""
        state = self.state
        self.log.append(self._blocks[0][: state.n_log])
        self.points.append(self._blocks[1][: state.n_points])
        state.n_log = state.n_points = 0
        self._progress(state.time)

    def _attend_and_judge(self) -> None:
        """Take the logs away, and end a run whose steps have become too short ever to reach its
        end, as with `redo` at an FMU whose outputs jump again and again."""
        self._attend()
        self._refuse_what_is_said_wrongly()
        steps, time, duration = self.steps, self.state.time, self._scene.run.duration
        often = steps * self._scene.circuit.max_step > ORDINARY * time
        if often and ENOUGH < steps < BEGINNING and steps * duration > BUDGET * time:
            raise SimulationFailed(
                f"The steps are too short to come to an end: {steps} until t = {time:.3g} s of "
                f"{duration:g} s. A node may ring undamped; where coupling.method is "
                '"redo", an FMU\'s outputs may jump without end.'
            )
