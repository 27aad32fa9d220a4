"""The fit of whole paths: µ_k (and µ_p) shared by all trials, a normal force for each.

Least is the mean error of the part's path over each whole trial, as its authors measure it
(`cosim.studies.fit.cases`). Given the ratios µ_k/µ_s and µ_p/µ_s the trials have nothing in common,
so that a fit of eleven numbers is ten searches in one dimension for each ratio on a line. The error
jumps where a parameter makes the part miss a stick, so the searches use grids, finer and finer, and
no slope.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.studies.fit.intervals import Interval, Rows, laws

Errors = Callable[[Array], Array]
"""The mean errors [m] in one trial, for rows of laws (`cosim.mechanics.part.heights`)."""

FRICTIONS = 65  # on the first grid of normal forces
CANDIDATES = 2  # minima of it that are looked into
ROUNDS, POINTS = 3, 9  # finer and finer grids around each
SLIP_STEPS = (0.025, 0.005, 0.001)  # of µ_k/µ_s
COARSE = 0.1
PLATE_STEPS = (0.07, 0.0175, 0.005)  # of µ_p/µ_s
LARGEST_PLATE = 0.42
RESAMPLES = 2000  # of the trials
NEAR = 1.05  # over the least error: with less, parameters are about as good


@dataclass(frozen=True)
class Paths:
    """What was found, and all that was tried on the way.

    ``tried`` holds rows (µ_k/µ_s, µ_p/µ_s); the others have a row for each of them and a column for
    each trial: ``errors`` [m] and ``static``, µ_s F_n [weights], from the least to the most with
    which the error is about as good, the best between.
    """

    tried: Array
    errors: Array
    static: Array

    @property
    def best(self) -> int:
        """The row with the least mean error."""
        return int(self.errors.mean(axis=1).argmin())

    @property
    def ratios(self) -> Array:
        """Rows (µ_k/µ_s, µ_p/µ_k)."""
        return np.stack([self.tried[:, 0], self.tried[:, 1] / self.tried[:, 0]], axis=1)

    @property
    def loss(self) -> Array:
        """How much larger the mean error is than the least, 1 where it is not about as good."""
        mean = self.errors.mean(axis=1)
        return (mean / (mean.min() or 1.0) - 1) / (NEAR - 1)

    @property
    def possible(self) -> npt.NDArray[np.bool_]:
        """Rows that are about as good, and those that 95 % of resampled trials would have given."""
        count = self.errors.shape[1]
        draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), RESAMPLES)
        found = (self.errors @ draws.T).argmin(axis=0)
        slips = self.tried[found, 0]
        low, high = np.quantile(slips, (0.025, 0.975))
        rows = self.loss <= 1
        rows[found[(slips >= low) & (slips <= high)]] = True
        return rows

    def frictions(self, trial: int) -> Array:
        """The best µ_k F_n [weights] of a trial with each row."""
        return self.static[:, trial, 1] * self.tried[:, 0]

    def possible_frictions(self, trial: int) -> tuple[Rows, Array]:
        """Rows and the µ_k F_n [weights] that are possible with them."""
        rows = np.flatnonzero(self.possible)
        friction = self.static[rows, trial] * self.tried[rows, :1]
        return np.repeat(rows, friction.shape[1]), friction.ravel()

    def leave_one_out(self) -> tuple[Array, Array]:
        """Each trial's error [m] with the ratios that are best for the others, and these µ_k/µ_s.

        The normal force belongs to the trial and is fitted to it, given these ratios.
        """
        trials = self.errors.shape[1]
        if trials < 2:
            return self.errors[self.best], self.tried[[self.best], 0]
        rows = (self.errors.sum(axis=1)[:, None] - self.errors).argmin(axis=0)
        return self.errors[rows, np.arange(trials)], self.tried[rows, 0]


def best_friction(errors: Errors, limit: Interval, slip: float, plate: float) -> Array:
    """Of one trial with ratios µ_k/µ_s and µ_p/µ_s, the least error [m], and the µ_s F_n [weights]:
    the least that is about as good, the best, and the most, within ``limit``."""

    def found(static: Array) -> Array:
        return errors(laws(static * slip, slip, plate / slip))

    low, high = limit
    tried = np.geomspace(low, high, FRICTIONS)
    values = found(tried)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    minima = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    for start in minima[np.argsort(values[minima], kind="stable")[:CANDIDATES]]:
        middle = float(tried[start])
        width = middle * ((high / low) ** (1 / (FRICTIONS - 1)) - 1)
        for _ in range(ROUNDS):
            near = np.clip(middle + width * np.linspace(-1, 1, POINTS), low, high)
            nearby = found(near)
            middle, width = float(near[nearby.argmin()]), width * 2 / (POINTS - 1)
            tried, values = np.append(tried, near), np.append(values, nearby)
    good = tried[values <= NEAR * values.min()]
    return np.array([values.min(), good.min(), tried[values.argmin()], good.max()])


def search(errors: Sequence[Errors], limits: Sequence[Interval], plate: bool) -> Paths:
    """Fit µ_k/µ_s, each µ_s F_n [weights] within its limits and, with ``plate``, µ_p/µ_s."""
    done: dict[tuple[float, float], Array] = {}

    def look(slips: Iterable[float], plates: Iterable[float]) -> None:
        for slip, rub in product(slips, plates):
            key = (round(slip, 9), round(rub, 9))
            if key not in done:
                pairs = zip(errors, limits, strict=True)
                done[key] = np.array([best_friction(*pair, *key) for pair in pairs])

    def best() -> tuple[float, float]:
        return min(done, key=lambda key: float(done[key][:, 0].sum()))

    step = SLIP_STEPS[0]
    plates = _line(0.0, LARGEST_PLATE, PLATE_STEPS[0]) if plate else [0.0]
    look(_line(2 * step, 1.0, 2 * step) if plate else _line(step, 1.0, step), plates)
    for k in range(2):
        slip, rub = best()
        low, high = max(step, slip - SLIP_STEPS[k]), min(1.0, slip + SLIP_STEPS[k])
        wide = max(0.0, rub - PLATE_STEPS[k]), min(LARGEST_PLATE, rub + PLATE_STEPS[k])
        plates = _line(*wide, PLATE_STEPS[k + 1]) if plate else [0.0]
        look(_line(low, high, SLIP_STEPS[k + 1]), plates)
    if plate:  # the whole profile over µ_k, at the best µ_p
        look(_line(step, 1.0, step), [best()[1]])
    return _paths(done)


def least_error(errors: Sequence[Errors], limits: Sequence[Interval]) -> float:
    """The least mean error [m] over all laws without a plate, about."""
    slips = _line(COARSE, 1.0, COARSE)
    pairs = list(zip(errors, limits, strict=True))
    return min(
        float(np.mean([best_friction(*pair, slip, 0.0)[0] for pair in pairs])) for slip in slips
    )


def _paths(done: dict[tuple[float, float], Array]) -> Paths:
    tried = sorted(done)
    values = np.array([done[key] for key in tried])
    return Paths(np.array(tried), values[:, :, 0], values[:, :, 1:])


def _line(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, max(2, round((high - low) / step) + 1))
