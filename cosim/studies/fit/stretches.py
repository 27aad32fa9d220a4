"""How likely a law of friction makes the part's tracked heights, stretch by stretch.

The part is followed on the motion u of part and surface together
(`cosim.studies.fit.between.together`). Part minus u has the sign of part minus surface, and a part
that sticks moves with u: the part on u obeys the same law as the part on the surface.

Each stretch begins at a frame at which the part sticks, so that its velocity is known, and no error
is carried on. What remains of (1 + r)(z − z simulated), a slide, is judged with the camera's noise
and a random walk of the velocity, since where u breaks it is not known to the last mm/s. Units:
s, m.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from cosim.arrays import Array
from cosim.mechanics import part
from cosim.studies.fit.between.breaks import jump
from cosim.studies.fit.between.motion import Lasting, Motion
from cosim.studies.fit.between.together import Together
from cosim.studies.fit.results import STEP

FREEDOM = 8.0  # degrees of, of Student's distribution: a few errors may be large
SPREADS = np.array([1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3])  # m/s
FIRST = 2  # frame from which a part is followed that does not rest soon


@dataclass(frozen=True)
class _Stretch:
    time: Array
    v: Array
    pull: Array | None
    at: Array
    v0: float

    def heights(self, laws: Array) -> Array:
        """Of the part over where it begins, laws by times."""
        return part.heights(self.time, self.v, laws, self.at, self.v0, self.pull)


class Stretches:
    """The stretches of one trial, with breaks that last so long."""

    def __init__(self, both: Together, motion: Motion, lasting: Lasting) -> None:
        self._seen, rests = both.frames, both.rests()
        self.scale, self.noise = 1 + both.ratio, 2**0.5 * both.noise
        self._between = motion.between(lasting)
        early = rests and rests[0] <= len(self._seen.time) / 2
        self.starts = rests if early else [FIRST, *rests]
        """The frames with which they begin; where the part does not rest soon, its tracked velocity
        begins the first."""
        self._rests = frozenset(rests)
        height = self._seen.z_part - self._seen.z_plate
        self._all: list[_Stretch] = []
        self._rises: list[Array] = []
        last = len(self._seen.time) - 1
        for begin, end in zip(self.starts, [*self.starts[1:], last], strict=True):
            rows = slice(begin + 1, end + 1)
            self._all.append(self._stretch(begin, end, self._seen.time[rows]))
            self._rises.append(height[rows] - height[begin])

    def _stretch(self, first: int, last: int, at: Array) -> _Stretch:
        """From one frame to another, seen from the plate, with heights at times ``at``."""
        seen = self._seen
        time, v = self._between.stretch(first, last)
        v0 = float(v[0] if first in self._rests else seen.v_part[first])
        if not seen.v_plate.any():
            return _Stretch(time, v, None, at, v0)
        v_plate = np.interp(time, seen.time, seen.v_plate)
        lengths = np.diff(time)
        pull = np.divide(np.diff(v_plate), lengths, np.zeros_like(lengths), where=lengths > 0)
        return _Stretch(time, v - v_plate, pull, at, v0 - float(v_plate[0]))

    def whole(self, laws: Array) -> tuple[Array, Array]:
        """Times [s], every 0.1 ms from the first rest, and the part's heights [m] over where it
        begins, a row for each law, followed in one run."""
        seen, first = self._seen, self.starts[0]
        begin, end = seen.time[first], seen.time[-1]
        grid = begin + np.arange(int((end - begin) / STEP + 1e-6) + 1) * STEP
        stretch = self._stretch(first, len(seen.time) - 1, grid)
        plate = np.interp(grid, seen.time, seen.z_plate) - seen.z_plate[first]
        return grid, stretch.heights(laws) + plate

    def errors(self, laws: Array) -> Array:
        """The mean of |z measured − z simulated| [m] over the whole trial, for each law."""
        grid, z = self.whole(laws)
        rise = self._seen.z_part - self._seen.z_part[self.starts[0]]
        return np.abs(z - np.interp(grid, self._seen.time, rise)).mean(axis=1)

    def misses(self, laws: Array) -> list[Array]:
        """(1 + r)(z − z simulated) [m], laws by frames, for each stretch."""
        pairs = zip(self._all, self._rises, strict=True)
        return [self.scale * (stretch.heights(laws) - rise) for stretch, rise in pairs]

    def unlikelihoods(self, misses: list[Array], spread: float) -> Array:
        """Minus the logarithm of the likelihood, but for a constant: stretches by laws.

        ``spread`` is the random walk's, m/s an interval between frames.
        """
        rows = []
        for stretch, miss in zip(self._all, misses, strict=True):
            h = float(stretch.at[-1] - stretch.at[0]) / max(1, len(stretch.at) - 1)
            whiten, volume = _whitening(len(stretch.at), h or 1e-3, spread, self.noise)
            errors = miss @ whiten.T
            rows.append((FREEDOM + 1) / 2 * np.log1p(errors**2 / FREEDOM).sum(axis=1) + volume)
        return np.array(rows)


@cache
def _whitening(count: int, h: float, spread: float, noise: float) -> tuple[Array, float]:
    """What makes errors of ``count`` frames independent and of size one, and the logarithm of the
    volume that it takes."""
    after = np.arange(count)[:, None] - np.arange(count)
    reach = np.stack([np.ones_like(after), after * h], axis=-1) * (after >= 0)[..., None]
    covariance = noise**2 * (np.eye(count) + 1)  # the begin has its noise, too
    once = spread**2 * jump(1, 2, np.array(h))
    covariance += np.einsum("jka,ab,lkb->jl", reach, once, reach, optimize=True)
    factor = np.linalg.cholesky(covariance)
    return np.linalg.inv(factor), float(np.log(np.diagonal(factor)).sum())
