"""What looks wrong with measured heights, whatever they are compared with: told, never mended.

The limits are such that none of the ten published trials, nor one exported by a run of a scene
that the package has, is told anything.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from cosim.arrays import Array
from cosim.errors import plain

JUMP = 5.0
"""How many times as far as all but 5 % of the steps between rows a step goes that is a jump."""

LEAST = 100
"""Rows from which on it counts how often a value occurs."""

FEW = 40
"""Different values: fewer are of heights that were rounded."""

OFTEN = 0.03
"""Share of the rows from which on what should be rare is told."""


def flaws(time: Array, columns: Mapping[str, Array], headers: Mapping[str, str]) -> Iterator[str]:
    """A sentence on each; heights (m, NaN where unknown) over ``time`` (s), told by the headers of
    their columns."""
    heights = {plain(headers[z], 40): columns[z] for z in ("z_surface", "z_part") if z in columns}
    moving = {name: z for name, z in heights.items() if np.ptp(z[np.isfinite(z)]) > 0.0}
    if len(moving) == 2:
        (one, a), (other, b) = moving.items()
        if np.array_equal(a, b, equal_nan=True):
            yield f"{one} and {other} hold the same values: one of them is not what it says."
    repeated = np.ones(len(time), bool)
    for name, z in moving.items():
        known = np.isfinite(z)
        yield from _jumps(name, time[known], z[known])
        yield from _rare(name, z[known])
        same = np.diff(z, prepend=np.nan) == 0.0
        # What rests, or is rounded, stays longer than one row.
        repeated &= same & ~np.roll(same, 1) & ~np.roll(same, -1)
    if moving and (count := int(repeated.sum())) > OFTEN * len(time):
        yield f"{count} of {len(time)} rows repeat the heights of the row before: doubled frames?"


def _jumps(name: str, time: Array, z: Array) -> Iterator[str]:
    """Steps that no motion of the others' speed makes, however long it was not seen."""
    if len(z) < 3:
        return
    steps, rows = np.abs(np.diff(z)), np.diff(time) / np.median(np.diff(time))
    usual = float(np.quantile(steps / rows, 0.95))
    far = np.flatnonzero(steps > JUMP * usual * np.maximum(rows, 1.0))
    if usual > 0.0 and len(far):
        worst = far[np.argmax(steps[far])]
        often = "once" if len(far) == 1 else f"{len(far)} times"
        yield (
            f"{name} jumps {often}, by {1e3 * steps[worst]:.3g} mm at {time[worst]:.4g} s, "
            f"where 95 % of the rows lie at most {1e3 * usual:.3g} mm apart: was the mark lost, or "
            "another followed?"
        )


def _rare(name: str, z: Array) -> Iterator[str]:
    """Values that occur too often."""
    if len(z) < LEAST:
        return
    values = np.unique(z)
    apart = np.diff(values)
    # Those of a motion that repeats from frame to frame are few as well, but not even.
    if len(values) < FEW and apart.min() > 0.5 * np.median(apart):
        yield f"{name} has {len(values)} different values in {len(z)} rows: it is rounded."
        return
    for what, value in (("least", values[0]), ("greatest", values[-1])):
        there = z == value
        stretches = np.count_nonzero(np.diff(there, prepend=False) & there)
        count = np.count_nonzero(there)
        if count > OFTEN * len(z) and stretches > 1 and count >= 2 * stretches:
            yield (
                f"{name} has its {what} value, {1e3 * value:.4g} mm, in {count} of {len(z)} rows: "
                "does it leave what is seen?"
            )
