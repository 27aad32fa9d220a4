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

    ``own`` (n × targets × m × OWN) has m sets for each of n rigs (n × RIG) and each target.
    Returns the parameters found, in this shape, and their costs (n × targets × m).
    """
    own = np.array(own, dtype=np.float64, order="C")
    cost = np.empty(own.shape[:-1])
    _work(targets, rigs, own, cost, rounds, workers)
    return own, cost


def look_around(
    targets: Sequence[Target], rigs: Array, own: Array, workers: int
) -> tuple[Array, Array]:
    """Costs (n × targets × m) of own parameters, which are shaped as for :func:`refine`.

    Each phase is first shifted to where the simulated surface fits the measured one best, if that
    lowers the cost. Returns the own parameters with these phases, and the costs.
    """
    n, trials, m, _ = own.shape
    # A job simulates LANES sets side by side. The m sets are padded with copies of the first one
    # to whole blocks.
    blocks = -(-m // LANES)
    padding = np.repeat(own[:, :, :1], blocks * LANES - m, axis=2)
    padded = np.concatenate([own, padding], axis=2).reshape(n, trials, blocks, LANES, len(OWN))
    cost = np.empty(padded.shape[:-1])
    _work(targets, rigs, padded, cost, 0, workers)
    padded, cost = padded.reshape(n, trials, -1, len(OWN)), cost.reshape(n, trials, -1)
    return padded[:, :, :m], cost[:, :, :m]


def _work(
    targets: Sequence[Target], rigs: Array, own: Array, cost: Array, rounds: int, workers: int
) -> None:
    """Do a job for each of the rigs (n × RIG), each target, and each row of the third axis of
    ``own`` and ``cost``, which begin with these three axes; both are changed in place.
    ``next_job``, an atomic counter that all threads share, deals out the jobs."""
    rigs, shape = np.ascontiguousarray(rigs), cost.shape[:3]
    jobs, next_job = np.zeros(shape, _Job), c_longlong(0)
    jobs["rounds"] = rounds
    jobs["trial"] = np.array([target.address for target in targets])[:, None]
    jobs["rig"] = (rigs.ctypes.data + np.arange(len(rigs)) * rigs.strides[0])[:, None, None]
    for name, array in (("own", own), ("cost", cost)):  # the address of each row
        rows = np.arange(jobs.size).reshape(shape)
        jobs[name] = array.ctypes.data + rows * array.strides[2]

    def work(_: int) -> int:
        return library("stepper").chain_work(jobs.ctypes.data, jobs.size, byref(next_job))

    with ThreadPoolExecutor(workers) as pool:
        failed = any([*pool.map(work, range(workers))])
    if failed:
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
