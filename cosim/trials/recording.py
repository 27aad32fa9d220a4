"""What was measured of a machine, whatever its instruments: a camera, a vibrometer, a scope."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.trials.camera import FRAME_RATE, frame_times, velocities
from cosim.trials.table import UNDERSTOOD, WORDS, read_table

DIGITS = 6e-7, 6e-9
"""Of a published trial's times, s: seven digits, and eight places; relative and absolute."""


@dataclass(frozen=True)
class Recording:
    """``signals`` over ``time`` (s, from the first row on) by the names of the waveforms, SI; NaN
    where nothing is known, but heights have no gaps.

    Where there are heights there are velocities too: Tracker's, or differences as it makes them.
    """

    name: str
    time: Array
    signals: dict[str, Array]
    v_across: Array
    """Horizontal velocity of the surface, m/s; NaN where it was not tracked."""
    notes: tuple[str, ...]
    """What was taken for granted or left out, a sentence each."""


def read_recording(path: Path) -> Recording:
    """One recording. Raises BadInput, with file, row and column, for what is wrong with it.

    Without a time column the rows are frames of the published trials' camera, and a note says so.
    """
    table = read_table(path)
    count, notes = len(table.lines), table.notes
    time = frame_times(0.0, count)
    if "time" in table.columns:
        written = table.columns["time"] - table.columns["time"][0]
        if not np.allclose(written, time, *DIGITS):  # rounded times of even frames are made even
            time = written
    else:
        notes += (f"No time column: read at {FRAME_RATE:g} frames/s, as the published trials are.",)
    signals = {name: table.columns[name] for name in WORDS if name in table.columns}
    signals.pop("time", None)
    if not signals:
        raise BadInput(f"{path}: no column to compare. Understood are: {UNDERSTOOD}.")
    for body in ("surface", "part"):
        if f"z_{body}" in signals:
            central = velocities(time, table.complete(f"z_{body}"))
            there = signals.get(f"v_{body}", central)
            signals[f"v_{body}"] = np.where(np.isnan(there), central, there)
    for name, values in signals.items():
        if np.isfinite(values).sum() < 2:
            raise BadInput(f"{path}: column {table.headers[name]}: it has fewer than two values.")
    across = table.columns.get("v_across_surface", np.full(count, np.nan))
    return Recording(path.stem, time, signals, across, notes)
