"""A note on waveforms that are faster than the rows in which they are written."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cosim.arrays import Array
from cosim.files.spill import blocks
from cosim.scene.tables import Run

ROUNDED = 1e-12
"""Rms, SI, below which a waveform is rounding, which differs from run to run: ngspice's abstol for
currents. The voltage across a balanced bridge is less."""

FOLDED, HIDDEN = 0.2, 0.5
"""Rms errors of interpolated rows, over the waveform's rms, above which a note is given: of the
machine's coil; of signals of the user's own, as a PWM, which four rows in a period (0.36) show."""


def folded(
    log: Mapping[str, Array],
    names: Mapping[str, Sequence[str]],
    rows: Array,
    run: Run,
    most: float,
) -> Iterator[str]:
    """A note on waveforms faster than their rows: a carrier at the rows' rate looks constant. Each
    of the ``names`` is a vector of the log, minus others."""
    missed, whole = np.zeros((2, len(names)))
    for part in blocks(len(log["time"]) - 1):
        reach = slice(part.start, part.stop + 1)
        time = np.ascontiguousarray(log["time"][reach])
        inside = rows[rows.searchsorted(time[0]) : rows.searchsorted(time[-1], "right")]
        if len(inside) < 2:
            continue
        # Of both lines all corners: a step may be far longer than the edge that it ends with.
        at = np.union1d(time, inside)
        h = np.where(at[1:] > run.settle, np.diff(at), 0.0) / 3.0
        for k, (vector, *less) in enumerate(names.values()):
            y = log[vector][reach] - sum(log[other][reach] for other in less)
            back = np.interp(at, inside, np.interp(inside, time, y))
            y = np.interp(at, time, y)
            for sums, x in ((missed, y - back), (whole, y)):
                a, b = x[:-1], x[1:]
                sums[k] += float((h * (a * a + a * b + b * b)).sum())
    least = ROUNDED**2 * run.duration
    if odd := [name for k, name in enumerate(names) if missed[k] > most**2 * whole[k] + least]:
        yield (
            f"{', '.join(odd)} changes faster than the rows of the waveforms, which are "
            f"{run.output_step:g} s apart (run.output_step): a PWM looks slow there and in the "
            "figure. The numbers of the summary are of every step."
        )
