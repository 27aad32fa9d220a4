"""The part's path while it slides on the tracked surface, and its likelihood under a friction law.

While the part slides, the law gives its acceleration: ±µ_k F_n/m − g, and µ_p F_n/m against its
velocity relative to the spring-loaded plate. Before and after the slide the part moves smoothly
with the surface. The tracked surface tells the sign of a slide and between which frames it begins
and ends, but not the exact instants. They are nuisance parameters: the likelihood of the part's
heights is summed over a grid of pairs (begin, end), which gives the marginal likelihood of the law
without a reconstruction of the surface's motion between the frames.

Where part and surface move together the acceleration is a random walk, as in a smoothing spline;
source: G. Wahba, *Spline Models for Observational Data*, SIAM 1990, chapter 1. Units: s, m.
"""

from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.trials.published import GRAVITY
from cosim.trials.tracked import Trial

Rows = npt.NDArray[np.intp]

CLEAR = 4.0
"""Relative motion between two frames counts as sliding above so many deviations of its noise."""
BESIDE = 7  # at most so many frames without sliding are used on either side of a slide
INSTANTS, REACH = 12, 2.5
"""Number of instants at which a slide may begin (or end), and the frame intervals they span: where
a slide begins or ends slowly, its first or last interval is lost in the noise."""
ACCELERATION = 80.0  # m/s², standard deviation of the part's acceleration next to a slide
ROUGHNESSES = (1e4, 1e5, 1e6)  # m²/s⁵, spectral density of its random walk; the likeliest is taken
NOISES = (1.0, 10.0)  # factors on the noise of a sticking part; the likeliest is taken
LEAST_NOISE = 1e-6  # m; finer than a camera resolves and than the model of a slide's begin holds
LEAST_SIZE = 1.0  # (s/m)², keeps the normal equation of the velocity regular; that is some 1e6
CHUNK = 32  # laws evaluated in one array, which so fits the processor's cache
PASSES = 3  # of Gauss–Newton, until the instant is settled at which part and plate are equally fast
IMPROBABLE = 12.0  # pairs of instants whose ln L stays so far below the best for all laws go


@dataclass(frozen=True)
class Slide:
    """One slide, with the terms of its likelihood that do not depend on the law.

    ``time`` (since the trial's first frame, s) and ``z`` (m) hold n frames in and next to the
    slide. The other arrays have a row for each of g pairs of instants ``begin`` and ``end`` (s).
    ``whiten`` (g × n × n) is the inverse Cholesky factor of the covariance of the heights, with the
    whitened constant 1 projected out, along which the free initial height moves the residuals;
    ``weights`` (g × n) are those of the heights in the likeliest initial one; ``fixed`` (g) is the
    constant of the log-likelihood.
    """

    sign: int
    time: Array
    z: Array
    v_plate: float
    begin: Array
    end: Array
    whiten: Array
    fixed: Array
    weights: Array

    def log_likelihoods(self, kinetic: Array, plate: Array) -> Array:
        """Log-likelihoods (laws × pairs of instants) of laws (µ_k F_n/m and µ_p F_n/m, m/s²)."""
        chunks = [slice(k, k + CHUNK) for k in range(0, len(kinetic), CHUNK)]
        return np.concatenate([self._of_few(kinetic[x], plate[x])[0] for x in chunks])

    def _of_few(self, kinetic: Array, plate: Array) -> tuple[Array, Array]:
        """Log-likelihoods (laws × pairs) of at most CHUNK laws, and the likeliest velocity of the
        part relative to the plate at the begin (pairs × laws), m/s.

        The part's initial height and velocity are free. Least squares finds both, the velocity by
        Gauss–Newton, since the plate's friction changes its sign with it.
        """
        likelihoods = relative = np.zeros((len(self.begin), len(kinetic)))
        whiten = self.whiten.swapaxes(1, 2)
        # The first pass leaves the plate's friction out: its sign needs a first velocity.
        friction = 0.0 * plate
        for _ in range(PASSES):
            path, slope = self._path(relative, kinetic, friction, self.time)
            error, slope = (self.z - path) @ whiten, slope @ whiten
            size, descent = LEAST_SIZE + _dot(slope, slope), _dot(slope, error)
            # Of the linearised optimum.
            likelihoods = self.fixed[:, None] + (descent**2 / size - _dot(error, error)) / 2
            relative, friction = relative + descent / size, plate
        return likelihoods.T, relative

    def _path(
        self, relative: Array, kinetic: Array, plate: Array, time: Array
    ) -> tuple[Array, Array]:
        """The part's heights (pairs × laws × times), m from that at the begin, with the velocity
        ``relative`` to the plate there (pairs × laws), m/s; and their derivatives by it, s.

        Before the begin and after the end the velocity is constant: the covariance holds how the
        part accelerates there."""
        lasts = (self.end - self.begin)[:, None]
        without = self.sign * kinetic - GRAVITY
        first, second, turn, share = _accelerations(relative, lasts, without, plate)
        since, lasts = (time - self.begin[:, None])[:, None], lasts[..., None]
        sliding, beyond = since.clip(0.0, lasts), (since - lasts).clip(0.0)
        relative, first, second, turn, share = (
            x[..., None] for x in (relative, first, second, turn, share)
        )
        late = (sliding - turn).clip(0.0)  # within the slide, since part and plate were as fast
        path = (self.v_plate + relative) * since + first * (sliding**2 / 2 + lasts * beyond)
        path = path + (second - first) * (late**2 / 2 + (lasts - turn) * beyond)
        return path, since + share * (late + beyond)

    def predicted(self, kinetic: float, plate: float, time: Array) -> Array:
        """The part's heights [m] at times ``time`` by a law [m/s²], with the law's likeliest pair
        of instants; NaN outside the slide. The initial height fits the slide's tracked frames."""
        law = np.array([kinetic]), np.array([plate])
        likeliest = self.log_likelihoods(*law)[0].argmax()
        best = self.only(np.arange(len(self.begin)) == likeliest)
        path = best._path(best._of_few(*law)[1], *law, np.append(self.time, time))[0][0, 0]
        frames = len(self.time)
        start = best.weights[0] @ (self.z - path[:frames])
        slides = (time >= best.begin) & (time <= best.end)
        return np.where(slides, start + path[frames:], np.nan)

    def only(self, pairs: npt.NDArray[np.bool_]) -> "Slide":
        """This slide restricted to some of its pairs of instants."""
        names = ("begin", "end", "whiten", "fixed", "weights")
        return replace(self, **{name: getattr(self, name)[pairs] for name in names})


