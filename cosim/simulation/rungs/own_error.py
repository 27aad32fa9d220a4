"""How far v_average is off by the circuit's steps, told by the run's own history.

While the amplifier's output stands at its limit nothing corrects the coil's current: what the steps
of the circuit lose there, and what the coupling kept from it of the back-EMF, stays. In this state
the current obeys a linear equation whose exact solution is known, so the log of the run tells the
current's error at each of its points. The mechanics alone are then moved twice, with the current as
it was and as it should have been, by its charge in each of equal intervals: the difference of
v_average is the estimate. It costs about a tenth of the run.

Not seen: what the steps lose while the amplifier regulates, where an error of the back-EMF moves
the output and not the current but the amplifier's ringing may be damped; the back-EMF's answer to
the better current; and anything that the mechanics were not told of.
"""

from collections.abc import Iterable
from typing import Self

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.circuit.netlist import limits_at_work
from cosim.coupling.loop.recorder import Recorder
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene
from cosim.simulation.rungs.electrics import Eddy

_INTERVAL = 1e-4
"""s; the mechanics see the mean current of each: shorter than what the ram can follow."""

_TOLERANCE = 1e-7
"""Of the mechanics, at least: far below what the estimate leaves out."""

_STRAIGHT, _TOGETHER = 1e-5, 20
"""Intervals over which the current is straight within this share of its limit are one, so many at
most."""


def own_error(scene: Scene, parts: Iterable[dict[str, Array]], fmi_version: int) -> float | None:
    """Estimated error of v_average, m/s: what it is, less what it should be. ``parts`` is the log
    of a run, each part with the first point of the next one as its last. None where the circuit
    does not tell when its output is at its limit.
    """
    charges = _Charges(scene)
    with _Alone(scene, fmi_version) as run, _Alone(scene, fmi_version) as better:
        for part in parts:
            if "v(swing)" not in part:
                return None
            edges, as_run, lost, first = charges.follow(part)
            if len(first):
                run.follow(edges, as_run, first)
                better.follow(edges, as_run - lost, first)
        return run.v_average() - better.v_average()


