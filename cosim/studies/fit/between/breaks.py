"""Where a motion that a camera saw frame by frame breaks: impacts, and steps of the driving force.

Between breaks the heights follow an integrated random walk of the acceleration; a break adds a jump
of velocity and acceleration at an unknown instant between two frames. Whether two frames have one
between them is a comparison of likelihoods on the frames about them, with a price for each break.
All of it is the linear Gaussian state-space model of a smoothing spline with interventions; source:
A. C. Harvey, S. J. Koopman, *Diagnostic checking of unobserved-components time series models*,
J. Business & Economic Statistics 10 (1992). Units: s, m.
"""

from dataclasses import dataclass, replace
from math import factorial

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array

Kinds = npt.NDArray[np.intp]
"""What stands between each two frames: an index into ``JUMPS``."""

SMOOTH, KINK, TAP, KICK, TURN = range(5)

JUMPS = np.array(
    [
        (0.0, 0.0, 0.0),
        (0.0, 100.0, 2e4),  # the driving force steps
        (0.03, 20.0, 1e4),  # impacts, weak
        (0.2, 20.0, 1e4),  # and strong
        (0.0, 20.0, 1e3),  # the friction of a plate turns; known, never searched for
    ]
)
"""Typical jumps of velocity [m/s], acceleration [m/s²] and jerk [m/s³] at a break of each kind: the
orders of magnitude of a vibrating gripper's, as the published trials have them."""

SEARCHED = (SMOOTH, KINK, TAP, KICK)
PRICE = 6.0
"""Of a break, in twice the logarithm of the likelihood."""
HALF = 5  # frames on either side that are asked about a break
ALONE = 3  # a break is taken only where none within so many intervals is more likely
ROUNDS = 30
DIFFUSE = (2e-3, 1.0, 300.0)
"""Height, velocity and acceleration that are possible, in SI: what is known before the frames."""


@dataclass(frozen=True)
class Model:
    """``roughness``: the spectral density of the jerk, m²/s⁵; ``noise`` of a height, m."""

    roughness: float
    noise: float


def jump(order: int, state: int, h: Array) -> Array:
    """The covariance of height, velocity, … (``state`` of them) at the end of an interval ``h``
    for a jump of one unit in the derivative ``order``, its instant uniform in the interval."""
    result = np.zeros((*h.shape, state, state))
    for i in range(order + 1):
        for j in range(order + 1):
            power, a, b = 2 * order - i - j, order - i, order - j
            result[..., i, j] = h**power / ((power + 1) * factorial(a) * factorial(b))
    return result


def walk(state: int, h: Array) -> Array:
    """The covariance of height, velocity, … after ``h`` for white noise in the derivative
    ``state``, of one unit of spectral density."""
    return jump(state - 1, state, h) * h[..., None, None]


def broken(kinds: Kinds, state: int, h: Array) -> Array:
    """The covariance that breaks of these kinds add over intervals ``h``."""
    spreads = JUMPS[kinds][..., : state - 1, None, None] ** 2
    orders = np.stack([jump(k + 1, state, h) for k in range(state - 1)], axis=-3)
    return (spreads * orders).sum(axis=-3)


