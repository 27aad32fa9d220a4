"""Against what users would write, on `paper`; each peer as coarse as its error allows."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.simulation.peers import lsoda, naive, ngspice_alone
from cosim.simulation.simulate import simulate
from cosim.studies.bench.sampling import cpu, ratios
from cosim.studies.bench.truth import brief, error, heights, times

Peer = Callable[[int], tuple[list[float], npt.NDArray[np.float64]]]
"""Runs as often as it is told; gives the CPU seconds of each and the part's heights, m."""

LSODA_ERROR = 5e-4
"""The error at which LSODA is compared; below it, it costs only more."""


def compare(rounds: int) -> dict[str, Any]:
    """Spread of each peer's time over ours, with the errors of both."""
    ours = brief()
    found = simulate(ours)
    wanted = error(heights(found.columns))
    rest = [found.columns[name][0] for name in ("z_surface", "z_ram")]

    def all_in_ngspice(reltol: float) -> Peer:
        scene = brief(f"circuit.reltol={reltol}", "circuit.max_step=1e-4")
        return lambda n: _again(lambda: ngspice_alone.run(scene, times()), n)

    def plain_calls(step: float) -> Peer:
        scene = brief(f"circuit.max_step={step}")
        return lambda n: naive.run(scene, times(), n)

    def solve_ivp(rtol: float) -> Peer:
        return lambda n: _again(lambda: lsoda.run(ours, times(), rest, rtol), n)

    peers = {
        "all_in_ngspice_over_ours": (wanted, map(all_in_ngspice, (1e-7, 1e-8, 3e-9))),
        "naive_over_ours": (wanted, map(plain_calls, (3e-5, 2e-5, 1.5e-5, 1e-5))),
        "solve_ivp_over_ours": (LSODA_ERROR, map(solve_ivp, (1e-4, 5e-5, 3e-5))),
    }
    numbers = {}
    for name, (target, settings) in peers.items():
        peer, reached = _coarsest(settings, target)
        theirs, own = [], []
        for _ in range(rounds):
            theirs += peer(1)[0]
            own.append(cpu(lambda: simulate(ours)))
        numbers[name] = {**ratios(theirs, own), "error": wanted, "error_of_peer": reached}
    return numbers


def _coarsest(settings: Iterable[Peer], target: float) -> tuple[Peer, float]:
    """The first peer with an error of at most ``target``, or the last; and its error."""
    tried: list[tuple[Peer, float]] = []
    for peer in settings:
        tried.append((peer, error(peer(1)[1])))
        if tried[-1][1] <= target:
            break
    return tried[-1]


def _again(
    run: Callable[[], tuple[float, npt.NDArray[np.float64]]], rounds: int
) -> tuple[list[float], npt.NDArray[np.float64]]:
    runs = [run() for _ in range(rounds)]
    return [seconds for seconds, _ in runs], runs[-1][1]
