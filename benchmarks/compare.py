"""The time of what users would write, over ours, on the scene `reference`.

Each peer runs at its coarsest setting whose error is no larger than ours.
"""

from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from typing import Any

from benchmarks.errors import brief, error, own_error, times
from benchmarks.peers import lsoda, naive, ngspice_alone
from cosim.arrays import Array
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import cpu, ratios

Peer = Callable[[], tuple[float, Array]]
"""Gives the CPU seconds of a run and the part's heights, m."""

LSODA_ERROR = 5e-4
"""The error at which LSODA is compared: a smaller one only costs more."""


def compare(rounds: int) -> dict[str, Any]:
    """Spread of each peer's time over ours, with the errors of both."""
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
        peer, reached = _coarsest(settings, target)
        theirs, own = [], []
        for _ in range(rounds):
            theirs.append(peer()[0])
            own.append(cpu(lambda: simulate(ours)))
        numbers[name] = {**ratios(theirs, own), "error": wanted, "error_of_peer": reached}
    return numbers


def _coarsest(settings: Sequence[Peer], target: float) -> tuple[Peer, float]:
    """The first peer with an error of at most ``target``, or the last; and its error."""
    reached = inf
    for peer in settings:
        reached = error(peer()[1])
        if reached <= target:
            return peer, reached
    return settings[-1], reached
