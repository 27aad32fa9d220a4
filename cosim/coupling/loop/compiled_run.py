"""The compiled twin of a run of a circuit: ngspice calls `native/circuit.c`, and that the FMU.

The same arithmetic in the same order as :mod:`cosim.coupling.loop.run` and
:mod:`cosim.coupling.loop.step_locked`, so the same bits. Python prepares the command in blocks of
pieces and takes the log away in blocks. The structures here have the fields of `circuit.c`.
"""

import ctypes
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_char, c_double, c_int64, c_void_p
from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.circuit.ngspice import engine
from cosim.coupling.loop.compiled import BLOCK, CompiledRecorder, State
from cosim.coupling.loop.run import CircuitRun, out_of_range, unknown_source
from cosim.coupling.loop.step_locked import StepLocked
from cosim.drive.command import Command
from cosim.scene import Scene
from cosim.scene.firmware import GAIN

_PIECES = 512
"""How many pieces of the command are prepared at a time."""

PIECE = np.dtype(
    [
        ("begin", float),
        ("until", float),
        ("kind", np.int64),
        *((name, float) for name in ("origin", "rate", "span", "offset", "amplitude")),
        *((name, float) for name in ("dac", "pin")),
        *((name, float) for name in ("jump", "command_before", "dac_before", "pin_before")),
    ]
)

_CALLBACK = CFUNCTYPE(None)

GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE = range(4)


class Circuit(ctypes.Structure):
    """``Circuit`` of circuit.c."""

    _fields_ = (
        ("recorder", POINTER(State)),
        ("replay", c_void_p),
        ("pieces", c_void_p),
        ("n_pieces", c_int64),
        ("piece", c_int64),
        ("gain", c_double),
        ("v_offset", c_double),
        ("count", c_double),
        ("after_jump", c_double),
        *((name, c_double) for name in ("time", "current", "emf", "slope")),
        *((name, c_double) for name in ("jump", "command_before", "dac_before", "pin_before")),
        ("told", c_double),
        ("sent", c_double),
        ("places", POINTER(c_int64)),
        ("n_saved", c_int64),
        ("log", c_void_p),
        *((name, c_int64) for name in ("n_log", "log_rows", "logged", "attempts", "quiet")),
        ("status", c_int64),
        ("stopped", c_int64),
        ("source", c_char * 64),
        ("refill", _CALLBACK),
        ("attend", _CALLBACK),
    )


class CompiledRun(CircuitRun):
    """A run without Python in its steps.

    With ``replay``, pairs of back-EMF (V) and slope (V/s) after each step, there are no mechanics:
    the circuit takes the steps of the run that these are from.
    """

    def __init__(
        self,
        scene: Scene,
        command: Command,
        recorder: CompiledRecorder,
        replay: npt.NDArray[np.float64] | None = None,
    ) -> None:
        super().__init__(scene, command, StepLocked(recorder))
        self._recorder = recorder
        self._replay = replay
        saved = len(self._saved)
        self._block = np.empty((BLOCK, 2 + saved))
        self._places = (c_int64 * (saved + 1))()
        self._pieces = np.empty(0, PIECE)
        emf, slope = recorder.mechanics.step_outputs[:2]
        self._state = Circuit(
            recorder=ctypes.pointer(recorder.state),
            replay=None if replay is None else replay.ctypes.data,
            gain=GAIN,
            v_offset=command.v_offset,
            count=self._count,
            after_jump=self._after_jump,
            emf=emf,
            slope=slope,
            places=self._places,
            n_saved=saved,
            log=self._block.ctypes.data,
            log_rows=BLOCK,
            # The structure holds no reference to what it calls.
            refill=self._callback(self._refill),
            attend=self._callback(self._attend),
        )
        self._refill()

    def _lead(self) -> None:
        state = self._state
        try:
            engine().run_compiled(self._deck, self._saved, state, self._places)
        finally:
            self._attend()
            self._recorder.finish()
            self.attempts = state.attempts
        if state.status == FMU_FAILED:
            raise self._recorder.failure()
        if state.status == NOT_FINITE:
            raise out_of_range(state.told)
        if state.status == UNKNOWN_SOURCE:
            raise unknown_source(state.source.decode().lower())

    def _callback(self, act: Callable[[], None]) -> Any:
        def called() -> None:
            # An exception cannot pass through C.
            try:
                act()
            except BaseException as failure:
                engine().fail(failure)

        return _CALLBACK(called)

    def _attend(self) -> None:
        """Take the log away."""
        filled = self._state.n_log
        if filled:
            self._time = float(self._block[filled - 1, 0])
        self._log.append(self._block[:filled])
        self._state.n_log = 0
        self._recorder.tell()

    def _refill(self) -> None:
        """Keep the pieces that are still needed, and prepare those that follow them."""
        command, state = self._command, self._state
        kept = self._pieces[self._pieces["until"] > state.time]
        begin = float(self._pieces["until"][-1]) if len(self._pieces) else 0.0
        pieces: list[tuple[float, ...]] = []
        while len(pieces) < _PIECES and begin <= self._scene.run.duration:
            until, kind, offset, amplitude, origin, rate, span = command.piece(begin)
            jump = command.next_jump(begin)
            pieces.append(
                (
                    *(begin, until, kind, origin, rate, span, offset, amplitude),
                    *(command.v_dac(begin), command.v_offset_at(begin), jump),
                    *_before(command, jump),
                )
            )
            begin = until
        self._pieces = np.concatenate([kept, np.array(pieces, PIECE)])
        state.pieces, state.n_pieces = self._pieces.ctypes.data, len(self._pieces)
        state.piece = 0


def _before(command: Command, jump: float) -> tuple[float, float, float]:
    """Left limits at a jump, V, of the command, the DAC and the offset pin."""
    if not isfinite(jump):
        return 0.0, 0.0, 0.0
    return command.value_before(jump), command.v_dac_before(jump), command.v_offset_before(jump)
