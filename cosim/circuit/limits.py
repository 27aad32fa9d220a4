"""The share of each time step during which the amplifier's limits act."""

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array

_NODES = {"swing": ("v(swing)", "v(out)"), "current_limit": ("v(climit)", "i(vemf)")}
"""For each limit its node, which falls about linearly to 0 while the limit ceases to act, and the
quantity that it limits, which approaches its limit about linearly."""


def shares_of_steps(log: dict[str, Array], least: float) -> dict[str, Array]:
    """The share of each step of the log in which each known limit acts, by name, and ``output`` for
    any of them but the slew rate, if the swing is known. A limit acts while the magnitude of its
    node is at least ``least``, V.

    Where a limit begins or ends within a step, the line through the two points before is continued:
    it begins when the limited quantity reaches its value at the step's end, and ends when the node
    falls to ``least``. Without such a crossing, as for a node of two values, a step counts half.
    """
    found: dict[str, Array] = {}
    time = log["time"]
    for name, acts in _at_work(log, least).items():
        # A step lies between two points of the log. It counts whole where the limit acts at both,
        # half where it acts at one; the extrapolation below improves on the half.
        shares = 0.5 * acts[1:] + 0.5 * acts[:-1]
        kind = name.removesuffix("_high").removesuffix("_low")
        if kind in _NODES:
            node, held = (log[vector] for vector in _NODES[kind])
            # First points of the steps in which it begins (off, off, on) or ends (on, on, off).
            begins = np.flatnonzero(~acts[:-2] & ~acts[1:-1] & acts[2:]) + 1
            ends = np.flatnonzero(acts[:-2] & acts[1:-1] & ~acts[2:]) + 1
            shares[begins] = 1.0 - _place(time, held, begins, held[begins + 1])
            shares[ends] = _place(time, np.abs(node), ends, np.full(len(ends), least))
        found[name] = shares
    at_limit = [shares for name, shares in found.items() if name != "slew"]
    if "v(swing)" in log:
        found["output"] = np.minimum(np.sum(at_limit, axis=0), 1.0)
    return found


def _place(time: Array, values: Array, steps: npt.NDArray[np.int64], goal: Array) -> Array:
    """The share of each step after which the values reach the goal, extrapolated with the slope of
    the step before; a half where they move away from it."""
    slope = (values[steps] - values[steps - 1]) / (time[steps] - time[steps - 1])
    needed, possible = goal - values[steps], slope * (time[steps + 1] - time[steps])
    place = np.full(len(steps), 0.5)
    np.divide(needed, possible, out=place, where=needed * possible > 0.0)
    return np.minimum(place, 1.0)


def _at_work(log: dict[str, Array], least: float) -> dict[str, npt.NDArray[np.bool_]]:
    """By the name of each limit with a node in the log: whether it acts, at each point."""
    nothing = np.zeros(len(log["time"]))
    known: dict[str, npt.NDArray[np.bool_]] = {}
    limited = np.abs(log.get("v(climit)", nothing)) >= least
    swing = log.get("v(swing)", nothing)
    if "v(swing)" in log:
        known["swing_high"] = (swing >= least) & ~limited
        known["swing_low"] = (swing <= -least) & ~limited
    if "v(climit)" in log:
        known["current_limit"] = limited
    if "v(slewing)" in log:
        known["slew"] = (np.abs(log["v(slewing)"]) >= 0.5) & (np.abs(swing) < least) & ~limited
    return known
