"""The part's path while it slides on the tracked surface, and how likely a law makes it.

While the part slides its acceleration is known but for the law: ±µ_k F_n/m − g, and µ_p F_n/m
against its velocity over the spring-loaded plate. Before and after, it moves with the surface,
smoothly. The tracked surface tells between which frames a slide begins and ends, and its sign; the
instants between the frames are not known, least of all where an impact begins the slide. So all
instants count, each by the likelihood of the part's heights about the slide (the marginal
likelihood), and the surface's motion between the frames need not be reconstructed.

Where part and surface move together the acceleration is a random walk, as in a smoothing spline;
source: G. Wahba, *Spline Models for Observational Data*, SIAM 1990, chapter 1. Units: s, m.
"""

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.trials.published import GRAVITY
from cosim.trials.tracked import Trial

Rows = npt.NDArray[np.intp]

CLEAR = 4.0
"""Deviations by which the way from frame to frame must exceed its noise to be a slide."""
BESIDE = 7  # frames at most on either side, in which the part does not slide
INSTANTS, REACH = 12, 2.5
"""Instants at which a slide may begin or end, and over how many intervals between frames: where it
begins or ends slowly, its first or last interval is lost in the noise."""
ACCELERATION = 80.0  # m/s², deviation of what the part has before and after a slide
ROUGHNESSES = (1e4, 1e5, 1e6)  # m²/s⁵, spectral density of its change there; the likeliest is taken
NOISES = (1.0, 10.0)  # times that of still tracks; the likeliest is taken
LEAST_NOISE = 1e-6  # m; no camera tells less, and how a slide begins is modelled no truer
LEAST_SIZE = 1.0  # (s/m)², of what the part's velocity makes of its path; it is some 1e6
CHUNK = 32  # laws at once
PASSES = 3  # until the instant is known at which the part's velocity passes the plate's
IMPROBABLE = 12.0  # a logarithm: instants that are so much less likely with every law are left out


