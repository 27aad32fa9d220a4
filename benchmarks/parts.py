"""The cost of coupling: CPU time of a coupled run over that of circuit and mechanics alone.

The circuit alone gets the back-EMF of the coupled run from a table, so that ngspice takes the same
steps; the mechanics alone get the current of the coupled run.
"""

from contextlib import closing
from ctypes import Structure, byref
from typing import Any

import numpy as np

from benchmarks.errors import BRIEF
from cosim.arrays import Array
from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import address, loop
from cosim.drive.command import command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene, load
from cosim.studies.speed.bench import BRIEF_FULL, ratios, take_turns

Log = dict[str, Array]


def measure(rounds: int) -> dict[str, Any]:
    """The ratio on two rungs of the scene `reference`."""
    circuits = {"amplifier": BRIEF, "full": BRIEF_FULL}
    return {
        name: coupled_over_parts(load("reference", settings), rounds)
        for name, settings in circuits.items()
    }


def coupled_over_parts(scene: Scene, rounds: int) -> dict[str, Any]:
    """Spread of the ratio, and the steps of the circuit in the coupled run and alone."""
    log = _coupled(scene).log()
    table = _replay(scene)
    # Each call makes its own instance, as both sides of the ratio need one.
    calls = {
        "coupled": lambda: _coupled(scene),
        "circuit": lambda: _coupled(scene, table),
        "mechanics": lambda: _mechanics(scene, log),
    }
    taken = take_turns(calls, rounds)
    parts = [a + b for a, b in zip(taken["circuit"], taken["mechanics"], strict=True)]
    replayed = _coupled(scene, table).steps
    return {
        **ratios(taken["coupled"], parts),
        "steps": len(log["time"]) - 1,
        "steps_replayed": replayed,
    }


def _coupled(scene: Scene, told: Array | None = None) -> Lead:
    with closing(Mechanics(scene)) as mechanics:
        circuit = Lead(scene, command(scene), Recorder(scene, mechanics, lambda _: None))
        if told is not None:
            replay(circuit, told)
        circuit.run()
        return circuit


def replay(circuit: Lead, told: Array) -> None:
    """Let a circuit run without mechanics. The rows of ``told``, one for each of its steps, are
    back-EMF (V), its slope (V/s) and the next impact (s); the array must outlive the run."""
    circuit.state.macro_point = address("macro_point_replayed")
    circuit.state.replay = told.ctypes.data


def _mechanics(scene: Scene, log: Log) -> None:
    with closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda _: None)
        current = log["i(vemf)"] / scene.coil.count
        recorder.follow(log["time"][1:], current[:-1, np.newaxis], current[1:, np.newaxis])


def _replay(scene: Scene) -> Array:
    """Rows of back-EMF, slope and next impact as the circuit of a coupled run got them after each
    step; the last row is doubled."""
    with closing(Mechanics(scene)) as mechanics:
        lead = Lead(scene, command(scene), Recorder(scene, mechanics, lambda _: None))
        listener = _Listener(lead.state)
        lead.use(listener.macro_point)
        lead.run()
        return np.array([*listener.told, listener.told[-1]])


class _Listener:
    """Records what the method step-locked gives the circuit at each macro point."""

    def __init__(self, state: Structure) -> None:
        self._state = state
        self.told: list[tuple[float, float, float]] = []

    def macro_point(self) -> None:
        loop().macro_point_step_locked(byref(self._state))
        emf, slope, _ = self._state.segment.c
        self.told.append((emf, slope, self._state.impact))
