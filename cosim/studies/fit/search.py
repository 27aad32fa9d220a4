"""The search for the likeliest law of friction: ratios shared by all trials, a friction for each.

Given the ratios µ_k/µ_s and µ_p/µ_k the trials have nothing in common, and each is a search in one
dimension. How much a change of the ratios harms is summed over the trials. Beforehand the mass of
the part over the surface's and the time that an impact lasts are found by the same likelihood, that
of the tracks of part and surface together.

How certain all this is, the profile of the likelihood tells, its logarithm divided by how much more
the trials differ than it allows: it knows little of what the reconstruction misses.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.studies.fit.between.breaks import MOST_FRAMES
from cosim.studies.fit.between.motion import Lasting, Motion
from cosim.studies.fit.between.together import Frames, Together
from cosim.studies.fit.intervals import FRICTIONS as EDGES
from cosim.studies.fit.intervals import Interval, Rows, laws
from cosim.studies.fit.stretches import SPREADS, Stretches

RATIOS = np.arange(0.0, 1.45, 0.1)  # the part's mass over the surface's
WIDTHS = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.9]) * 1e-3  # s, that a break lasts
GUESS = (0.82, 0.2)  # µ_k/µ_s, and µ_p/µ_k if it is fitted, while masses and impacts are sought
FRICTIONS = np.geomspace(*EDGES, 49)  # µ_k F_n in weights of the part
NEAR_FRICTION = np.linspace(-0.1, 0.1, 17)  # relative
SLIP_STEPS = (0.1, 0.0125, 0.0025)  # of µ_k/µ_s, up to 1: all, then finer and finer
NEAR_SLIP = (1.0, 0.0125)  # on either side of the likeliest before; the law may stick or slip as a
# step, so all is looked through finely
PLATE_STEPS = (0.1, 0.025, 0.0125)  # of µ_p/µ_k
NEAR_PLATE = (0.05, 0.0125)
LARGEST_PLATE = 0.6
MOVES = 2  # of the frictions that are looked at
ALIKE = 2.0  # as a logarithm; no less likely, for what the tables can tell
LIKELY = 1.92  # half of what Χ² with one degree of freedom exceeds in 5 % of the cases
FEWEST_PARTS = 4
LEAST_DISPERSION = 26.0
"""What the reconstruction misses alike in all trials they cannot tell. On runs of this bench whose
trials agree the true law is up to 19 in log-likelihood off the likeliest with 5 µm of noise, and 49
where the shutter is open half the time: 26 times LIKELY."""


@dataclass(frozen=True)
class Table:
    """What one trial says: minus the logarithm of the likelihood, stretches by laws' ratios by
    frictions; and the kinetic frictions [weights], ratios by frictions."""

    unlikelihood: Array
    friction: Array

    def best(self) -> tuple[Array, Array]:
        """For each pair of ratios the likeliest friction, and its unlikelihood."""
        summed = self.unlikelihood.sum(axis=0)
        every, least = np.arange(len(summed)), summed.argmin(axis=1)
        return self.friction[every, least], summed[every, least]


@dataclass(frozen=True)
class Fit:
    """What was found. ``ratios`` holds rows (µ_k/µ_s, µ_p/µ_k) that were tried, ``best`` the row of
    the likeliest, ``profile`` how much less likely each row is, as a logarithm."""

    ratios: Array
    tables: list[Table]
    best: int
    profile: Array
    dispersion: float
    mass_ratio: float
    lasting: Lasting
    together: list[Together]
    stretches: list[Stretches]
    wide: list[Array]
    """The unlikelihood of each of ``FRICTIONS`` with the likeliest ratios, for each trial."""

    @property
    def loss(self) -> Array:
        """How much less likely each row is than the likeliest, over what is possible yet."""
        return self.profile / self._threshold

    @property
    def possible(self) -> npt.NDArray[np.bool_]:
        """The rows that are."""
        return self.loss <= 1

    @property
    def _threshold(self) -> float:
        return LIKELY * self.dispersion

    def frictions(self, trial: int) -> Array:
        """The kinetic friction [weights] of a trial with each row."""
        return self.tables[trial].best()[0]

    def possible_frictions(self, trial: int) -> tuple[Rows, Array]:
        """Rows and the kinetic frictions [weights] that are possible with them."""
        table = self.tables[trial]
        summed = table.unlikelihood.sum(axis=0)
        worse = self.profile[:, None] + summed - summed.min(axis=1, keepdims=True)
        rows, columns = np.nonzero(worse <= self._threshold)
        far = FRICTIONS[self.wide[trial] - summed[self.best].min() <= self._threshold]
        return (
            np.append(rows, np.full(len(far), self.best)),
            np.append(table.friction[rows, columns], far),
        )


def search(
    seen: Sequence[Frames],
    limits: Sequence[Interval],
    plate: bool,
    mass_ratio: float | None = None,
) -> Fit:
    """Fit the law to tracked trials, each µ_s F_n [weights] within its limits."""
    short = [_cut(frames) for frames in seen]
    ratio = _masses(short, plate) if mass_ratio is None else mass_ratio
    both = [Together(frames, ratio, plate, None) for frames in short]
    motions = [one.motion() for one in both]
    guess = np.array([GUESS[0], GUESS[1] if plate else 0.0])
    lasting = _lasting(both, motions, [None] * len(both), guess)
    rough = _Tables(both, motions, lasting, limits, guess)
    rough.look(*_wide(plate))
    rough.look(*_near(rough.best, plate, 0))
    lasting = _lasting(both, motions, rough.frictions, rough.best)
    both = [Together(frames, ratio, plate, None) for frames in seen]
    tables = _Tables(both, [one.motion() for one in both], lasting, limits, rough.best)
    for stage in range(2):
        tables.look(*_near(tables.best, plate, stage))
    total, best = tables.total, tables.middle
    return Fit(
        *(tables.ratios, tables.tables, best, total - total.min()),
        *(_dispersion(tables.tables, best, 2 if plate else 1), ratio, lasting),
        *(both, tables.stretches, tables.wide(best)),
    )


def _wide(plate: bool) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return (0.0, 1.0, SLIP_STEPS[0]), (0.0, LARGEST_PLATE * plate, PLATE_STEPS[0])


def _near(
    centre: Array, plate: bool, stage: int
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """From, to and step of µ_k/µ_s and µ_p/µ_k about ``centre``."""
    slip, rub = NEAR_SLIP[stage], NEAR_PLATE[stage]
    low, high = max(0.0, centre[0] - slip), min(1.0, centre[0] + slip)
    return (low, high, SLIP_STEPS[stage + 1]), (
        *(max(0.0, centre[1] - rub), (centre[1] + rub) * plate, PLATE_STEPS[stage + 1]),
    )


class _Tables:
    """The tables of all trials, for the ratios that have been looked at."""

    def __init__(
        self,
        both: Sequence[Together],
        motions: Sequence[Motion],
        lasting: Lasting,
        limits: Sequence[Interval],
        guess: Array,
    ) -> None:
        pairs = zip(both, motions, strict=True)
        self.stretches = [Stretches(*pair, lasting) for pair in pairs]
        self._limits, self.best = limits, guess
        scanned = [_scan(one, guess, None) for one in self.stretches]
        self._spreads = [spread for _, spread, _ in scanned]
        self.ratios = guess[None]
        self._start = [np.array([friction]) for _, _, friction in scanned]
        self.tables: list[Table] = []
        self.total = np.zeros(0)

    def look(self, slip: tuple[float, float, float], plate: tuple[float, float, float]) -> None:
        """At more pairs of ratios, the frictions near those of the nearest pair before."""
        pairs = _pairs(slip, plate)
        nearest = (np.abs(pairs[:, None] - self.ratios) / (1, 0.3)).sum(axis=2).argmin(axis=1)
        known = [table.best()[0] for table in self.tables] or self._start
        every = zip(self.stretches, self._spreads, self._limits, known, strict=True)
        new = [
            _table(one, spread, limit, pairs, friction[nearest])
            for one, spread, limit, friction in every
        ]
        self.ratios = np.concatenate([self.ratios, pairs]) if self.tables else pairs
        joined = zip(self.tables, new, strict=True) if self.tables else ()
        self.tables = [_joined(*pair) for pair in joined] or new
        self.total = np.sum([table.best()[1] for table in self.tables], axis=0)
        self.best = self.ratios[self.total.argmin()]

    @property
    def frictions(self) -> list[float | None]:
        """The likeliest of each trial."""
        return [float(table.best()[0][self.total.argmin()]) for table in self.tables]

    def wide(self, row: int) -> list[Array]:
        """The unlikelihood of all frictions with a row of ratios, for each trial."""
        found = zip(self.stretches, self._spreads, strict=True)
        law = laws(FRICTIONS, *self.ratios[row])
        return [one.unlikelihoods(one.misses(law), spread).sum(axis=0) for one, spread in found]

    @property
    def middle(self) -> int:
        """Rows that are about as likely as the likeliest are one broad optimum: its middle."""
        likely = np.flatnonzero(self.total < self.total.min() + ALIKE)
        middle = self.ratios[likely].min(axis=0) / 2 + self.ratios[likely].max(axis=0) / 2
        return int(likely[((self.ratios[likely] - middle) ** 2).sum(axis=1).argmin()])


def _pairs(slip: tuple[float, float, float], plate: tuple[float, float, float]) -> Array:
    """All pairs of µ_k/µ_s and µ_p/µ_k, each from, to and step; µ_k/µ_s not 0."""
    lines = [
        np.linspace(low, high, round((high - low) / step) + 1) for low, high, step in (slip, plate)
    ]
    pairs = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    return pairs[pairs[:, 0] > 0]


def _cut(seen: Frames) -> Frames:
    rows = slice(0, MOST_FRAMES)
    arrays = {k: v[rows] for k, v in vars(seen).items() if isinstance(v, np.ndarray)}
    return replace(seen, **arrays)


def _scan(stretches: Stretches, ratios: Array, near: float | None) -> tuple[float, float, float]:
    """The least unlikelihood, and spread and friction with it: of all frictions, first coarse, then
    fine, or of those near a known one."""
    frictions = FRICTIONS if near is None else near * (1 + NEAR_FRICTION)
    while True:
        found = stretches.misses(laws(frictions, *ratios))
        values = np.array([stretches.unlikelihoods(found, s).sum(axis=0) for s in SPREADS])
        spread, best = np.unravel_index(values.argmin(), values.shape)
        if frictions is not FRICTIONS:
            return float(values.min()), float(SPREADS[spread]), float(frictions[best])
        frictions = frictions[best] * (1 + NEAR_FRICTION)


def _masses(seen: Sequence[Frames], plate: bool) -> float:
    """The likeliest ratio of masses: that with which both together move most smoothly."""
    last: list[Together | None] = [None] * len(seen)
    costs = []
    for ratio in RATIOS:
        last = [Together(one, float(ratio), plate, b) for one, b in zip(seen, last, strict=True)]
        costs.append(sum(one.unlikelihood for one in last if one))
    return max(0.0, _vertex(RATIOS, np.array(costs)))


def _lasting(
    both: Sequence[Together],
    motions: Sequence[Motion],
    frictions: Sequence[float | None],
    ratios: Array,
) -> Lasting:
    """The likeliest durations of impacts and of steps of the driving force."""
    lasting = Lasting(2e-4, 0.0)
    for name in lasting._fields:
        costs: list[float] = []
        for width in WIDTHS:
            tried = lasting._replace(**{name: float(width)})
            costs.append(0.0)
            for one, motion, friction in zip(both, motions, frictions, strict=True):
                costs[-1] += _scan(Stretches(one, motion, tried), ratios, friction)[0]
            if len(costs) > 2 and costs[-1] > min(costs):
                break
        found = max(0.0, _vertex(WIDTHS[: len(costs)], np.array(costs)))
        lasting = lasting._replace(**{name: found})
    return lasting


def _vertex(x: Array, y: Array) -> float:
    """Where a parabola through the least of ``y`` and its neighbours, two on a side, is least."""
    i = int(y.argmin())
    near = slice(max(0, i - 2), i + 3)
    a, b, _ = np.polyfit(x[near] - x[i], y[near], 2)
    if a <= 0 or i in (0, len(x) - 1):
        return float(x[i])
    return float((x[i] - b / (2 * a)).clip(x[i - 1], x[i + 1]))


def _table(
    stretches: Stretches,
    spread: float,
    limit: Interval,
    ratios: Array,
    centre: Array,
) -> Table:
    """Of the frictions about ``centre``, one for each pair of ratios; if these end at the edge of
    what was looked at, about the edge."""
    low, high = (edge * ratios[:, :1] for edge in limit)

    def about(centre: Array) -> Table:
        friction = (centre[:, None] * (1 + NEAR_FRICTION)).clip(low, high)
        slip, plate = (np.broadcast_to(ratio[:, None], friction.shape) for ratio in ratios.T)
        found = stretches.misses(laws(friction, slip, plate).reshape(-1, 4))
        values = stretches.unlikelihoods(found, spread)
        return Table(values.reshape(-1, *friction.shape), friction)

    table = about(centre)
    for _ in range(MOVES):
        summed = table.unlikelihood.sum(axis=0)
        ends, least = summed[:, [0, -1]], summed.min(axis=1, keepdims=True)
        if not ((ends == least) & (ends < summed[:, [1, -2]])).any():
            break
        table = about(table.best()[0])
    return table


def _joined(one: Table, other: Table) -> Table:
    return Table(
        np.concatenate([one.unlikelihood, other.unlikelihood], axis=1),
        np.concatenate([one.friction, other.friction]),
    )


def _dispersion(tables: Sequence[Table], best: int, shared: int) -> float:
    """How much more the trials differ about the shared ratios than their likelihoods allow.

    Twice the sum of what each loses to its own best ratios has as many degrees of freedom as there
    are ratios of trials but one. Few trials are taken in parts. Source: P. McCullagh, J. A. Nelder,
    *Generalized Linear Models*, 2nd edition 1989, section 4.5.
    """
    split = -(-FEWEST_PARTS // len(tables))
    parts = [
        part.sum(axis=0).min(axis=1)
        for table in tables
        for part in np.array_split(table.unlikelihood, min(split, len(table.unlikelihood)))
    ]
    lost = sum(float(part[best] - part.min()) for part in parts)
    return max(LEAST_DISPERSION, 2 * lost / (shared * max(1, len(parts) - 1)))
