"""The last of a search: least squares over the rig and all trials' own numbers together."""

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from cosim.arrays import Array
from cosim.studies.identify.chain.chain import simulate
from cosim.studies.identify.search.search import SAMPLES, TURN, Found, Search

ENDS_AT = 1e-5
"""Relative gain of a step below which it ends."""


def finish(search: Search, found: Found, steps: int) -> Found:
    """The solution after at most ``steps`` steps, if it is better; priors, too, are in that. What
    was measured beside the trials is among the residuals, with the weight of ``Search.totals``.

    The unknowns are the place and the fitted own numbers in units of their scales.
    """
    targets, d = search.targets, len(found.place)
    free = [np.flatnonzero(target.scale > 0.0) for target in targets]
    starts = d + np.concatenate([[0], np.cumsum([len(one) for one in free])])
    scales = [target.scale[one] for target, one in zip(targets, free, strict=True)]

    weight = np.sqrt(found.costs.mean() / SAMPLES)

    def apart(x: Array) -> tuple[Array, Array]:
        own = found.own.copy()
        for k, (one, scale) in enumerate(zip(free, scales, strict=True)):
            own[k, one] = x[starts[k] : starts[k + 1]] * scale
        return x[:d], own

    def residuals(x: Array) -> Array:
        place, own = apart(x)
        rig = search.space.rigs(place[None])
        rows = search.each(lambda k: simulate(targets[k], rig, own[k][None])[1][0])
        return np.concatenate([*rows, weight * search.space.misses(place[None])[0]])

    def slopes(x: Array) -> Array:
        place, own = apart(x)
        parts = search.each(lambda k: search.slopes(place, own, k)[1])
        turns = np.where(place + TURN <= 1.0, TURN, -TURN)
        there = search.space.misses(np.concatenate([place[None], place + np.diag(turns)]))
        count = sum(part.shape[1] for part in parts)
        whole = np.zeros((len(x), count + there.shape[1]))
        whole[:d, count:] = weight * (there[1:] - there[0]) / turns[:, None]
        row = 0
        for k, part in enumerate(parts):
            columns = slice(row, row := row + part.shape[1])
            whole[:d, columns] = part[:d]
            whole[starts[k] : starts[k + 1], columns] = part[d:]
        return whole.T

    x = [found.place] + [
        own[one] / scale for own, one, scale in zip(found.own, free, scales, strict=True)
    ]
    low, high = (
        np.concatenate(
            [
                np.full(d, end),
                *(getattr(t, name)[f] / s for t, f, s in zip(targets, free, scales, strict=True)),
            ]
        )
        for name, end in (("low", 0.0), ("high", 1.0))
    )
    inside = np.clip(np.concatenate(x), low + 1e-9, high - 1e-9)
    jacobian: Any = slopes  # a callable, which scipy's annotations do not know
    fitted = least_squares(
        residuals, inside, jacobian, (low, high), ftol=ENDS_AT, xtol=1e-8, max_nfev=steps
    )
    place, own = apart(fitted.x)
    return min(found, search.refined(place, own, 2), key=lambda one: one.total)
