"""What the coupling itself costs: a coupled run over the sum of its two parts, each alone.

The circuit alone replays the back-EMF of the coupled run from a table, so that ngspice takes the
same steps; the mechanics alone replay its current.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.drive.command import command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.studies.bench.sampling import ratios, take_turns

Log = dict[str, npt.NDArray[np.float64]]


def coupled_over_parts(scene: Scene, rounds: int) -> dict[str, Any]:
    """Spread of the ratio, and how many steps both circuits took."""
    log = _coupled(scene).log()
    replay = _replay(scene, log)
    # Each call makes its own instance, as both sides of the ratio need one.
    steps = {}

    def circuit() -> None:
        steps["replayed"] = _coupled(scene, replay).steps

    taken = take_turns(
        {
            "coupled": lambda: _coupled(scene),
            "circuit": circuit,
            "mechanics": lambda: _mechanics(scene, log),
        },
        rounds,
    )
    parts = [a + b for a, b in zip(taken["circuit"], taken["mechanics"], strict=True)]
    return {
        **ratios(taken["coupled"], parts),
        "steps": len(log["time"]) - 1,
        "steps_replayed": steps["replayed"],
    }


def _coupled(scene: Scene, replay: npt.NDArray[np.float64] | None = None) -> Lead:
    mechanics = Mechanics(scene)
    try:
        recorder = Recorder(scene, mechanics, lambda _: None)
        circuit = Lead(scene, command(scene), recorder, replay=replay)
        circuit.run()
        return circuit
    finally:
        mechanics.close()


def _mechanics(scene: Scene, log: Log) -> None:
    mechanics = Mechanics(scene)
    try:
        recorder = Recorder(scene, mechanics, lambda _: None)
        current = log["i(vemf)"] / scene.coil.count
        recorder.follow(log["time"][1:], current[:-1, np.newaxis], current[1:, np.newaxis])
    finally:
        mechanics.close()


def _replay(scene: Scene, log: Log) -> npt.NDArray[np.float64]:
    """Back-EMF and its slope after each step; with one to spare."""
    mechanics = Mechanics(scene)
    try:
        recorder = Recorder(scene, mechanics, lambda _: None)
        current = (log["i(vemf)"] / scene.coil.count).tolist()
        pairs = []
        for k, time in enumerate(log["time"].tolist()[1:]):
            recorder.advance(time, current[k], current[k + 1])
            pairs.append(mechanics.step_outputs[:2])
        return np.array([*pairs, pairs[-1]])
    finally:
        mechanics.close()
