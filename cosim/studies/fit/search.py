"""The likeliest law of friction: µ_p/µ_k of all trials, µ_k F_n of each; how certain both are.

Given the ratio the trials have nothing in common, so that each is a search in one dimension, and
all laws on a grid are looked at: the likelihood has steps, where a part just sticks, and no slope
to follow. Slides are judged by Student's distribution of their deviance residuals, so that a few
may be off. How certain a number is, the slides tell by their scatter, drawn again and again (the
bootstrap of independent blocks), and the profile of the likelihood; the wider one holds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from cosim.arrays import Array
from cosim.studies.fit.slides import Slide, marginal, slides_of
from cosim.trials.published import GRAVITY
from cosim.trials.tracked import Trial

Interval = tuple[float, float]
Rows = npt.NDArray[np.intp]

FRICTIONS: Interval = (0.3, 60.0)
"""µ_k F_n that is looked at, in weights of the part."""
COARSE, FINE, AROUND = 37, 25, 1.2  # frictions of the first grid and of the second, and its reach
RATIOS, NEAR = np.linspace(0.0, 0.9, 7), np.linspace(-0.12, 0.12, 9)  # of µ_p/µ_k
FREEDOM = 8.0  # degrees of, of Student's distribution
FEWEST = 5  # slides of which an interval is told
DRAWS = 400
LEVEL = 0.9
LOSS = 1.353
"""Half of what Χ² with one degree of freedom exceeds in 10 % of the cases."""
SYSTEMATIC = 0.05
"""By which intervals are wider on either side, relative: what the model of the motion before and
after a slide may be wrong by. On 16 trials of this bench with known friction it is 0.045 (rms)."""


def _laws(kinetic: Array, ratios: Array) -> tuple[Array, Array]:
    """µ_k F_n/m and µ_p F_n/m, m/s², of all pairs of these, kinetic friction by ratio."""
    first, second = (x.ravel() for x in np.meshgrid(kinetic, ratios, indexing="ij"))
    return first * GRAVITY, first * second * GRAVITY


def _losses(slides: Sequence[Slide], kinetic: Array, ratios: Array) -> Array:
    """Negative log-likelihood of each slide of a trial (slides by frictions by ratios).

    It is that of the deviance residuals, the root of twice what each law loses to the slide's own
    best one, and they are Student's. Source: P. McCullagh, J. A. Nelder, *Generalized Linear
    Models*, 2nd edition 1989, section 2.4."""
    laws = _laws(kinetic, ratios)
    found = np.array([marginal(one.log_likelihoods(*laws)) for one in slides])
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
        """“yes”, “at least” or “at most” the one end of the interval, or “no”."""
        below, above = self.low <= limits[0] * 1.05 + 1e-9, self.high >= limits[1] * 0.95
        if below:
            return "no" if above else "at most"
        return "at least" if above else "yes"


@dataclass(frozen=True)
class Fit:
    """What was found: the ``ratio`` µ_p/µ_k, each trial's ``kinetic`` friction µ_k F_n [weights],
    its ``slides``, and its ``profile``: frictions, and how much less likely each is."""

    ratio: Found
    kinetic: list[Found]
    slides: list[list[Slide]]
    profile: list[tuple[Array, Array]]


def search(trials: Sequence[Trial], limits: Sequence[Interval], plate: bool) -> Fit:
    """The likeliest law, each trial's µ_k F_n [weights] within its limits; without ``plate`` the
    spring-loaded plate has no friction."""
    coarse = np.geomspace(*FRICTIONS, COARSE)
    slides = [slides_of(trial, *_laws(coarse, RATIOS)) for trial in trials]
    ratios = RATIOS if plate else np.zeros(1)
    grids = [coarse.clip(*limit) for limit in limits]
    # ``row`` is the likeliest ratio and ``best`` each trial's friction with it, by their numbers.
    *_, row, best = _looked_at(slides, grids, ratios)
    middles = [grid[k] for grid, k in zip(grids, best, strict=True)]
    # Finer grids about the likeliest law, moved while it lies at the edge of one of them.
    around = np.geomspace(1 / AROUND, AROUND, FINE)
    for _ in range(3):
        if plate:
            ratios = np.unique((ratios[row] + NEAR).clip(0.0))
        grids = [(x * around).clip(*limit) for x, limit in zip(middles, limits, strict=True)]
        *_, row, best = _looked_at(slides, grids, ratios)
        middles = [grid[k] for grid, k in zip(grids, best, strict=True)]
        inside = not plate or (row < len(ratios) - 1 and (row > 0 or ratios[0] == 0.0))
        if inside and not {0, FINE - 1} & set(best):  # none is at the edge of its grid
            break
    # What is likely may reach far beyond the fine grids.
    grids = [np.unique([*coarse.clip(*x), *grid]) for x, grid in zip(limits, grids, strict=True)]
    if plate:
        ratios = np.unique([*RATIOS, *ratios])
    tables, sums, whole, row, best = _looked_at(slides, grids, ratios)
    rows, drawn = _drawn(tables)
    count = [len(table) for table in tables]
    found, profiles = [], []
    for k, (grid, limit) in enumerate(zip(grids, limits, strict=True)):
        # The profile of this trial's friction: at each ratio the other trials take their own best
        # frictions, and of all ratios the likeliest counts.
        others = whole - sums[k].min(axis=0)
        profile = (sums[k] + others).min(axis=1) - whole.min()
        profiles.append((grid, profile))
        value = float(grid[best[k]])
        if count[k] < FEWEST:  # too few to tell their scatter
            value = value if count[k] else float(np.sqrt(limit[0] * limit[1]))
            found.append(Found(value, *limit))
            continue
        likely = _likely(grid, profile)
        found.append(_interval(value, likely, grid[drawn[:, k]], count[k], limit))
    likely = _likely(ratios, whole - whole.min())
    ratio = _interval(float(ratios[row]), likely, ratios[rows], sum(count), (0.0, 9.0))
    return Fit(ratio, found, slides, profiles)


def _looked_at(
    slides: Sequence[list[Slide]], grids: Sequence[Array], ratios: Array
) -> tuple[list[Array], list[Array], Array, int, list[int]]:
    """The losses of each trial's slides by its frictions and the ratios; of its slides together; of
    all trials by the ratios; the likeliest ratio, and with it each trial's friction, by number."""
    tables = [_losses(each, grid, ratios) for each, grid in zip(slides, grids, strict=True)]
    sums = [table.sum(axis=0) for table in tables]
    whole: Array = np.sum([one.min(axis=0) for one in sums], axis=0)
    row = int(whole.argmin())
    return tables, sums, whole, row, [int(one[:, row].argmin()) for one in sums]


