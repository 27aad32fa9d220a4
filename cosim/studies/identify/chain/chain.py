"""The compiled chain: what the machine does with given numbers, how far that is from measured
trials, and the fit of each trial's own parameters. See ``refine.h`` and
``cosim/stepper/stepper.h``."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from ctypes import addressof, byref, c_longlong
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import SimulationFailed
from cosim.stepper.stepper import LANES, OWN
from cosim.toolchain.libraries import library, structures

OUTPUTS = ("z_surface", "v_surface", "z_part", "v_part", "z_plate")
"""What is simulated, m and m/s."""


_Trial, _Job = (structures("stepper")[name] for name in ("Trial", "Job"))


@dataclass(eq=False)
class Target:
    """What was measured in one trial, as the compiled code takes it.

    ``signals`` hold the measured values by the names of ``OUTPUTS`` at ``time`` (s, from 0 on), NaN
    where nothing is known, and ``weights`` what a squared residual counts, 1/m² or 1/(m/s)²;
    ``differenced`` names the velocities that are made of heights. ``low``, ``high`` and ``scale``
    are of ``OWN``; a parameter whose scale is 0 is not fitted. ``step`` (s) is the longest of the
    simulation; ``current`` (A, at the times) replaces the drive.
    """

    time: Array
    signals: Mapping[str, Array]
    weights: Mapping[str, float]
    differenced: frozenset[str]
    low: Array
    high: Array
    scale: Array
    step: float
    current: Array | None = None
    _state: Any = field(init=False)
    _kept: list[npt.NDArray[Any]] = field(init=False)

    def __post_init__(self) -> None:
        # Each gap between samples is cut into equal steps of at most ``step``. ``edges`` are the
        # ends of all steps; ``sample`` is the number of the sample at an edge, -1 where there is
        # none.
        gaps = np.diff(self.time)
        parts = np.maximum(1, np.ceil(gaps / self.step - 1e-9).astype(np.int64))
        at = np.concatenate([[0], np.cumsum(parts)])
        edges = np.interp(np.arange(at[-1] + 1), at, self.time)
        sample = np.full(len(edges), -1, dtype=np.int32)
        sample[at] = np.arange(len(self.time))
        # A velocity made of heights is their change over two gaps; the first and last have none.
        rate = np.full(len(self.time), np.nan)
        rate[1:-1] = 1.0 / (self.time[2:] - self.time[:-2])
        # The structure has addresses only, so the arrays are kept for as long.
        self._kept = [edges, sample, rate]
        state = _Trial(samples=len(self.time), rate=rate.ctypes.data)
        state.schedule.steps = len(edges) - 1
        state.schedule.edges, state.schedule.sample = edges.ctypes.data, sample.ctypes.data
        if self.current is not None:
            current = np.interp(edges, self.time, self.current)
            self._kept.append(current)
            state.schedule.current = current.ctypes.data
        for k, name in enumerate(OUTPUTS):
            if name not in self.signals:
                continue
            values = np.ascontiguousarray(self.signals[name], dtype=np.float64)
            if name in self.differenced:
                values = np.where(np.isnan(rate), np.nan, values)
            self._kept.append(values)
            state.measured[k] = values.ctypes.data
            state.weight[k] = self.weights.get(name, 0.0)
            state.differenced[k] = int(name in self.differenced)
        for name in ("low", "high", "scale"):
            getattr(state, name)[:] = getattr(self, name).tolist()
        self._state = state

    @property
    def address(self) -> int:
        """Of the compiled code's structure."""
        return addressof(self._state)


def refine(
    targets: Sequence[Target], rigs: Array, own: Array, rounds: int, workers: int
) -> tuple[Array, Array]:
    """Fit own parameters, by ``rounds`` of Gauss–Newton from ``own`` on.

    ``targets`` (n), ``rigs`` (n × RIG) and ``own`` (n × OWN) belong to each other row by row.
    Returns the parameters found (n × OWN) and their costs (n).
    """
    rigs, own = np.ascontiguousarray(rigs), np.array(own, dtype=np.float64, order="C")
    cost = np.empty(len(targets))
    _work(targets, rigs, own, cost, rounds, workers)
    return own, cost


def look_around(
    targets: Sequence[Target], rigs: Array, own: Array, workers: int
) -> tuple[Array, Array]:
    """Costs (n × m) of m sets of own parameters (n × m × OWN) for each target and rig (n × RIG).

    The phases are first moved to where the surface moves as it was measured. Returns the own
    parameters with these, and the costs.
    """
    n, m, _ = own.shape
    # LANES sets run side by side; the last block is filled up with the first set.
    blocks = -(-m // LANES)
    padded = np.concatenate([own, np.repeat(own[:, :1], blocks * LANES - m, axis=1)], axis=1)
    padded = np.ascontiguousarray(padded).reshape(n * blocks, LANES, len(OWN))
    found = np.empty((n * blocks, LANES))
    wide = np.ascontiguousarray(np.repeat(rigs, blocks, axis=0))
    _work([t for t in targets for _ in range(blocks)], wide, padded, found, 0, workers)
    return padded.reshape(n, -1, len(OWN))[:, :m], found.reshape(n, -1)[:, :m]


def _work(
    targets: Sequence[Target], rigs: Array, own: Array, cost: Array, rounds: int, workers: int
) -> None:
    n, done = len(targets), c_longlong(0)
    jobs = np.zeros(n, _Job)
    jobs["trial"], jobs["rounds"] = [target.address for target in targets], rounds
    for name, each in (("rig", rigs), ("own", own), ("cost", cost)):
        # The address of each row: the compiled code works in place.
        jobs[name] = each.ctypes.data + np.arange(n) * each.strides[0]

    def work(_: int) -> int:
        return library("stepper").chain_work(jobs.ctypes.data, n, byref(done))

    threads = range(min(workers, n))
    if len(threads) == 1:
        failed = [work(0)]
    else:
        with ThreadPoolExecutor(len(threads)) as pool:
            failed = [*pool.map(work, threads)]
    if any(failed):
        raise SimulationFailed("There is no memory for the simulation of the trials.")


def simulate(target: Target, rigs: Array, own: Array) -> tuple[dict[str, Array], Array]:
    """What each of n machines (n × RIG, n × OWN) does in a trial.

    Returns the ``OUTPUTS`` (n × samples, m and m/s; velocities are those at the samples) and the
    residuals (n × values), whose squares add up to the cost.
    """
    n, samples = len(rigs), len(target.time)
    found = np.empty((n, len(OUTPUTS), samples))
    signals = [name for name in OUTPUTS if name in target.signals and target.weights.get(name)]
    residuals = np.empty((n, len(signals) * samples))
    out, apart = (np.empty((samples * len(OUTPUTS), LANES)) for _ in range(2))
    for start in range(0, n, LANES):
        # The last block is filled up with the last machine. Lanes are innermost in compiled code.
        rows = np.minimum(np.arange(start, start + LANES), n - 1)
        both = np.ascontiguousarray(np.concatenate([rigs[rows], own[rows]], axis=1).T)
        pointers = (both.ctypes.data, out.ctypes.data, apart.ctypes.data)
        count = library("stepper").chain_look(target.address, *pointers)
        used = slice(start, min(start + LANES, n))
        k = used.stop - used.start
        found[used] = out.reshape(samples, len(OUTPUTS), LANES).transpose(2, 1, 0)[:k]
        residuals[used] = apart[:count].T[:k]
    return {name: found[:, k] for k, name in enumerate(OUTPUTS)}, residuals
