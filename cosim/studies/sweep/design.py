"""Which settings a sweep visits: a grid of axes, or a sample of the ranges that they span."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, prod

import numpy as np

from cosim.errors import BadInput, plain
from cosim.evaluate.keys import FREQUENCIES, numeric_key, split
from cosim.evaluate.point import Number
from cosim.scene import Key
from cosim.scene.messages import check_whole, shown
from cosim.studies.study import check_seed

MOST_POINTS = 1_000_000
"""Of a sweep; writing the dataset of so many takes 2.3 GB of memory."""


@dataclass(frozen=True)
class Axis:
    """A key and the values that it takes, SI; a sample ranges from the least to the greatest."""

    key: Key
    values: tuple[Number, ...]


@dataclass(frozen=True)
class Design:
    """The points of a sweep, in order; in a grid the last axis runs fastest.

    ``sample`` holds the points of a sample (points × axes), or is None for a grid.
    """

    axes: tuple[Axis, ...]
    sample: tuple[tuple[Number, ...], ...] | None = None

    def __len__(self) -> int:
        return prod(self.shape)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis, or of points of a sample."""
        if self.sample is not None:
            return (len(self.sample),)
        return tuple(len(axis.values) for axis in self.axes)

    def point(self, index: int) -> dict[str, Number]:
        """The settings of a point: ``table.key`` and value, SI."""
        if self.sample is not None:
            row = self.sample[index]
        else:
            places = np.unravel_index(index, self.shape)
            row = tuple(axis.values[k] for axis, k in zip(self.axes, places, strict=True))
        return {axis.key.full: value for axis, value in zip(self.axes, row, strict=True)}

    def alike(self, points: Iterable[int]) -> list[int]:
        """The indices ``points`` sorted by frequency: lanes of the fast solver whose waveforms have
        their jumps and corners at equal times share time steps, so that it takes fewer of them."""
        frequencies = [key for axis in self.axes if (key := axis.key.full) in FREQUENCIES]
        return sorted(points, key=lambda n: [self.point(n)[key] for key in frequencies])

    @property
    def changes_frequency(self) -> bool:
        """Whether the period differs from point to point."""
        return any(axis.key.full in FREQUENCIES for axis in self.axes)


def grid(over: Mapping[str, Sequence[Number]]) -> Design:
    """Every combination of the values of each ``table.key``. Raises BadInput."""
    if not over:
        form = "--over drive.frequency=10:60:26"
        raise BadInput(f"--over: a sweep needs at least one key and its values, such as {form}.")
    for name, values in over.items():
        listed = hasattr(values, "__len__") and not isinstance(values, str | bytes)
        listed = listed and getattr(values, "shape", None) != ()  # an array of no dimension
        if not isinstance(name, str) or not listed:
            raise BadInput(f"--over: {shown(name)} must be a key, {shown(values)} its numbers.")
    if (count := prod(map(len, over.values()))) > MOST_POINTS:
        raise BadInput(f"--over: this grid has {count} points; it may have {MOST_POINTS}.")
    return Design(tuple(_axis(name, values) for name, values in over.items()))


def sample(over: Mapping[str, Sequence[Number]], count: int, seed: int) -> Design:
    """``count`` settings spread over the ranges of the axes, the same for the same ``seed``.

    A Latin hypercube (McKay, Beckman, Conover, Technometrics 21 (1979)): each axis, cut into
    ``count`` equal parts, has one point in each.
    """
    from scipy.stats import qmc

    axes = grid(over).axes
    check_whole("--samples", count, 1, MOST_POINTS)
    check_seed(seed)
    for axis in axes:
        if len(set(axis.values)) < 2:
            raise BadInput(
                f"--over {axis.key.full}: a sample needs a range, from one value to another."
            )
    unit = qmc.LatinHypercube(len(axes), rng=np.random.default_rng(seed)).random(count)
    columns = []  # of each axis, its values at all points, scaled from the unit cube
    for axis, column in zip(axes, unit.T, strict=True):
        low, high = min(axis.values), max(axis.values)
        if axis.key.choices:
            chosen = sorted(x for x in map(int, axis.key.choices) if low <= x <= high)
            columns.append([chosen[int(u * len(chosen))] for u in column])
        elif axis.key.kind is int:
            columns.append([low + int(u * (high - low + 1)) for u in column])
        else:
            columns.append([float(low + u * (high - low)) for u in column])
    return Design(axes, tuple(zip(*columns, strict=True)))


def parse(options: Sequence[str]) -> dict[str, tuple[Number, ...]]:
    """The axes that ``--over table.key=start:stop:n`` or ``table.key=a,b,c`` options give."""
    axes: dict[str, tuple[Number, ...]] = {}
    for text, name, right in split(options, "table.key=start:stop:n or table.key=a,b,c"):
        key = numeric_key(name)
        if ":" in right:
            axes[name] = _range(text, right, key)
        else:
            axes[name] = tuple(_number(text, part) for part in right.split(","))
    return axes


def _axis(name: str, values: Sequence[Number]) -> Axis:
    key = numeric_key(name)
    if len(values) == 0:
        raise BadInput(f"--over {name}: has no value.")
    kind = int if key.kind is int else float
    for value in values:
        try:
            inside = isfinite(value) and key.holds(value) and kind(value) == value
            inside = inside and (not key.choices or value in [*map(int, key.choices)])
        except (TypeError, ValueError, OverflowError):  # no number, or one too large for a float
            raise BadInput(f"--over {name}: {shown(value)} must be {key.allowed}.") from None
        if not inside:
            raise BadInput(f"--over {name}: {value:g} must be {key.allowed}.")
    found = tuple(map(kind, values))
    if len(set(found)) < len(found):
        raise BadInput(f"--over {name}: a value stands there twice.")
    return Axis(key, found)


def _range(text: str, right: str, key: Key) -> tuple[Number, ...]:
    parts = right.split(":")
    number = parts[-1].strip()
    # Python refuses to make a number of thousands of digits.
    whole = number.isdecimal() and len(number) <= len(str(MOST_POINTS))
    if len(parts) != 3 or not whole or not 2 <= int(number) <= MOST_POINTS:
        raise BadInput(
            f"--over {plain(text)}: must be {key.full}=start:stop:n with n a whole number from 2 "
            f"to {MOST_POINTS}."
        )
    start, stop, count = _number(text, parts[0]), _number(text, parts[1]), int(parts[2])
    if key.kind is int:
        spread = [round(start + (stop - start) * k / (count - 1)) for k in range(count)]
        return tuple(dict.fromkeys(spread))
    return tuple(np.linspace(start, stop, count).tolist())


def _number(text: str, part: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        forms = "it must be KEY=START:STOP:COUNT or KEY=A,B,C"
        raise BadInput(f"--over {plain(text)}: “{plain(part.strip())}” is not a number; {forms}.")
    return value
