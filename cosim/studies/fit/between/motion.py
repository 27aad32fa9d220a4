"""A motion between the frames of a camera, with its breaks.

At the frames height, velocity, acceleration and jerk are those of the smoothing spline of seventh
degree that the breaks interrupt (`cosim.studies.fit.between.breaks`): the most likely path of an
integrated random walk of the jerk. Between two frames it is a polynomial of seventh degree, or,
where it breaks, two cubic branches; an impact stands where their heights meet, a step of the force
where their velocities do. Units: s, m.
"""

from math import factorial
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.studies.fit.between.breaks import KINK, TURN, Kinds, Model, broken, walk

STATE = 4  # height, velocity, acceleration, jerk
PIECES = 7
"""Between two frames: straight pieces of the velocity. A break is the fourth of them."""
BRANCH = PIECES // 2
SNAPS = (1e6, 1e14, 9)  # m²/s⁷; densities of the snap, from the smoothest motion to the roughest
OVERSHOOT = 0.1  # of an interval; how far outside it a break may be found, to be put at its edge


class Between(NamedTuple):
    """The velocity [m/s], linear between knots at ``time`` [s]: rows of intervals between frames,
    ``PIECES`` knots in each; and the last knot, the last frame."""

    time: Array
    velocity: Array
    end: tuple[float, float]

    def stretch(self, first: int, last: int) -> tuple[Array, Array]:
        """The knots from one frame to another."""
        rows = slice(first, last)
        at = (self.time[last, 0], self.velocity[last, 0]) if last < len(self.time) else self.end
        return np.append(self.time[rows], at[0]), np.append(self.velocity[rows], at[1])


class Lasting(NamedTuple):
    """How long an impact lasts, and a step of the driving force, s."""

    impact: float
    step: float


class Motion:
    """One body's motion, from its heights ``z`` [m] at the frames' ``time`` [s].

    ``v_plate`` [m/s] is the velocity, at the frames, in passing which the plate's friction turns.
    """

    def __init__(self, time: Array, z: Array, kinds: Kinds, model: Model, v_plate: Array) -> None:
        self.time, self.kinds, self._v_plate = time, kinds, v_plate
        self.states = _most_likely(time, z, kinds, model.noise)
        """Height, velocity, acceleration and jerk at each frame, SI."""
        h = np.diff(time)[:, None]
        shares = np.arange(PIECES) / PIECES
        self._time = time[:-1, None] + h * shares
        self._velocity = _smooth(self.states, h, shares)
        self._breaks = [(i, self._place(i)) for i in np.flatnonzero(kinds).tolist()]

    def between(self, lasting: Lasting) -> Between:
        """The motion with breaks that last so long, less where a frame is too near."""
        time, velocity = self._time.copy(), self._velocity.copy()
        for i, at in self._breaks:
            h = float(self.time[i + 1] - self.time[i])
            whole = {KINK: lasting.step, TURN: 0.0}.get(self.kinds[i], lasting.impact)
            half = min(whole / 2, at, h - at)
            before = np.linspace(0.0, at - half, BRANCH + 1)
            after = np.linspace(at + half, h, BRANCH + 1)[:-1]
            time[i] = self.time[i] + np.append(before, after)
            velocity[i, : BRANCH + 1] = _ahead(self.states[i], before)
            velocity[i, BRANCH + 1 :] = _ahead(self.states[i + 1], after - h)
        return Between(time, velocity, (float(self.time[-1]), float(self.states[-1, 1])))

    def _place(self, i: int) -> float:
        """When the motion breaks, in s after frame ``i``."""
        h = float(self.time[i + 1] - self.time[i])
        z, v, a, j = self.states[i + 1] - transition(np.array(h)) @ self.states[i]
        # Powers of the time: before the end, of a gap that must close; or after the begin, of the
        # velocity that turns.
        gap = (j / 2, -a, v) if self.kinds[i] == KINK else (-j / 6, a / 2, -v, z)
        if self.kinds[i] == TURN:
            plate = self._v_plate[i], float(self._v_plate[i + 1] - self._v_plate[i]) / h
            own = self.states[i]
            gap = (own[3] / 2, own[2] - plate[1], own[1] - plate[0])
        roots = np.roots(gap)
        near = roots[np.isreal(roots)].real
        near = near if self.kinds[i] == TURN else h - near
        near = near[np.abs(near - h / 2) < (0.5 + OVERSHOOT) * h].clip(0.0, h)
        if len(near) == 0:
            return 0.0 if abs(np.polyval(gap, h)) < abs(np.polyval(gap, 0.0)) else h
        jumps = np.abs(_ahead(self.states[i + 1], near - h) - _ahead(self.states[i], near))
        return float(near[jumps.argmax()])