@dataclass(frozen=True)
class Slide:
    """One slide, with what of the likelihood does not depend on the law.

    ``time`` (since the trial's first frame) and ``z`` hold n frames about it; rows of the others
    are pairs of instants (its ``begin`` and ``end``, g of them): the n × n factor ``whiten`` that
    makes errors independent and of size one, what it makes of a height that is free (``level``,
    g × n, of length one), and ``fixed``, the logarithm's constant.
    """

    sign: int
    time: Array
    z: Array
    v_plate: float
    begin: Array
    end: Array
    whiten: Array
    fixed: Array
    level: Array

    def log_likelihoods(self, kinetic: Array, plate: Array) -> Array:
        """Of laws (µ_k F_n/m and µ_p F_n/m, m/s²) by pairs of instants."""
        parts = [slice(k, k + CHUNK) for k in range(0, len(kinetic), CHUNK)]
        return np.concatenate([self._of_few(kinetic[few], plate[few])[0] for few in parts])

    def _of_few(self, kinetic: Array, plate: Array) -> tuple[Array, Array]:
        """The same, of laws few enough for a processor's cache, and the part's velocities over the
        plate at the begin, m/s.

        The part begins at a height and with a velocity that are free; so they are found by least
        squares, the velocity by Gauss–Newton, since the plate's friction turns with it. Arrays are
        pairs by laws, or pairs by laws by frames.
        """
        lasts = (self.end - self.begin)[:, None]
        since = (self.time - self.begin[:, None])[:, None]
        pull, rub = self.sign * kinetic - GRAVITY, 0.0 * plate
        faster = np.zeros((len(lasts), len(kinetic)))  # than the plate, at the begin
        level, turned = self.level[:, None], self.whiten.swapaxes(1, 2)
        found = faster
        for _ in range(PASSES):
            path, slope = self._path(since, lasts, faster, pull, rub)
            error, slope = (self.z - path) @ turned, slope @ turned
            # The height is eliminated; then least squares in the velocity.
            error -= (error * level).sum(axis=-1, keepdims=True) * level
            slope -= (slope * level).sum(axis=-1, keepdims=True) * level
            size, told = (slope**2).sum(axis=-1) + LEAST_SIZE, (slope * error).sum(axis=-1)
            found = (told**2 / size - (error**2).sum(axis=-1)) / 2
            faster, rub = faster + told / size, plate
        return (self.fixed[:, None] + found).T, faster

    def _path(
        self, since: Array, lasts: Array, faster: Array, pull: Array, rub: Array
    ) -> tuple[Array, Array]:
        """The way at times ``since`` the begin, and what of it a faster begin adds, s.

        It has four pieces: with the velocity of the begin before it (``early``), slowed by friction
        until the part has the plate's velocity (``one``), from there to the slide's end (``two``),
        and with the velocity of the end after that (``beyond``).
        """
        early, within = np.minimum(since, 0.0), since.clip(0.0, lasts[..., None])
        beyond = (since - lasts[..., None]).clip(0.0)
        v, way = self.v_plate + faster, np.where(faster >= 0.0, 1.0, -1.0)
        first = pull - way * rub
        # The part has the plate's velocity after -faster/first, if friction takes it there at all.
        turns = np.broadcast_to(lasts, faster.shape).copy()
        np.divide(-faster, first, out=turns, where=first * faster < 0.0)
        turns = np.minimum(turns, lasts)
        # Having stopped over the plate the part goes on the other way, or is held by it.
        second = pull + way * rub
        second = np.where(second * way < 0.0, second, 0.0)
        left = lasts - turns
        v_turned = v + first * turns
        # What a faster begin adds to the velocity after the turn: it turns later, too.
        share = np.divide(second, first, out=np.ones_like(first), where=left > 0.0)[..., None]
        one = np.minimum(within, turns[..., None])
        two = within - one
        path = (v[..., None] + first[..., None] * one / 2) * one + v[..., None] * early
        path += (v_turned[..., None] + second[..., None] * two / 2) * two
        path += (v_turned + second * left)[..., None] * beyond
        return path, early + one + share * (two + beyond)

    def predicted(self, kinetic: float, plate: float, time: Array) -> Array:
        """The part's heights [m] by a law, m/s², at its likeliest instants; NaN where it does not
        slide. It begins as the tracked frames about the slide have it."""
        law = np.array([kinetic]), np.array([plate])
        likeliest = self.log_likelihoods(*law)[0].argmax()
        one = self.only(np.arange(len(self.begin)) == likeliest)
        since = (np.concatenate([self.time, time]) - one.begin)[None, None]
        faster, lasts = one._of_few(*law)[1], (one.end - one.begin)[:, None]
        path = one._path(since, lasts, faster, self.sign * law[0] - GRAVITY, law[1])[0][0, 0]
        frames = len(self.time)
        weights = one.level[0] @ one.whiten[0]
        start = weights @ (self.z - path[:frames]) / weights.sum()
        slides = (time >= one.begin) & (time <= one.end)
        return np.where(slides, start + path[frames:], np.nan)

    def only(self, pairs: npt.NDArray[np.bool_]) -> "Slide":
        """The same with some of the pairs of instants."""
        names = ("begin", "end", "whiten", "fixed", "level")
        kept = {name: getattr(self, name)[pairs] for name in names}
        return Slide(self.sign, self.time, self.z, self.v_plate, **kept)


@dataclass(frozen=True)
class Span:
    """Where a slide stands: the frames in it and about it, and its possible instants, s."""

    sign: int
    frames: Rows
    inside: Rows
    begins: Array
    ends: Array


def noise_of(trial: Trial) -> float:
    """The deviation of a tracked height, m: where the part sticks its distance from the surface
    does not change, and elsewhere fourth differences of the path are nearly noise alone."""
    apart = np.abs(np.diff(trial.platform.z - trial.part.z, 2))
    path = np.abs(np.diff(trial.part.z, 4))
    found = (np.quantile(apart, 0.25) / 12**0.5, np.quantile(path, 0.25) / 70**0.5)
    return max(LEAST_NOISE, float(min(found)) / 0.3186)  # a quarter lies within so many deviations


def spans(trial: Trial, noise: float) -> list[Span]:
    """The slides of a trial that tell something of its law."""
    time = trial.time - trial.time[0]
    moved = np.diff(trial.platform.z - trial.part.z)
    signs = np.where(np.abs(moved) > CLEAR * 2 * noise, np.sign(moved), 0).astype(int)
    edges = np.flatnonzero(np.diff(signs, prepend=0, append=0))
    runs = [(i, j - 1) for i, j in pairwise(edges.tolist()) if signs[i]]
    steps = np.diff(time)
    usual = float(np.median(steps))
    lost = (np.arange(INSTANTS) + 0.5) / INSTANTS * REACH * usual
    wider = np.maximum(1.0, steps / usual)  # where frames are missing
    found = []
    for k, (i, j) in enumerate(runs):
        low = runs[k - 1][1] + 2 if k else 0
        high = runs[k + 1][0] - 1 if k + 1 < len(runs) else len(time) - 1
        before = np.arange(max(low, i - BESIDE + 1), i + 1)
        inside = np.arange(i + 1, j + 1)
        after = np.arange(j + 1, min(high, j + BESIDE) + 1)
        # Height, velocity and acceleration are free on each side: what is left over tells. Of a
        # single frame too much depends on how smooth the motion about it is.
        if len(inside) < 2 or sum(max(0, len(x) - 2) for x in (before, after)) + len(inside) < 3:
            continue
        begins = time[i + 1] - wider[i] * lost if len(before) else time[[i + 1]]
        ends = time[j] + wider[min(j, len(steps) - 1)] * lost if len(after) else time[[j]]
        frames = np.concatenate([before, inside, after])
        found.append(Span(int(signs[i]), frames, inside, begins, ends))
    return found


