"""The likeliest friction law: one ratio µ_p/µ_k for all trials, µ_k F_n of each; their intervals.

For a given ratio the trials are independent, so each one is a search in one dimension. All laws on
a grid are evaluated: the likelihood has steps where a part just sticks, and so no useful gradient.
The deviance residuals of the slides follow Student's distribution, which tolerates a few outliers.
The interval of a number is the wider one of two: the bootstrap over slides (resampled as
independent blocks), and the profile likelihood.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from cosim.arrays import Array
from cosim.studies.fit.slides import Rows, Slide, marginal, slides_of
from cosim.trials.published import GRAVITY
from cosim.trials.tracked import Trial

Interval = tuple[float, float]

FRICTIONS: Interval = (0.3, 60.0)
"""Range of µ_k F_n that is searched, in weights of the part."""
COARSE, FINE, AROUND = 37, 25, 1.2  # points of the first friction grid, of the second; its factor
RATIOS, NEAR = np.linspace(0.0, 0.9, 7), np.linspace(-0.12, 0.12, 9)  # µ_p/µ_k: grid, refinement
MOVES = 3  # at most so many fine grids, each about the likeliest law of the last one
LARGEST_RATIO = float(RATIOS[-1] + MOVES * NEAR[-1])  # that the search can reach
FREEDOM = 8.0  # degrees of freedom of Student's distribution
FEWEST = 5  # with fewer slides no interval is given
DRAWS = 400  # of the bootstrap
LEVEL = 0.9  # confidence level of the intervals
LOSS = 1.353
"""Half of the 90 % quantile of Χ² with one degree of freedom: how far the profile's negative
log-likelihood rises within the interval."""
SYSTEMATIC = 0.05
"""Relative error of the model of the motion next to a slide, by which intervals widen on either
side. On 16 trials of this bench with known friction it is 0.045 (rms)."""


def _laws(kinetic: Array, ratios: Array) -> tuple[Array, Array]:
    """µ_k F_n/m and µ_p F_n/m, m/s², of all pairs, flat; the ratio µ_p/µ_k varies fastest."""
    first, second = (x.ravel() for x in np.meshgrid(kinetic, ratios, indexing="ij"))
    return first * GRAVITY, first * second * GRAVITY


def _losses(slides: Sequence[Slide], kinetic: Array, ratios: Array) -> Array:
    """Negative log-likelihood of each slide of a trial (slides by frictions by ratios).

    The deviance residual is the root of twice the log-likelihood that a law loses to the slide's
    own best law; it is taken to follow Student's distribution. Source: P. McCullagh, J. A.
    Nelder, *Generalized Linear Models*, 2nd edition 1989, section 2.4."""
    laws = _laws(kinetic, ratios)
    found = np.array([marginal(each.log_likelihoods(*laws)) for each in slides])
    found = found.reshape(len(slides), len(laws[0]))
    residuals = np.sqrt(2 * (found.max(axis=1, keepdims=True) - found))
    loss = (FREEDOM + 1) / 2 * np.log1p(residuals**2 / FREEDOM)
    return loss.reshape(-1, len(kinetic), len(ratios))


@dataclass(frozen=True)
class Found:
    """A number and its interval of ``LEVEL``."""

    value: float
    low: float
    high: float

    def determined(self, limits: Interval) -> str:
        """“yes”; “at least” or “at most” where the interval's other end is at the search's limit;
        “no” where both are."""
        below, above = self.low <= limits[0] * 1.05 + 1e-9, self.high >= limits[1] * 0.95
        if below:
            return "no" if above else "at most"
        return "at least" if above else "yes"


@dataclass(frozen=True)
class Fit:
    """The likeliest law: the ``ratio`` µ_p/µ_k, each trial's ``kinetic`` friction µ_k F_n
    [weights], its ``slides``, and its ``profile``: frictions [weights], and by how much the
    negative log-likelihood of each exceeds the least."""

    ratio: Found
    kinetic: list[Found]
    slides: list[list[Slide]]
    profile: list[tuple[Array, Array]]


class _Scan:
    """The losses of laws on a grid: ``grids`` of each trial's frictions [weights], and ``ratios``
    for all trials. The losses are those of each slide of a trial (slides × frictions × ratios), of
    each trial (frictions × ratios), and of all trials at each one's best friction (ratios)."""

    def __init__(self, slides: list[list[Slide]], grids: list[Array], ratios: Array) -> None:
        self.grids, self.ratios = grids, ratios
        self.of_slides = [_losses(*each, ratios) for each in zip(slides, grids, strict=True)]
        self.of_trials = [losses.sum(axis=0) for losses in self.of_slides]
        self.of_all: Array = np.sum([loss.min(axis=0) for loss in self.of_trials], axis=0)
        # The likeliest law by its indices: the ratio, and each trial's friction at this ratio.
        self._row = int(self.of_all.argmin())
        self._best = [int(loss[:, self._row].argmin()) for loss in self.of_trials]
        self.ratio = self.ratios[self._row]
        self.kinetic = [grid[k] for grid, k in zip(grids, self._best, strict=True)]

    @property
    def at_edge(self) -> bool:
        """Whether the likeliest law lies at the end of a grid, but for the ratio 0."""
        above, below = 0 < self._row == len(self.ratios) - 1, self._row == 0 < self.ratio
        each = zip(self._best, self.grids, strict=True)
        return above or below or any(k in (0, len(grid) - 1) for k, grid in each)

    def profile(self, k: int) -> Array:
        """The loss of each friction of trial ``k`` above the least: at each ratio the other trials
        take their own best friction; then the best ratio is taken for each friction."""
        others = self.of_all - self.of_trials[k].min(axis=0)
        return (self.of_trials[k] + others).min(axis=1) - self.of_all.min()


