"""CPU time of programs that users might write ("peers") over ours, on the scenes `reference` and
`dc-motor`. Each peer runs at its coarsest setting whose error is at most ours, or at its best one.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.errors import brief, error, own_error, times
from benchmarks.peers import lsoda, naive, ngspice_alone
from cosim.arrays import Array
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import cpu, ratios

Peer = Callable[[], tuple[float, Array]]
"""Runs a peer; returns the CPU time, s, and the part's heights, m, or the motor's speed."""

LSODA_ERROR = 5e-4
"""The error at which LSODA is compared, larger than ours: a smaller one only costs more."""


def compare(rounds: int) -> dict[str, Any]:
    """Spread of the ratio of each peer's time to ours, and the errors of both."""
    ours, wanted = brief(), own_error("amplifier", "amplifier")

    in_ngspice = (brief(f"circuit.reltol={x}", "circuit.max_step=1e-4") for x in (1e-7, 1e-8, 3e-9))
    plain = (brief(f"circuit.max_step={x}") for x in (3e-5, 2e-5, 1.5e-5, 1e-5))
    peers = {
        "all_in_ngspice_over_ours": (
            wanted,
            [partial(ngspice_alone.run, scene, times()) for scene in in_ngspice],
        ),
        "naive_over_ours": (wanted, [partial(naive.run, scene, times()) for scene in plain]),
        "solve_ivp_over_ours": (
            LSODA_ERROR,
            [partial(lsoda.run, ours, times(), rtol) for rtol in (1e-4, 5e-5, 3e-5)],
        ),
    }
    numbers = {}
    for name, (target, settings) in peers.items():
        numbers[name] = {**_over(ours, settings, error, target, rounds), "error": wanted}
    return numbers | {"naive_motor_over_ours": _motor(rounds)}


def _motor(rounds: int) -> dict[str, Any]:
    """The ratio on the scene `dc-motor`, up to the change of its bridge's duty. Errors are of the
    speed, over its range, against our own run with steps 50 times shorter."""

    def scene(step: float, reltol: float = 1e-7) -> Scene:
        steps = {"circuit.max_step": step, "circuit.reltol": reltol}
        return load("dc-motor", {"run.duration": 0.1, "run.output_step": 1e-4, **steps})

    ours = scene(5e-6)
    found, true = (simulate(each).columns for each in (ours, scene(1e-7)))
    speed = true["gear.speed"]

    def off(path: Array) -> float:
        return float(np.abs(path - speed).max() / np.ptp(speed))

    plain = (scene(step) for step in (5e-6, 2e-6, 1e-6, 5e-7))
    settings = [partial(naive.run_motor, each, true["time"].tolist()) for each in plain]
    wanted = off(found["gear.speed"])
    return {**_over(ours, settings, off, wanted, rounds), "error": wanted}


def _over(
    ours: Scene,
    settings: Sequence[Peer],
    error: Callable[[Array], float],
    target: float,
    rounds: int,
) -> dict[str, Any]:
    """The spread of the ratio of a peer's time to ours, and the peer's error, at the first of its
    settings whose error is at most ``target``, or else at the one with the least error."""
    reached = []
    for peer in settings:
        reached.append(error(peer()[1]))
        if reached[-1] <= target:
            break
    best = int(np.argmin(reached))
    theirs, own = [], []
    for _ in range(rounds):
        theirs.append(settings[best]()[0])
        own.append(cpu(lambda: simulate(ours)))
    return {**ratios(theirs, own), "error_of_peer": reached[best]}
