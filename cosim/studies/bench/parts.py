"""The cost of the coupling itself: a coupled run over the circuit alone plus the mechanics alone.

The circuit alone gets the back-EMF of the coupled run from a table, so that ngspice takes the same
steps; the mechanics alone get its current.
"""

from contextlib import closing
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.studies.bench.measures import ratios, take_turns

Log = dict[str, npt.NDArray[np.float64]]


def coupled_over_parts(scene: Scene, rounds: int) -> dict[str, Any]:
    """Spread of the ratio, and how many steps both circuits took."""
    log = _coupled(scene).log()
    replay = _replay(scene, log)
    # Each call makes its own instance, as both sides of the ratio need one.
    calls = {
        "coupled": lambda: _coupled(scene),
        "circuit": lambda: _coupled(scene, replay),
        "mechanics": lambda: _mechanics(scene, log),
    }
    taken = take_turns(calls, rounds)
    parts = [a + b for a, b in zip(taken["circuit"], taken["mechanics"], strict=True)]
    replayed = _coupled(scene, replay).steps
    return {
        **ratios(taken["coupled"], parts),
        "steps": len(log["time"]) - 1,
        "steps_replayed": replayed,
    }


def _coupled(scene: Scene, replay: npt.NDArray[np.float64] | None = None) -> Lead:
    with closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda _: None)
        circuit = Lead(scene, command(scene), recorder, replay=replay)
        circuit.run()
        return circuit


def _mechanics(scene: Scene, log: Log) -> None:
    with closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda _: None)
        current = log["i(vemf)"] / scene.coil.count
        recorder.follow(log["time"][1:], current[:-1, np.newaxis], current[1:, np.newaxis])


def _replay(scene: Scene, log: Log) -> npt.NDArray[np.float64]:
    """Back-EMF and its slope after each step, the last one twice."""
    with closing(Mechanics(scene)) as mechanics:
        recorder = Recorder(scene, mechanics, lambda _: None)
        current = (log["i(vemf)"] / scene.coil.count).tolist()
        pairs = []
        for k, time in enumerate(log["time"].tolist()[1:]):
            recorder.exchange(time, current[k], current[k + 1], current[k + 1])
            pairs.append(mechanics.step_outputs[:2])
        return np.array([*pairs, pairs[-1]])