def _dot(one: Array, other: Array) -> Array:
    return np.einsum("glk,glk->gl", one, other)


def _accelerations(
    relative: Array, lasts: Array, without: Array, plate: Array
) -> tuple[Array, Array, Array, Array]:
    """The part's accelerations until it is as fast as the plate, and from then on; the time of this
    turn since the begin, at most ``lasts``; and by how much more than 1 the velocity after it
    changes with that at the begin, which moves the turn, too. ``without`` is the acceleration
    without the plate, whose friction, ``plate``, opposes the part's velocity ``relative`` to it."""
    direction = np.where(relative >= 0.0, 1.0, -1.0)
    first, second = without - direction * plate, without + direction * plate
    turn = np.broadcast_to(lasts, relative.shape).copy()
    np.divide(-relative, first, out=turn, where=first * relative < 0.0)
    # The part then reverses over the plate, or sticks to it where the plate's friction can hold it.
    second, turn = np.where(second * direction < 0.0, second, 0.0), np.minimum(turn, lasts)
    share = np.divide(second, first, out=np.ones_like(first), where=turn < lasts) - 1.0
    return first, second, turn, share


@dataclass(frozen=True)
class Span:
    """Where a slide lies in a trial: ``frames`` in and next to it, those ``inside`` it alone, and
    the instants at which it may begin and end, s."""

    sign: int
    frames: Rows
    inside: Rows
    begins: Array
    ends: Array


def noise_of(trial: Trial) -> float:
    """The standard deviation of a tracked height, m: where the part sticks, its distance from the
    surface does not change; elsewhere fourth differences of the path are nearly noise alone."""
    apart = np.abs(np.diff(trial.platform.z - trial.part.z, 2))
    path = np.abs(np.diff(trial.part.z, 4))
    # Independent errors of variance σ² give differences of 2 (1² + 2² + 1²) = 12 σ², for two
    # tracks, and 1² + 4² + 6² + 4² + 1² = 70 σ². Lower quartiles are hardly moved by slides.
    found = (np.quantile(apart, 0.25) / 12**0.5, np.quantile(path, 0.25) / 70**0.5)
    return max(LEAST_NOISE, float(min(found)) / 0.3186)  # normal quartile of |x|/σ


def spans(trial: Trial, noise: float) -> list[Span]:
    """The slides of a trial that hold enough frames to tell its law."""
    time = trial.time - trial.time[0]
    moved = np.diff(trial.platform.z - trial.part.z)  # of four tracked heights: noise 2 σ
    signs = np.where(np.abs(moved) > CLEAR * 2 * noise, np.sign(moved), 0).astype(int)
    edges = np.flatnonzero(np.diff(signs, prepend=0, append=0))
    # First and last interval of each slide; interval i lies between the frames i and i + 1.
    runs = [(i, j - 1) for i, j in pairwise(edges.tolist()) if signs[i]]
    steps = np.diff(time)
    usual = float(np.median(steps))
    lost = (np.arange(INSTANTS) + 0.5) / INSTANTS * REACH * usual  # s, before the first frame in it
    wider = np.maximum(1.0, steps / usual)  # factor on these where frames are missing
    found = []
    for k, (i, j) in enumerate(runs):
        low = runs[k - 1][1] + 2 if k else 0
        high = runs[k + 1][0] - 1 if k + 1 < len(runs) else len(time) - 1
        before = np.arange(max(low, i - BESIDE + 1), i + 1)
        inside = np.arange(i + 1, j + 1)
        after = np.arange(j + 1, min(high, j + BESIDE) + 1)
        # The motion on each side takes about two frames to be known; only frames beyond these
        # tell the law. A slide of a single frame depends too much on the assumed smoothness.
        if len(inside) < 2 or sum(max(0, len(x) - 2) for x in (before, after)) + len(inside) < 3:
            continue
        begins = time[i + 1] - wider[i] * lost if len(before) else time[[i + 1]]
        ends = time[j] + wider[min(j, len(steps) - 1)] * lost if len(after) else time[[j]]
        frames = np.concatenate([before, inside, after])
        found.append(Span(int(signs[i]), frames, inside, begins, ends))
    return found


