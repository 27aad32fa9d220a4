"""The verdict on each key of a rig: its value and range, or that the trials do not determine it.

A local covariance alone would be far too small: the cost has many minima, and a search ends in any
of them. So no range is given until two searches with one law of the suspension reach the same cost.
Then the range of a key covers the 90 % intervals about all solutions of such laws that are about as
likely as these two, and about the best of every law. Keys of a law have values for this law alone;
what the laws have in common is the suspension's force.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array
from cosim.mechanics.stickslip import suspension_force
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import OF_LAWS
from cosim.studies.identify.search.plan import Searched
from cosim.studies.identify.search.search import Found

LIKELY = 2.71
"""Rise of -2 ln L = (effective samples) ln cost above its minimum, within which a single key lies
in its 90 % interval (quantile of Χ² with one degree of freedom)."""
MISFIT = 2.0
"""Factor on the standard deviations, which take residuals for noise: mostly they are errors of the
model. On twelve made rigs with such residuals, and priors of their own, the ranges covered 95 % of
the true values with this factor, and 82 % without."""
WITHIN = 1.645 * MISFIT
"""Standard deviations to either side of a solution that its 90 % interval covers."""
ALONE = 1.5
"""Ratio to the best cost up to which candidates of a single search, of unknown scatter, count."""
TRUSTED = 0.35
"""Half of a key's range over the range's middle, up to which the key is identified."""
TIED = 0.4
"""Spread of a product over that of the key alone, up to which only the product is identified."""
SCATTER, FEWEST = 0.05, 4
"""Least spread of a key's logarithm, and least number of solutions, for products to be tried."""
END = 0.01
"""Share of a bound's range; a value nearer to the bound than this is at the bound."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one key; ``low`` and ``high`` are its range, None where searches disagree."""

    key: str
    value: float
    low: float | None
    high: float | None
    kind: str
    """“identified”, “product”, “bounded”, “not”, “law” (of one law alone) or “not converged”."""
    words: str


def rigs_meant(found: Sequence[Searched], samples: float) -> list[Found]:
    """The rigs that may be the true one, the best first: the best of each law, and of each law
    whose searches agree (of all laws where none do) all candidates within the scatter of the
    searches and LIKELY of the best. ``samples`` is the effective number of measured samples."""
    agreed = [one for one in found if one.converged] or found
    meant = [one.best for one in found if one not in agreed]
    for one in agreed:
        scatter = one.scatter if len(one.ends) > 1 else ALONE
        meant += [*one.ends, *one.within(scatter * float(np.exp(LIKELY / samples)))]
    return sorted(meant, key=lambda rig: rig.total)


def judge(
    best: Found, meant: Sequence[Found], apart: Sequence[Array] | None = None
) -> list[Verdict]:
    """A verdict for each free key of the reported rig ``best``. ``apart`` holds the standard
    deviations of the coordinates of each rig in ``meant``; None where no searches agree."""
    space, found = best.space, []
    rigs = [dict(zip(one.space.names, one.space.values(one.point), strict=True)) for one in meant]
    values = {k: np.array([rig[k] for rig in rigs]) for k in space.names if k not in OF_LAWS}
    ranges = [_ends(*one) for one in zip(meant, apart, strict=True)] if apart is not None else []
    # Logarithms of what a key may form a product with: other keys, and means over trials' numbers.
    partners = {key: np.log(x) for key, x in values.items() if (x > 0.0).all()}
    for name in ("amplitude", "normal_force"):
        own = np.array([one.own[:, OWN.index(name)] for one in meant])
        if (own > 0.0).all():
            partners[f"the trials' {name.replace('_', ' ')}s"] = np.log(own).mean(axis=1)
    reported = space.values(best.point)
    for k, (key, value) in enumerate(zip(space.names, reported.tolist(), strict=True)):
        ends = None, None
        if key in OF_LAWS:
            kind, words = "law", f"of the law {space.law} alone; what holds is the force below"
        elif apart is None:
            kind, words = "not converged", "not converged"
        else:
            ends = (
                min(value, *(one[key][0] for one in ranges)),
                max(value, *(one[key][1] for one in ranges)),
            )
            # The coordinates of the range's ends tell whether they are at the search's bounds.
            at = np.repeat(reported[None], 2, axis=0)
            at[:, k] = ends
            low, high = space.point(at)[:, k].tolist()
            edges = low < END, high > 1.0 - END
            kind, words = _told(value, *ends, *edges, _tie(key, partners))
        found.append(Verdict(key, value, *ends, kind, words))
    return found


def _ends(found: Found, deviations: Array) -> dict[str, list[float]]:
    """The two ends of the 90 % interval of each key about a solution."""
    off = WITHIN * deviations
    ends = found.space.values(np.stack([found.point - off, found.point + off]))
    return dict(zip(found.space.names, ends.T.tolist(), strict=True))


def _told(
    value: float, low: float, high: float, open_low: bool, open_high: bool, tied: str
) -> tuple[str, str]:
    """The kind of a verdict and its words; an end of the range is open where it is at a bound."""
    numbers = f"{low:.3g} to {high:.3g}"
    if open_low and open_high:
        return "not", f"not identified: anything from {numbers} does as well"
    if open_low or open_high:
        end = f"at most {high:.3g}" if open_low else f"at least {low:.3g}"
        return "bounded", f"bounded on one side only: {end}"
    if 0.5 * (high - low) <= TRUSTED * 0.5 * abs(high + low):
        return "identified", f"identified: {value:.3g} within {numbers}"
    if tied:
        return "product", f"only as its {tied}; alone {numbers}"
    return "bounded", f"known roughly: {numbers}"


def _tie(key: str, partners: Mapping[str, Array]) -> str:
    """The product or ratio in which the rigs agree although the key scatters; "" without one."""
    if key not in partners or len(partners[key]) < FEWEST:
        return ""
    alone = partners[key]
    if np.std(alone) < SCATTER:
        return ""
    # In logarithms a product that all rigs share is a sum without scatter, a ratio a difference.
    found = [
        (float(np.std(alone + sign * other)), f"{word} {name}")
        for name, other in partners.items()
        if name != key
        for sign, word in ((1, "product with"), (-1, "ratio to"))
    ]
    spread, words = min(found)
    return words if spread < TIED * float(np.std(alone)) else ""


def forces(rig: Found, places: Array) -> tuple[Array, Array]:
    """The suspension's force at ``places`` (q, m) less that at the centre, N; and over Bl, A."""
    numbers = rig.numbers
    found = suspension_force(numbers, np.append(places, 0.0))  # the last one is the centre's
    apart = found[:-1] - found[-1]
    return apart, apart / numbers["force_factor"]


def at_bounds(low: Array, high: Array, scale: Array, own: Array) -> list[str]:
    """The names of a trial's own parameters that lie at a bound."""
    near = END * scale
    at_bound = (scale > 0.0) & ((own <= low + near) | (own >= high - near))
    return [name for name, yes in zip(OWN, at_bound, strict=True) if yes]