def slide(trial: Trial, span: Span, noise: float, roughness: float) -> Slide | None:
    """A slide, prepared; None where it has no time to last."""
    time = trial.time - trial.time[0]
    begin, end = (x.ravel() for x in np.meshgrid(span.begins, span.ends, indexing="ij"))
    begin, end = begin[begin < end], end[begin < end]
    if len(begin) == 0:
        return None
    at, z = time[span.frames], trial.part.z[span.frames]
    # The covariance of the frames about the path (pairs × n × n): their noise, and outside the
    # slide that of a free acceleration a, whose way is a x²/2, and of its change. The times ``x``
    # away from the slide are 0 within it.
    covariance = np.repeat(noise**2 * np.eye(len(at))[None], len(begin), axis=0)
    for away in (begin[:, None] - at, at - end[:, None]):
        x = np.clip(away, 0.0, None)
        x, y = x[:, :, None], x[:, None, :]
        covariance += ACCELERATION**2 * (x * y) ** 2 / 4 + roughness * _walk(x, y)
    factor = np.linalg.cholesky(covariance)
    whiten = np.linalg.inv(factor)
    # Height and velocity at the begin are free: a flat prior, integrated out. The likelihood keeps
    # the determinant, and the lengths of their whitened columns, the second less its share of the
    # first.
    level = whiten.sum(axis=2)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    level /= length
    along = ((at - begin[:, None])[:, None, :] @ whiten.swapaxes(1, 2))[:, 0]
    along -= (along * level).sum(axis=1, keepdims=True) * level
    volume = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    volume += np.log(length[:, 0] * np.linalg.norm(along, axis=1))
    passes = plate_velocity(trial)[span.inside].mean()
    return Slide(
        *(span.sign, at, z, float(passes), begin, end, whiten),
        *(-volume - np.log(len(begin)), level),
    )


def _walk(x: Array, y: Array) -> Array:
    """The covariance of heights after x and y of an acceleration that is a random walk from 0."""
    less, more = np.minimum(x, y), np.abs(x - y)
    return less**5 / 20 + more * less**4 / 8 + more**2 * less**3 / 12


def plate_velocity(trial: Trial) -> Array:
    """Of the spring-loaded plate [m/s] at the frames, as tracked, or 0 where it was not."""
    if trial.plate is None or not np.isfinite(trial.plate.v).any():
        return np.zeros(len(trial.time))
    known = np.isfinite(trial.plate.v)
    return np.interp(trial.time, trial.time[known], trial.plate.v[known])


def marginal(log_likelihoods: Array) -> Array:
    """The logarithm of the sum over pairs of instants (the last axis)."""
    most = log_likelihoods.max(axis=-1)
    return most + np.log(np.exp(log_likelihoods - most[..., None]).sum(axis=-1))


def slides_of(trial: Trial, kinetic: Array, plate: Array) -> list[Slide]:
    """All slides of a trial, with the noise and roughness that make the best of the laws likeliest,
    and with those pairs of instants that are likely with any of the laws.

    The laws must be dense enough for that: with a low noise the likelihood is a narrow ridge, and
    where none of them is near it a high one seems better, with which the ridge's ends are lost."""
    noise, best = noise_of(trial), (-np.inf, [], [])
    places = spans(trial, noise)
    for roughness, factor in product(ROUGHNESSES, NOISES):
        every = [slide(trial, span, factor * noise, roughness) for span in places]
        kept = [one for one in every if one is not None]
        told = [one.log_likelihoods(kinetic, plate) for one in kept]
        likelihood = sum(map(marginal, told), np.zeros(1)).max()
        if likelihood > best[0]:
            best = float(likelihood), kept, told
    found = []
    for one, told in zip(*best[1:], strict=True):
        # Of each pair of instants: how near it comes, with any law, to that law's likeliest pair.
        likely = (told - told.max(axis=1, keepdims=True)).max(axis=0) > -IMPROBABLE
        found.append(one.only(likely))
    return found