def search(trials: Sequence[Trial], limits: Sequence[Interval], plate: bool) -> Fit:
    """The likeliest law, each trial's µ_k F_n [weights] within its limits; without ``plate`` the
    spring-loaded plate has no friction."""
    frictions = np.geomspace(*FRICTIONS, COARSE)
    slides = [slides_of(trial, *_laws(frictions, RATIOS)) for trial in trials]
    coarse = [frictions.clip(*limit) for limit in limits]
    scan = _Scan(slides, coarse, RATIOS if plate else np.zeros(1))
    # Finer grids about the likeliest law, moved and searched again while it lies at an edge.
    around = np.geomspace(1 / AROUND, AROUND, FINE)
    for _ in range(MOVES):
        ratios = np.unique((scan.ratio + NEAR).clip(0.0)) if plate else scan.ratios
        grids = [(x * around).clip(*limit) for x, limit in zip(scan.kinetic, limits, strict=True)]
        scan = _Scan(slides, grids, ratios)
        if not scan.at_edge:
            break
    # Intervals may reach far beyond the fine grids, so the coarse ones are added for them.
    grids = [np.unique([*x, *fine]) for x, fine in zip(coarse, scan.grids, strict=True)]
    ratios = np.unique([*RATIOS, *scan.ratios]) if plate else scan.ratios
    return _with_intervals(slides, _Scan(slides, grids, ratios), limits)


def _with_intervals(slides: list[list[Slide]], scan: _Scan, limits: Sequence[Interval]) -> Fit:
    """The likeliest law of a scan, and the intervals of its numbers."""
    rows, drawn = _drawn(scan.of_slides)
    found, profiles = [], [(grid, scan.profile(k)) for k, grid in enumerate(scan.grids)]
    for k, ((grid, profile), limit) in enumerate(zip(profiles, limits, strict=True)):
        value, count = float(scan.kinetic[k]), len(slides[k])
        if count >= FEWEST:
            found.append(_interval(value, _likely(grid, profile), grid[drawn[:, k]], count, limit))
        else:  # too few to tell their scatter
            found.append(Found(value if count else float(np.sqrt(limit[0] * limit[1])), *limit))
    likely, count = _likely(scan.ratios, scan.of_all - scan.of_all.min()), sum(map(len, slides))
    ratio = _interval(float(scan.ratio), likely, scan.ratios[rows], count, (0.0, 9.0))
    return Fit(ratio, found, slides, profiles)


def _drawn(tables: Sequence[Array]) -> tuple[Rows, Rows]:
    """Indices of the likeliest ratio (draws) and frictions (draws × trials) in bootstrap samples of
    each trial's slides, from its losses (slides × frictions × ratios)."""
    rng = np.random.default_rng(0)
    sums = []
    for table in tables:
        n = max(1, len(table))
        # How often a draw holds each slide (draws × slides; a trial without slides has none).
        weights = rng.multinomial(n, np.full(n, 1 / n), DRAWS)[:, : len(table)]
        sums.append(np.tensordot(weights, table, 1))  # draws × frictions × ratios
    rows = np.sum([loss.min(axis=1) for loss in sums], axis=0).argmin(axis=1)
    return rows, np.stack([loss[np.arange(DRAWS), :, rows].argmin(axis=1) for loss in sums], 1)


def _likely(grid: Array, loss: Array) -> Interval:
    """Where the loss crosses LOSS below and above its minimum, interpolated linearly on the grid;
    the grid's end where it does not."""
    inside = np.flatnonzero(loss <= LOSS)
    ends = []
    for at, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
        known = 0 <= beyond < len(grid)
        share = (LOSS - loss[at]) / (loss[beyond] - loss[at]) if known else 0.0
        ends.append(float(grid[at] + share * (grid[beyond if known else at] - grid[at])))
    return ends[0], ends[1]


def _interval(value: float, likely: Interval, drawn: Array, count: int, limit: Interval) -> Found:
    """The wider one, at either end, of the profile's interval ``likely`` and of the quantiles of
    the bootstrap's values ``drawn``, within ``limit``. ``few`` widens the latter for few slides, as
    Student's distribution exceeds the normal one."""
    few = float(stdtrit(max(1, count - 1), (1 + LEVEL) / 2) / ndtri((1 + LEVEL) / 2))
    ends = []
    for end, share, side in ((likely[0], (1 - LEVEL) / 2, -1), (likely[1], (1 + LEVEL) / 2, 1)):
        scatter = few * (float(np.quantile(drawn, share)) - value)
        # The wider of the two counts, with the model's own error added as the root of squares.
        far = max(side * scatter, side * (end - value), 0.0)
        ends.append(value + side * float(np.hypot(far, SYSTEMATIC * value)))
    return Found(value, max(ends[0], limit[0]), min(ends[1], limit[1]))