def transition(h: Array) -> Array:
    """What becomes of a state after ``h``."""
    result = np.zeros((*h.shape, STATE, STATE))
    for i in range(STATE):
        for j in range(i, STATE):
            result[..., i, j] = h ** (j - i) / factorial(j - i)
    return result


def _ahead(state: Array, later: Array) -> Array:
    return state[1] + later * (state[2] + later / 2 * state[3])


def _smooth(states: Array, h: Array, shares: Array) -> Array:
    """Velocities at ``shares`` of intervals ``h``, of polynomials with the states at their ends."""
    conditions = np.zeros((2 * STATE, 2 * STATE))
    for k in range(STATE):
        conditions[k, k] = factorial(k)
        for power in range(k, 2 * STATE):
            conditions[STATE + k, power] = factorial(power) / factorial(power - k)
    scale = h ** np.arange(STATE)
    ends = np.concatenate([states[:-1] * scale, states[1:] * scale], axis=1)
    powers = np.linalg.solve(conditions, ends.T)[1:]
    slopes = np.arange(1, 2 * STATE)[:, None] * shares ** np.arange(2 * STATE - 1)[:, None]
    return powers.T @ slopes / h


def _most_likely(time: Array, z: Array, kinds: Kinds, noise: float) -> Array:
    """The states at the frames, with the density of the snap that makes the heights likeliest."""
    best: tuple[float, Array] | None = None
    for snap in np.geomspace(*SNAPS).tolist():
        try:
            found = _smoothed(time, z, kinds, snap, noise)
        except np.linalg.LinAlgError:  # too smooth for such heights with so little noise
            continue
        if best is not None and found[0] < best[0] - 2.0:
            break
        if best is None or found[0] > best[0]:
            best = found
    if best is None:
        raise BadInput(
            f"Heights that differ by {1e3 * np.ptp(z):.3g} mm are more than can be followed "
            "between the frames."
        )
    return best[1]


def _smoothed(
    time: Array, z: Array, kinds: Kinds, snap: float, noise: float
) -> tuple[float, Array]:
    """The logarithm of the likelihood, but for a constant, and the states."""
    n, steps = len(time), np.diff(time)
    unit = float(np.median(steps)) ** -np.arange(STATE, dtype=float)  # all states about as large
    covariance = snap * walk(STATE, steps) + broken(kinds, STATE, steps)
    weights = np.linalg.inv(covariance / np.outer(unit, unit))
    ahead = transition(steps) * (unit / unit[:, None])
    back = ahead.transpose(0, 2, 1) @ weights
    wide = 2 * STATE - 1
    banded, right = np.zeros((wide + 1, STATE * n)), np.zeros(STATE * n)
    frames = np.arange(n - 1)
    for rows, columns, block in (
        (frames, frames, back @ ahead),
        (frames, frames + 1, -back),
        (frames + 1, frames + 1, weights),
    ):
        for i in range(STATE):
            for j in range(STATE):
                row, column = STATE * rows + i, STATE * columns + j
                upper = column >= row
                banded[(wide + row - column)[upper], column[upper]] += block[upper, i, j]
    heights = STATE * np.arange(n)
    middle = float(z.mean())
    banded[wide, heights] += noise**-2
    right[heights] = (z - middle) / noise**2
    factor = cholesky_banded(banded)
    solved = cho_solve_banded((factor, False), right)
    likelihood = (
        0.5 * np.linalg.slogdet(weights)[1].sum()
        - np.log(factor[wide]).sum()
        - 0.5 * float((z - middle) @ (z - middle) / noise**2 - right @ solved)
    )
    states = solved.reshape(n, STATE) * unit
    states[:, 0] += middle
    return float(likelihood), states