def slide(trial: Trial, span: Span, noise: float, roughness: float) -> Slide | None:
    """A slide with its covariances factorised; None where no begin lies before an end."""
    time = trial.time - trial.time[0]
    begin, end = (x.ravel() for x in np.meshgrid(span.begins, span.ends, indexing="ij"))
    begin, end = begin[begin < end], end[begin < end]
    if len(begin) == 0:
        return None
    at, z = time[span.frames], trial.part.z[span.frames]
    factor = np.linalg.cholesky(_covariances(at, begin, end, noise, roughness))
    whiten = np.asarray(np.linalg.inv(factor), np.float64)
    level = whiten.sum(axis=2)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    level /= length
    # Initial height and velocity have flat priors. Integrating over them adds to ln |C|/2 the
    # logarithm of the area spanned by their whitened directions, here ``level`` and ``along``.
    along = ((at - begin[:, None])[:, None, :] @ whiten.swapaxes(1, 2))[:, 0]
    along -= (along * level).sum(axis=1, keepdims=True) * level
    area = length[:, 0] * np.linalg.norm(along, axis=1)
    # ln |C|/2 is the sum of the logarithms of the Cholesky factor's diagonal.
    volume = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) + np.log(area)
    fixed = -volume - np.log(len(begin))  # all pairs of instants are equally likely before
    v_plate = float(plate_velocity(trial)[span.inside].mean())
    # Generalised least squares of a constant: the weights are proportional to 1ᵀ C⁻¹.
    weights = (level[:, None] @ whiten)[:, 0]
    weights = weights / weights.sum(axis=1, keepdims=True)
    whiten -= level[:, :, None] * (level[:, None] @ whiten)
    return Slide(span.sign, at, z, v_plate, begin, end, whiten, fixed, weights)


def _covariances(at: Array, begin: Array, end: Array, noise: float, roughness: float) -> Array:
    """Covariances (g × n × n) of the heights at the times ``at``: noise, and on each side of the
    slide a free acceleration a (heights a x²/2, time x from the slide) that goes on as a random
    walk."""
    found = np.repeat(noise**2 * np.eye(len(at))[None], len(begin), axis=0)
    for away in (begin[:, None] - at, at - end[:, None]):
        outside = np.clip(away, 0.0, None)
        x, y = outside[:, :, None], outside[:, None, :]
        found += ACCELERATION**2 * (x * y) ** 2 / 4 + roughness * _walk(x, y)
    return found


def _walk(x: Array, y: Array) -> Array:
    """The covariance of the heights at times x and y of a body whose acceleration is a random walk
    of unit spectral density that starts, like height and velocity, from 0."""
    less, more = np.minimum(x, y), np.abs(x - y)
    return less**5 / 20 + more * less**4 / 8 + more**2 * less**3 / 12


def plate_velocity(trial: Trial) -> Array:
    """Velocity of the spring-loaded plate [m/s] at the frames; 0 where it was not tracked."""
    if trial.plate is None or not np.isfinite(trial.plate.v).any():
        return np.zeros(len(trial.time))
    known = np.isfinite(trial.plate.v)
    return np.interp(trial.time, trial.time[known], trial.plate.v[known])


def marginal(log_likelihoods: Array) -> Array:
    """The logarithm of the likelihood summed over pairs of instants (the last axis)."""
    most = log_likelihoods.max(axis=-1)
    return most + np.log(np.exp(log_likelihoods - most[..., None]).sum(axis=-1))


def slides_of(trial: Trial, kinetic: Array, plate: Array) -> list[Slide]:
    """All slides of a trial, with the noise and roughness for which the best of the laws is
    likeliest, and with the pairs of instants that are likely under at least one law.

    The grid of laws must be dense: with a low noise the likelihood is a narrow ridge, and if no law
    is near the ridge, the high noise wins wrongly and flattens it."""
    noise, best = noise_of(trial), (-np.inf, [], [])
    places = spans(trial, noise)
    for roughness, factor in product(ROUGHNESSES, NOISES):
        prepared = [slide(trial, span, factor * noise, roughness) for span in places]
        slides = [each for each in prepared if each is not None]
        tables = [each.log_likelihoods(kinetic, plate) for each in slides]  # laws × pairs
        likelihood = sum(map(marginal, tables), np.zeros(1)).max()
        if likelihood > best[0]:
            best = float(likelihood), slides, tables
    found = []
    for each, table in zip(*best[1:], strict=True):
        likely = (table - table.max(axis=1, keepdims=True)).max(axis=0) > -IMPROBABLE
        found.append(each.only(likely))
    return found