def _drawn(tables: Sequence[Array]) -> tuple[Rows, Rows]:
    """The same of slides drawn anew, ``DRAWS`` times: ratios, and frictions by trials."""
    rng = np.random.default_rng(0)
    sums = []
    for table in tables:
        n = max(1, len(table))
        # How often each slide is drawn (draws × slides), and with that the losses of each draw
        # (draws × frictions × ratios).
        weights = rng.multinomial(n, np.full(n, 1 / n), DRAWS)[:, : len(table)]
        sums.append(np.tensordot(weights, table, 1))
    # Of each draw: the ratio that is likeliest over all trials, then each trial's friction with it.
    rows = np.sum([one.min(axis=1) for one in sums], axis=0).argmin(axis=1)
    return rows, np.stack([one[np.arange(DRAWS), :, rows].argmin(axis=1) for one in sums], 1)


def _likely(grid: Array, loss: Array) -> Interval:
    """The ends of what loses at most LOSS, between the points of the grid by straight lines."""
    inside = np.flatnonzero(loss <= LOSS)
    ends = []
    for at, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
        known = 0 <= beyond < len(grid)
        share = (LOSS - loss[at]) / (loss[beyond] - loss[at]) if known else 0.0
        ends.append(float(grid[at] + share * (grid[beyond if known else at] - grid[at])))
    return ends[0], ends[1]


def _interval(value: float, likely: Interval, drawn: Array, count: int, limit: Interval) -> Found:
    """From what is likely and what was drawn; few slides scatter less than many would."""
    # Student's quantile over the normal one.
    few = float(student.ppf((1 + LEVEL) / 2, max(1, count - 1)) / student.ppf((1 + LEVEL) / 2, 1e9))
    ends = []
    for end, share, side in ((likely[0], (1 - LEVEL) / 2, -1), (likely[1], (1 + LEVEL) / 2, 1)):
        scatter = few * (float(np.quantile(drawn, share)) - value)
        # The wider of the two counts, with the model's own error added as the root of squares.
        far = max(side * scatter, side * (end - value), 0.0)
        ends.append(value + side * float(np.hypot(far, SYSTEMATIC * value)))
    return Found(value, max(ends[0], limit[0]), min(ends[1], limit[1]))
