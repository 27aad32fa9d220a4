"""What a fit tells of each parameter: its value, its interval, and whether the tracks determine it.

Tracks alone know no force, only accelerations: µ_s F_n/m, µ_k F_n/m and µ_p F_n/m. So a fit finds
the ratios µ_k/µ_s and µ_p/µ_k, shared by all trials, and a kinetic friction µ_k F_n for each; all
else follows from µ_s, or µ_s from bounds of the normal forces. Forces are in weights of the part.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from cosim.arrays import Array
from cosim.trials.published import GRAVITY

Interval = tuple[float, float]
Rows = npt.NDArray[np.intp]

SYSTEMATIC = 0.02
"""By which the intervals are wider on either side, relative: what the motion between frames may be
wrong by. On runs of this bench, whose parameters are known, that makes 0.01."""
FRICTIONS: Interval = (0.3, 60.0)  # µ F_n that is looked at


class Law(Protocol):
    """Ratios of a law of friction that were tried, and what the tracks say of them."""

    @property
    def ratios(self) -> Array:
        """Rows (µ_k/µ_s, µ_p/µ_k)."""
        ...

    @property
    def best(self) -> int:
        """The row that is taken."""
        ...

    @property
    def loss(self) -> Array:
        """How much worse each row is than the best; 1 bounds what is possible."""
        ...

    @property
    def possible(self) -> npt.NDArray[np.bool_]:
        """The rows that are."""
        ...

    def frictions(self, trial: int) -> Array:
        """The µ_k F_n of a trial that is best with each row."""
        ...

    def possible_frictions(self, trial: int) -> tuple[Rows, Array]:
        """Rows and the µ_k F_n of a trial that are possible with them."""
        ...


def laws(friction: Array, slip_ratio: Array | float, plate_ratio: Array | float) -> Array:
    """Rows for `cosim.mechanics.part.heights`, m/s², from µ_k F_n, µ_k/µ_s and µ_p/µ_k."""
    one = np.ones_like(friction)
    return np.stack([friction / slip_ratio, friction, friction * plate_ratio, one], -1) * GRAVITY


def shared(
    law: Law, limits: Sequence[Interval], given: float | None, plate: bool
) -> dict[str, Any]:
    """What is found for all trials; µ_s ``given``, or from the ``limits`` of the normal forces."""
    slip, rub = law.ratios[law.best]
    possible = law.ratios[law.possible]
    mu_s, mu_s_range = (given, (given, given)) if given else _static(law, limits)
    slip_range = _wider((possible[:, 0].min(), possible[:, 0].max()), (0.0, 1.0))
    numbers: dict[str, Any] = {
        "mu_s": mu_s,
        "mu_k": float(slip) * mu_s,
        "mu_k_95_percent": [slip_range[0] * mu_s_range[0], slip_range[1] * mu_s_range[1]],
        "mu_k_determined": _determined(slip_range, (float(law.ratios[:, 0].min()), 1.0)),
        "mu_k_over_mu_s": float(slip),
        "mu_plate": float(slip * rub) * mu_s,
    }
    if not given:
        numbers["mu_s_95_percent"] = list(mu_s_range)
    if plate:
        rubs = possible.prod(axis=1)
        low, high = _wider((rubs.min(), rubs.max()), (0.0, np.inf))
        numbers["mu_plate_95_percent"] = [low * mu_s_range[0], high * mu_s_range[1]]
    slips = np.unique(law.ratios[:, 0].round(9))
    losses = [law.loss[np.isclose(law.ratios[:, 0], slip)].min() for slip in slips]
    numbers["profile"] = {"mu_k": (slips * mu_s).tolist(), "loss": np.array(losses).tolist()}
    return numbers


def own(
    law: Law, trial: int, limit: Interval, mu_s_range: Interval, mu_s: float, bounded: bool
) -> dict[str, Any]:
    """What is found of one trial; ``bounded``: within the limit of its normal force."""
    slips = law.ratios[:, 0]
    kinetic = float(law.frictions(trial)[law.best])
    rows, possible = law.possible_frictions(trial)
    normal = possible / slips[rows]
    bounds = limit if bounded else FRICTIONS
    wide = _wider((normal.min() / mu_s_range[1], normal.max() / mu_s_range[0]), bounds)
    kinetic_range = _wider((possible.min(), possible.max()), FRICTIONS)
    return {
        "normal_force_weights": float(kinetic / slips[law.best] / mu_s),
        "normal_force_95_percent": list(wide),
        "normal_force_determined": _determined(wide, bounds),
        "kinetic_friction_weights": kinetic,
        "kinetic_friction_95_percent": list(kinetic_range),
        "kinetic_friction_determined": _determined(kinetic_range, FRICTIONS),
    }


def _wider(interval: Interval, limits: Interval) -> Interval:
    low, high = interval[0] * (1 - SYSTEMATIC), interval[1] * (1 + SYSTEMATIC)
    return float(max(low, limits[0])), float(min(high, limits[1]))


def _determined(interval: Interval, limits: Interval) -> str:
    """“yes”, “at least” or “at most” the one end of the interval, or “no”."""
    below = interval[0] <= limits[0] * (1 + SYSTEMATIC)
    above = interval[1] >= limits[1] * (1 - SYSTEMATIC)
    if below:
        return "no" if above else "at most"
    return "at least" if above else "yes"


def _static(law: Law, limits: Sequence[Interval]) -> tuple[float, Interval]:
    """µ_s and the interval of it, from limits of the normal forces.

    The tracks give µ_s F_n of each trial, so limits of F_n bound µ_s. Where all of them leave room
    it is the interval, µ_s its (geometric) middle; else the µ_s that breaks them least, in the
    sense of least squares of logarithms, and the interval is that of a mean of as many trials.
    """
    low, high = np.log(np.array(limits)).T
    frictions = np.array([law.frictions(trial) for trial in range(len(limits))])
    static = np.log(frictions / law.ratios[:, 0])
    every = [_range(static[:, row], low, high) for row in np.flatnonzero(law.possible)]
    least, most = _range(static[:, law.best], low, high)
    return float(np.exp((least + most) / 2)), (
        float(np.exp(min(least for least, _ in every))),
        float(np.exp(max(most for _, most in every))),
    )


def _range(static: Array, low: Array, high: Array) -> Interval:
    """From and to of the logarithm of µ_s, for those of µ_s F_n and the limits of F_n."""
    from_, to = static - high, static - low
    if from_.max() <= to.min():
        return float(from_.max()), float(to.min())

    def outside(x: float) -> Array:
        return np.maximum(x - to, 0.0) - np.maximum(from_ - x, 0.0)

    middle: Any = brentq(lambda x: float(outside(x).sum()), to.min(), from_.max())
    error = 1.96 * float(np.sqrt((outside(middle) ** 2).mean() / len(static)))
    return float(middle) - error, float(middle) + error
