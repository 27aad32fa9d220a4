"""What the trials say of each key of a rig: a value and how far to trust it, or that they do not.

A local covariance would be far too small: the cost has many minima, and a search ends in any of
them. So a key is judged by the values of all solutions that are nearly as good (the ensemble), of
the folds, and by its profile: the best cost with that key held elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import Space
from cosim.studies.identify.search.search import Found

KEPT = 1.5
"""Times the best cost, up to which a solution belongs to the ensemble."""
AS_GOOD = 1.1
"""Times the best cost, up to which a value counts as possible."""
TRUSTED = 0.35
"""Half of the range of possible values over their middle, up to which a key is identified."""
TIED = 0.4
"""Spread of a product over that of the key alone, up to which only the product is identified."""
SCATTER, FEWEST = 0.05, 4
"""Spread of a key's logarithm and number of solutions, from which on products are looked at."""

Profile = list[tuple[float, float]]
"""Values of a key, rising, and the best cost with each."""


@dataclass(frozen=True)
class Verdict:
    """On one key: ``low`` and ``high`` bound the possible values, and are the bounds of the search
    where nothing else does (``open_low``, ``open_high``)."""

    key: str
    value: float
    low: float
    high: float
    open_low: bool
    open_high: bool
    ensemble: tuple[float, float]
    folds: tuple[float, float] | None
    kind: str
    """identified, product, bounded or not."""
    words: str


def ensemble_of(found: Sequence[Found]) -> list[Found]:
    """The solutions within KEPT times the best cost, the best first."""
    ordered = sorted(found, key=lambda one: one.total)
    return [one for one in ordered if one.total <= KEPT * ordered[0].total]


def judge(
    space: Space,
    best: Found,
    ensemble: Sequence[Found],
    folds: Sequence[Found],
    profiles: Mapping[str, Profile],
) -> list[Verdict]:
    """A verdict for each free key. ``best`` is the solution that is reported; profiles and
    ensemble, the best first, have costs at the step of the search."""
    cost = min(ensemble[0].total, *(low for points in profiles.values() for _, low in points))
    near = [one for one in ensemble if one.total <= AS_GOOD * cost] or [best]
    values = {key: _column(space, ensemble, k) for k, key in enumerate(space.names)}
    near_values = {key: _column(space, near, k) for k, key in enumerate(space.names)}
    fold_values = {key: _column(space, folds, k) for k, key in enumerate(space.names)}
    partners = {key: np.log(v) for key, v in values.items() if (v > 0.0).all()}
    for name in ("amplitude", "normal_force"):
        numbers = np.array([one.own[:, OWN.index(name)] for one in ensemble])
        if (numbers > 0.0).all():
            partners[f"the trials' {name.replace('_', ' ')}s"] = np.log(numbers).mean(axis=1)
    return [
        _verdict(
            *(key, float(space.values(best.place)[k]), space.free[k].low, space.free[k].high),
            *(profiles[key], near_values[key], values[key], fold_values[key], partners, cost),
        )
        for k, key in enumerate(space.names)
    ]


def _column(space: Space, found: Sequence[Found], k: int) -> Array:
    return np.array([space.values(one.place)[k] for one in found])


def _verdict(
    key: str,
    value: float,
    least: float,
    most: float,
    profile: Profile,
    near: Array,
    ensemble: Array,
    folds: Array,
    partners: Mapping[str, Array],
    cost: float,
) -> Verdict:
    low, high = (_end(profile, cost, side) for side in (-1, 1))
    open_low, open_high = low is None, high is None
    bottom = least if low is None else min(low, float(near.min()))
    top = most if high is None else max(high, float(near.max()))
    everything = np.concatenate([[bottom, top], folds])
    share = _half_range(everything)
    tied = _tie(key, partners)
    numbers = f"{bottom:.3g} to {top:.3g}"
    if not (open_low or open_high) and share <= TRUSTED:
        kind, words = (
            "identified",
            f"identified: {value:.3g} within {numbers}; with the folds ±{share:.0%}",
        )
    elif tied:
        kind, words = "product", f"only as its {tied}; alone {numbers}"
    elif open_low and open_high:
        kind, words = (
            "not",
            f"not identified: anything from {least:.3g} to {most:.3g} does nearly as well",
        )
    elif open_low or open_high:
        end = f"at most {top:.3g}" if open_low else f"at least {bottom:.3g}"
        kind, words = "bounded", f"bounded on one side only: {end}"
    else:
        kind = "bounded"
        words = (
            f"known roughly: {numbers}, in the folds {folds.min():.3g} to {folds.max():.3g}"
            if len(folds)
            else f"known roughly: {numbers}"
        )
    return Verdict(
        *(key, value, bottom, top, open_low, open_high),
        (float(ensemble.min()), float(ensemble.max())),
        (float(folds.min()), float(folds.max())) if len(folds) else None,
        *(kind, words),
    )


def _end(profile: Profile, cost: float, side: int) -> float | None:
    """Where the profile leaves what is as good, to one side; None: it does not."""
    points = sorted(profile, key=lambda point: side * point[0])
    limit = AS_GOOD * cost
    good = [k for k, (_, there) in enumerate(points) if there <= limit]
    if not good or good[-1] + 1 == len(points):
        return None
    (x0, y0), (x1, y1) = points[good[-1]], points[good[-1] + 1]
    return x0 + (x1 - x0) * (limit - y0) / (y1 - y0)


def _half_range(values: Array) -> float:
    middle = 0.5 * abs(float(values.max() + values.min()))
    return float(np.ptp(values)) / 2.0 / middle if middle else np.inf


def _tie(key: str, partners: Mapping[str, Array]) -> str:
    """The product or ratio in which the ensemble agrees although the key scatters; or nothing."""
    if key not in partners or len(partners[key]) < FEWEST:
        return ""
    alone = partners[key]
    if np.std(alone) < SCATTER:
        return ""
    found = [
        (float(np.std(alone + sign * other)), f"{word} {name}")
        for name, other in partners.items()
        if name != key
        for sign, word in ((1, "product with"), (-1, "ratio to"))
    ]
    spread, words = min(found)
    return words if spread < TIED * float(np.std(alone)) else ""
