"""The compiled chain: it simulates trials of a machine, compares them with the measurement, and
fits each trial's own parameters. See ``refine.h`` and ``cosim/stepper/stepper.h``."""

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

    ``signals`` are the measured values, by the names of ``OUTPUTS``, at ``time`` (s, from 0 on),
    NaN where unknown; ``weights`` are the factors on their squared residuals, 1/m² or 1/(m/s)²;
    ``differenced`` names the velocities that were calculated from heights. ``low``, ``high`` and
    ``scale`` have an element for each of ``OWN``; a parameter whose scale is 0 is not fitted. The
    simulation's steps are at most ``step`` (s) long; a measured ``current`` (A, at the times)
    replaces the drive.
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
        # A differenced velocity is the change of height over two gaps; at both ends it is unknown.
        rate = np.full(len(self.time), np.nan)
        rate[1:-1] = 1.0 / (self.time[2:] - self.time[:-2])
        # The structure holds bare addresses, so these references keep the arrays alive.
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
        """The address of the compiled code's structure of this trial."""
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

    Each phase is first shifted to where the simulated surface fits the measured one best, if that
    lowers the cost. Returns the own parameters with these phases, and the costs.
    """
    n, m, _ = own.shape
    # A job simulates LANES sets side by side. The m sets of each target are padded with copies of
    # the first one to whole blocks, which become rows: n blocks × LANES × OWN.
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
    """Do a job for each row of ``rigs``, ``own`` and ``cost``; the last two are changed in place.
    ``next_job``, an atomic counter that all threads share, deals out the jobs."""
    n, next_job = len(targets), c_longlong(0)
    jobs = np.zeros(n, _Job)
    jobs["trial"], jobs["rounds"] = [target.address for target in targets], rounds
    for name, array in (("rig", rigs), ("own", own), ("cost", cost)):
        jobs[name] = array.ctypes.data + np.arange(n) * array.strides[0]  # the address of each row

    def work(_: int) -> int:
        return library("stepper").chain_work(jobs.ctypes.data, n, byref(next_job))

    threads = range(min(workers, n))
    if len(threads) == 1:
        failed = [work(0)]
    else:
        with ThreadPoolExecutor(len(threads)) as pool:
            failed = [*pool.map(work, threads)]
    if any(failed):
        raise SimulationFailed("There is no memory for the simulation of the trials.")


def simulate(target: Target, rigs: Array, own: Array) -> tuple[dict[str, Array], Array]:
    """Simulate a trial on each of n machines (n × RIG, n × OWN).

    Returns the ``OUTPUTS`` (n × samples each, m and m/s; velocities are instantaneous, not
    differenced) and the residuals (n × values), whose squares add up to the cost.
    """
    n, samples = len(rigs), len(target.time)
    found = np.empty((n, len(OUTPUTS), samples))
    signals = [name for name in OUTPUTS if name in target.signals and target.weights.get(name)]
    residuals = np.empty((n, len(signals) * samples))
    out, weighted = (np.empty((samples * len(OUTPUTS), LANES)) for _ in range(2))
    for start in range(0, n, LANES):
        # The last block is padded with copies of the last machine. Lanes are the innermost index in
        # compiled code: ``both`` is (RIG + OWN) × LANES, ``out`` samples × OUTPUTS × LANES.
        rows = np.minimum(np.arange(start, start + LANES), n - 1)
        both = np.ascontiguousarray(np.concatenate([rigs[rows], own[rows]], axis=1).T)
        pointers = (both.ctypes.data, out.ctypes.data, weighted.ctypes.data)
        count = library("stepper").chain_look(target.address, *pointers)
        used = slice(start, min(start + LANES, n))
        k = used.stop - used.start
        found[used] = out.reshape(samples, len(OUTPUTS), LANES).transpose(2, 1, 0)[:k]
        residuals[used] = weighted[:count].T[:k]
    return {name: found[:, k] for k, name in enumerate(OUTPUTS)}, residuals
