"""Probable flaws of measured heights, without any simulation. They are reported, never repaired.

With these limits nothing is reported of the ten published trials, nor of a trial exported from a
run of a built-in scene.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from cosim.arrays import Array
from cosim.errors import plain

JUMP = 5.0
"""A jump is a step between rows of more than so many times the 95 % quantile of all steps."""

LEAST = 100
"""Rows from which on repeated values are counted."""

FEW = 40
"""Heights with fewer different values are taken for rounded."""

OFTEN = 0.03
"""Share of the rows above which repetitions are reported."""


def flaws(time: Array, columns: Mapping[str, Array], headers: Mapping[str, str]) -> Iterator[str]:
    """A sentence for each flaw of the heights (m, NaN where unknown) over ``time`` (s), which are
    named by the ``headers`` of their columns."""
    heights = {plain(headers[z], 40): columns[z] for z in ("z_surface", "z_part") if z in columns}
    moving = {name: z for name, z in heights.items() if np.ptp(z[np.isfinite(z)]) > 0.0}
    if len(moving) == 2:
        (first, a), (second, b) = moving.items()
        if np.array_equal(a, b, equal_nan=True):
            yield f"{first} and {second} hold the same values: one of them is not what it says."
    repeated = np.ones(len(time), bool)  # rows in which all heights are those of the row before
    for name, z in moving.items():
        known = np.isfinite(z)
        yield from _jumps(name, time[known], z[known])
        yield from _rare(name, z[known])
        same = np.diff(z, prepend=np.nan) == 0.0
        # Only single repetitions: a height at rest, or a rounded one, repeats in several rows.
        repeated &= same & ~np.roll(same, 1) & ~np.roll(same, -1)
    if moving and (count := int(repeated.sum())) > OFTEN * len(time):
        yield f"{count} of {len(time)} rows repeat the heights of the row before: doubled frames?"


def _jumps(name: str, time: Array, z: Array) -> Iterator[str]:
    """A sentence on steps far beyond the usual speed; a step over missing rows may be longer."""
    if len(z) < 3:
        return
    steps, rows = np.abs(np.diff(z)), np.diff(time) / np.median(np.diff(time))  # m; usual rows
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
    """A sentence on values that occur too often: of rounded heights, or at the edge of the view."""
    if len(z) < LEAST:
        return
    values = np.unique(z)
    apart = np.diff(values)
    # A motion with a period of a few frames has few values, too, but these are not equally spaced.
    if len(values) < FEW and apart.min() > 0.5 * np.median(apart):
        yield f"{name} has {len(values)} different values in {len(z)} rows: it is rounded."
        return
    for what, value in (("least", values[0]), ("greatest", values[-1])):
        at_end = z == value
        stretches = np.count_nonzero(np.diff(at_end, prepend=False) & at_end)
        count = np.count_nonzero(at_end)
        if count > OFTEN * len(z) and stretches > 1 and count >= 2 * stretches:
            yield (
                f"{name} has its {what} value, {1e3 * value:.4g} mm, in {count} of {len(z)} rows: "
                "does it leave what is seen?"
            )