class _Charges:
    """Charges of one coil in equal intervals, part of the log after part."""

    def __init__(self, scene: Scene) -> None:
        self._count = scene.coil.count
        self._loop = _Loop(scene)
        steps = max(1, round(scene.run.duration / _INTERVAL))
        self._edges = np.linspace(0.0, scene.run.duration, steps + 1)
        self._next, self._carry = 1, np.zeros(2)
        self._bend = _STRAIGHT * scene.circuit.current_limit * scene.run.duration / steps
        # Intervals whose straights are not known yet, the first one, and the charge before it.
        self._held, self._first, self._before = np.empty((2, 0)), 0, np.nan

    def follow(self, part: dict[str, Array]) -> tuple[Array, Array, Array, npt.NDArray[np.int64]]:
        """Edges of the next intervals, s, with the one before; the charge in each and the part of
        it that is an error, A s; and the places of those intervals with which a straight begins:
        over the ones until the next place the current is straight and right, or there is but one.
        """
        held = np.concatenate([self._held, self._passed(part)], axis=1)
        first, known = self._first, self._first + held.shape[1]
        stop = known
        if known < len(self._edges) - 1:  # straights do not hang on where the log is parted
            stop = max(first, (known - 1) // _TOGETHER * _TOGETHER)
        n = stop - first
        beside = np.concatenate([[self._before], held[0, : n + 1], [np.nan] * (stop == known)])
        bent = ~(np.abs(np.diff(beside, 2)) <= self._bend) | (held[1, :n] != 0.0)
        begins = bent | np.append(True, bent)[:n]
        begins[::_TOGETHER] = True
        if n:
            self._before, self._held, self._first = held[0, n - 1], held[:, n:], stop
        else:
            self._held = held
        return self._edges[first : stop + 1], held[0, :n], held[1, :n], np.flatnonzero(begins)

    def _passed(self, part: dict[str, Array]) -> Array:
        """Charges and their errors in the intervals that end in this part."""
        time = part["time"]
        current = part["i(vemf)"] / self._count
        errors = self._loop.follow(part, current)
        stop = int(np.searchsorted(self._edges, time[-1] * (1.0 + 1e-9), side="right"))
        edges = self._edges[self._next : stop]
        h, passed = np.diff(time), []
        step = np.clip(np.searchsorted(time, edges) - 1, 0, len(h) - 1)
        since = edges - time[step]
        for k, values in enumerate((current, errors)):
            rise = np.diff(values)
            sums = np.concatenate([[0.0], np.cumsum(h * (values[:-1] + 0.5 * rise))])
            # Within a step the values go straight.
            at = sums[step] + since * (values[step] + 0.5 * since * rise[step] / h[step])
            passed.append(np.diff(np.concatenate([[-self._carry[k]], at])))
            self._carry[k] = sums[-1] - (at[-1] if len(at) else -self._carry[k])
        self._next = stop
        return np.stack(passed)


class _Loop:
    """Coil and sense resistor at a given output voltage V, whose current is i: x' = A x + b (V - e)
    with x = i or, with an eddy branch, x = (i, i_2); in modes that do not know of each other. In a
    netlist of the user's own it is the coil alone, at the voltage between its ends.
    """

    def __init__(self, scene: Scene) -> None:
        coil = scene.coil
        self._eddy = Eddy(scene)
        self._coil_alone = scene.circuit.netlist is not None
        sense = 0.0 if self._coil_alone else scene.circuit.sense_resistance
        matrix = [[-(coil.resistance + coil.count * sense)]]
        inductances = [[coil.inductance]]
        if coil.eddy_inductance:
            branch = self._eddy.resistance
            matrix = [[matrix[0][0] - branch, branch], [branch, -branch]]
            inductances = [*inductances, [coil.eddy_inductance]]
        self._rates, vectors = np.linalg.eig(np.array(matrix) / inductances)
        self._modes, self._of_current = np.linalg.inv(vectors), vectors[0]
        self._drive = self._modes[:, 0] / coil.inductance
        self._error, self._limited = np.zeros(len(self._rates)), False

    def follow(self, part: dict[str, Array], current: Array) -> Array:
        """The error of the current (A) at each point of this part, 0 where the output is free."""
        h = np.diff(part["time"])
        branch = self._eddy.follow(h, current[:-1], current[1:])
        states = [current] if branch is None else [current, np.append(branch, self._eddy.current)]
        modes = self._modes @ np.stack(states)
        output = part["v(out)"] - (part["v(sense)"] if self._coil_alone else 0.0)
        volts = [0.5 * (values[1:] + values[:-1]) for values in (output, part["emf"])]
        forced = volts[0] - volts[1] - np.diff(part["owed"]) / h
        decay = np.exp(np.outer(self._rates, h))
        exact = decay * modes[:, :-1] + np.outer(self._drive / self._rates, forced) * (decay - 1.0)
        lost = modes[:, 1:] - exact
        limits = limits_at_work(part)
        limited = limits["swing_high"] | limits["swing_low"]
        steps = np.flatnonzero(limited[1:] & limited[:-1]).tolist()
        errors = np.zeros((len(self._rates), len(current)))
        for mode, last in enumerate(self._error.tolist()):
            found, kept, added = [last] + [0.0] * len(h), decay[mode].tolist(), lost[mode].tolist()
            for k in steps:
                found[k + 1] = kept[k] * found[k] + added[k]
            errors[mode] = found
        self._error = errors[:, -1]
        return self._of_current @ errors


class _Alone:
    """The mechanics of a scene, moved by given charges."""

    def __init__(self, scene: Scene, fmi_version: int) -> None:
        # Nothing is written down but where settling ends.
        rare = scene.run.model_copy(update={"output_step": scene.run.duration})
        self._run = rare
        tolerance = max(scene.mechanics.tolerance, _TOLERANCE)
        mechanics = scene.mechanics.model_copy(update={"tolerance": tolerance})
        alone = scene.model_copy(update={"run": rare, "mechanics": mechanics})
        self._mechanics = Mechanics(alone, fmi_version)
        try:
            self._recorder = Recorder(alone, self._mechanics, lambda _: None)
        except BaseException:
            self._mechanics.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._mechanics.close()

    def follow(self, edges: Array, charges: Array, first: npt.NDArray[np.int64]) -> None:
        """Go on through the equal intervals between the edges, s, with the charge (A s) of each;
        from each of the places ``first`` until before the next with a straight current."""
        stop = np.append(first[1:], len(charges))
        mean = np.add.reduceat(charges, first) / (edges[stop] - edges[first])
        # The means of the first and the last interval lie nearer than the straight's ends.
        count = stop - first
        rise = (charges[stop - 1] - charges[first]) / (edges[1] - edges[0])
        half = 0.5 * rise * count / np.maximum(count - 1, 1)
        start, end = (mean - half)[:, np.newaxis], (mean + half)[:, np.newaxis]
        self._recorder.follow(edges[stop], start, end)

    def v_average(self) -> float:
        """At the end, m/s."""
        passed = self._mechanics.totals()["z_part"] - self._recorder.at_settle["z_part"]
        return passed / (self._run.duration - self._run.settle)