class Breaks:
    """Searches the frames of one motion, heights ``z`` [m] at ``time`` [s], for breaks."""

    def __init__(self, time: Array, z: Array) -> None:
        n = len(time)
        frames = np.arange(n - 1)[:, None] + np.arange(1 - HALF, 1 + HALF)
        here = (frames >= 0) & (frames < n)
        frames = frames.clip(0, n - 1)
        self.steps = np.diff(time)
        at = time[frames]
        self._intervals = frames[:, :-1]
        real = np.diff(frames, axis=1) > 0
        h = np.where(real, np.diff(at, axis=1), 1.0)
        # What a disturbance that ends with interval k does to frame j.
        late = at[:, None, :] - at[:, 1:, None]
        reached = (late >= 0) & real[:, :, None] & here[:, None, :]
        powers = np.stack([np.ones_like(late), late, late**2 / 2], axis=-1)
        self._reach = powers * reached[..., None]
        self._walk = self._seen(self._reach, walk(3, h))
        off = at - at[:, [HALF - 1]]
        start = np.stack([np.ones_like(off), off, off**2 / 2], axis=-1) * here[..., None]
        start = start * np.array(DIFFUSE)
        self._known = start @ start.transpose(0, 2, 1) + (~here)[..., None] * np.eye(2 * HALF)
        self._here = here[..., None] * np.eye(2 * HALF)
        self._own = self._reach[:, HALF - 1]
        self._z = np.where(here, z[frames] - z[frames[:, [HALF - 1]]], 0.0)
        kinds = [np.full(n - 1, kind) for kind in SEARCHED[1:]]
        self._factors = [np.linalg.cholesky(broken(kind, 3, self.steps)) for kind in kinds]
        self._apart = np.arange(HALF - 1, n - HALF, 2 * HALF)  # windows that share no frame

    @staticmethod
    def _seen(reach: Array, covariance: Array) -> Array:
        """What disturbances of the intervals add to the covariance of the windows' frames."""
        windows, intervals, frames, states = reach.shape
        flat = (windows, frames, intervals * states)
        left = (reach @ covariance).swapaxes(1, 2).reshape(flat)
        return left @ reach.swapaxes(1, 2).reshape(flat).swapaxes(1, 2)

    def search(self, model: Model, kinds: Kinds | None = None) -> tuple[Kinds, float]:
        """The most likely breaks, begun from ``kinds``, and the logarithm of the likelihood, breaks
        paid. Each interval is judged with all others as they are, until none changes."""
        n = len(self.steps)
        kinds = np.zeros(n, dtype=np.intp) if kinds is None else kinds.copy()
        others = np.zeros_like(self._walk)
        self._add(others, np.arange(n), kinds, 1.0)
        gains, base = np.zeros((n, len(SEARCHED))), np.zeros(n)
        stale = np.arange(n)
        every = np.arange(n)
        for _ in range(ROUNDS):
            gains[stale], base[stale] = self._gains(model, others[stale], stale)
            paid = gains - PRICE * (np.arange(len(SEARCHED)) > 0)
            best = paid.argmax(axis=1)
            more = paid[every, best] - paid[every, kinds]
            padded = np.pad(more, ALONE, constant_values=-np.inf)
            largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * ALONE + 1).max(axis=1)
            new = np.flatnonzero((more >= largest) & (more > 1e-6))
            if len(new) == 0:
                break
            self._add(others, new, kinds[new], -1.0)
            kinds[new] = best[new]
            self._add(others, new, kinds[new], 1.0)
            near = new[:, None] + np.arange(1 - HALF, HALF)
            stale = np.unique(near[(near >= 0) & (near < n)])
        chosen = gains[every, kinds] + base
        return kinds, float(chosen[self._apart].sum() - PRICE * np.count_nonzero(kinds)) / 2

    def _add(self, others: Array, intervals: Kinds, kinds: Kinds, sign: float) -> None:
        """Count breaks in the covariances of all windows about these intervals but their own."""
        intervals, kinds = intervals[kinds > 0], kinds[kinds > 0]
        covariance = broken(kinds, 3, self.steps[intervals])[:, None]
        for away in range(1 - HALF, HALF):
            if away == 0:
                continue
            windows = intervals + away
            inside = (windows >= 0) & (windows < len(self.steps))
            reach = self._reach[windows[inside], HALF - 1 - away][:, None]
            others[windows[inside]] += sign * self._seen(reach, covariance[inside])

    def _gains(self, model: Model, others: Array, windows: Kinds) -> tuple[Array, Array]:
        """What each kind of break in the middle of each window adds to twice the logarithm of its
        likelihood, and that without one."""
        noise = model.noise**2 * self._here[windows]
        covariance = model.roughness * self._walk[windows] + others + noise + self._known[windows]
        factor = np.linalg.cholesky(covariance)
        given = np.concatenate([self._z[windows, :, None], self._own[windows]], axis=2)
        white = np.linalg.solve(factor, given)
        z, own = white[..., :1], white[..., 1:]
        base = -(z**2).sum(axis=(1, 2)) - 2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(1)
        gains = np.zeros((len(windows), len(SEARCHED)))
        for kind, root in enumerate(self._factors, 1):
            seen = own @ root[windows]
            told = (seen.transpose(0, 2, 1) @ z)[..., 0]
            inner = np.eye(3) + seen.transpose(0, 2, 1) @ seen
            solved = np.linalg.solve(inner, told[..., None])[..., 0]
            gains[:, kind] = (told * solved).sum(axis=1) - np.linalg.slogdet(inner)[1]
        return gains, base


LADDER = 10**0.5
"""Between roughnesses (as a root) and noises that are tried."""
LEAST = {"roughness": 1.0, "noise": 1e-8}  # m²/s⁵; m, what seven digits of millimetres leave
MOST_FRAMES = 400
"""From which roughness and noise are estimated."""


def estimate(time: Array, z: Array) -> Model:
    """Roughness and noise under which the heights, breaks allowed and paid, are most likely."""
    frames = slice(0, MOST_FRAMES)
    search = Breaks(time[frames], z[frames])
    h = float(np.median(np.diff(time)))
    # Fourth differences of noise have 70 times its variance; the motion's own make it larger.
    fourth = np.quantile(np.abs(np.diff(z[frames], 4)), 0.25) / 0.3186 / 70**0.5
    noise = max(float(fourth), LEAST["noise"])
    third = float(np.quantile(np.abs(np.diff(z[frames], 3)), 0.9)) / h**3
    model, best = Model(max(third, 1.0) ** 2 * h, noise), -np.inf
    kinds = None
    for name, factor in (("roughness", LADDER**-2), ("noise", 1 / LADDER), ("roughness", 0.3)):
        for way in (factor, 1 / factor):
            misses = 0
            trial = model
            while misses < 2:
                value = getattr(trial, name) * (1.0 if best == -np.inf else way)
                if value < LEAST[name]:
                    break
                trial = replace(trial, **{name: value})
                found, likelihood = search.search(trial, kinds)
                if likelihood > best:
                    model, best, kinds, misses = trial, likelihood, found, 0
                else:
                    misses += 1
    return model
