"""What the trials say of each key of a rig: a value and how far to trust it, or that they do not.

A local covariance alone would be far too small: the cost has many minima, and a search ends in any
of them. So no range is told until two searches with one law of the suspension have come to the same
cost. Then a range holds the 90 % intervals about all solutions that are as likely, whichever search
and whichever such law they are of, and about the best of every law. What a law's own keys come out
as holds for that law alone; what all laws tell is the suspension's force.
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
"""Of -2 ln L = (effective samples) ln cost: above the least up to this, one key is in its 90 %."""
MISFIT = 2.0
"""Of a standard deviation, which takes residuals for noise; what a rig leaves of the trials is
mostly what the model lacks. On twelve made rigs with such residuals, and priors of their own, the
ranges held 95 % of the true values with it, and 82 % without."""
WITHIN = 1.645 * MISFIT
"""Standard deviations to either side, which hold 90 %."""
ALONE = 1.5
"""Of a single search, whose scatter is not known: the candidates that are told, over the best."""
TRUSTED = 0.35
"""Half of the range of possible values over their middle, up to which a key is identified."""
TIED = 0.4
"""Spread of a product over that of the key alone, up to which only the product is identified."""
SCATTER, FEWEST = 0.05, 4
"""Spread of a key's logarithm and number of solutions, from which on products are looked at."""
END = 0.01
"""Of a bound's range: nearer than this a value is at the bound."""


@dataclass(frozen=True)
class Verdict:
    """On one key; ``low`` and ``high`` bound the possible values where the searches agree."""

    key: str
    value: float
    low: float | None
    high: float | None
    kind: str
    """identified, product, bounded, not; law: of one law alone; or not converged."""
    words: str


def rigs_meant(found: Sequence[Searched], samples: float) -> list[Found]:
    """The rigs that may be meant, the best first: the best of each law; of the laws whose searches
    agree, all that are as likely as the worse of the two; where none agree, of all laws, all within
    the searches' own scatter. ``samples`` is the effective number of what was measured."""
    agreed = [one for one in found if one.converged] or found
    meant = [one.best for one in found if one not in agreed]
    for one in agreed:
        scatter = one.scatter if len(one.ends) > 1 else ALONE
        meant += [*one.ends, *one.within(scatter * float(np.exp(LIKELY / samples)))]
    return sorted(meant, key=lambda rig: rig.total)


def judge(
    best: Found, meant: Sequence[Found], apart: Sequence[Array] | None = None
) -> list[Verdict]:
    """A verdict for each free key of the rig that is reported. ``apart`` are the standard
    deviations of the coordinates of each rig that may be meant; None where no searches agree."""
    space, found = best.space, []
    every = [dict(zip(one.space.names, one.space.values(one.point), strict=True)) for one in meant]
    values = {k: np.array([rig[k] for rig in every]) for k in space.names if k not in OF_LAWS}
    ranges = [_ends(*one) for one in zip(meant, apart, strict=True)] if apart is not None else []
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
            # The rig that is reported with this key at either end: how near the search's bounds.
            at = np.repeat(reported[None], 2, axis=0)
            at[:, k] = ends
            low, high = space.point(at)[:, k].tolist()
            edges = low < END, high > 1.0 - END
            kind, words = _told(value, *ends, *edges, _tie(key, partners))
        found.append(Verdict(key, value, *ends, kind, words))
    return found


def _ends(found: Found, deviations: Array) -> dict[str, list[float]]:
    """The two ends of the 90 % interval about a solution, by key."""
    off = WITHIN * deviations
    ends = found.space.values(np.stack([found.point - off, found.point + off]))
    return dict(zip(found.space.names, ends.T.tolist(), strict=True))


def _told(
    value: float, low: float, high: float, open_low: bool, open_high: bool, tied: str
) -> tuple[str, str]:
    """The kind of a verdict and its words; open is an end at which nothing but the bound is."""
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
    """The product or ratio in which the rigs agree although the key scatters; or nothing."""
    if key not in partners or len(partners[key]) < FEWEST:
        return ""
    alone = partners[key]
    if np.std(alone) < SCATTER:
        return ""
    # Logarithms: a product that all rigs share is a sum without scatter, a ratio a difference.
    found = [
        (float(np.std(alone + sign * other)), f"{word} {name}")
        for name, other in partners.items()
        if name != key
        for sign, word in ((1, "product with"), (-1, "ratio to"))
    ]
    spread, words = min(found)
    return words if spread < TIED * float(np.std(alone)) else ""


def forces(rig: Found, places: Array) -> tuple[Array, Array]:
    """The suspension's force at ``places`` (q, m) less that at the centre, N; over Bl, A."""
    numbers = rig.numbers
    found = suspension_force(numbers, np.append(places, 0.0))  # the last one is the centre's
    apart = found[:-1] - found[-1]
    return apart, apart / numbers["force_factor"]


def at_bounds(low: Array, high: Array, scale: Array, own: Array) -> list[str]:
    """The names of a trial's own parameters that lie at a bound."""
    near = END * scale
    there = (scale > 0.0) & ((own <= low + near) | (own >= high - near))
    return [name for name, one in zip(OWN, there, strict=True) if one]
