"""Measurements of a machine by any instrument: a camera, a vibrometer, a scope."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.trials.camera import FRAME_RATE, frame_times
from cosim.trials.flaws import flaws
from cosim.trials.table import HOW, WORDS, read_table
from cosim.trials.tracked import track

DIGITS = 6e-7, 6e-9
"""Rounding of a published trial's times: relative (seven digits), and absolute in s."""

GAP = 1.5
"""A step of the times is a gap from so many times the median step on."""

EVEN = 1.1
"""Greatest ratio of the longest to the shortest step of times that count as even."""


@dataclass(frozen=True)
class Recording:
    """``signals`` over ``time`` (s, from the first row on) by waveforms' names, SI; NaN if unknown.

    Each body with heights has velocities, too: Tracker's, or differences like Tracker's.
    """

    name: str
    time: Array
    signals: dict[str, Array]
    notes: tuple[str, ...]
    """A sentence for each assumption, flaw and left-out column."""
    understood: dict[str, Any] = field(default_factory=dict)
    """How the file was read, for a JSON file: ``rows``, ``span`` (s), ``rate`` (1/s), ``gaps``
    (sentences), and for each of ``columns`` its header, unit, whether the unit is assumed, and the
    number of missing values."""

    def rows(self, chosen: slice) -> "Recording":
        """The recording with the ``chosen`` rows only; its time starts at 0 again."""
        return replace(
            self,
            time=self.time[chosen] - self.time[chosen][0],
            signals={name: values[chosen] for name, values in self.signals.items()},
        )

    def told(self) -> list[str]:
        """Lines to print on how the file was read."""
        read = self.understood
        if not read:
            return []
        size = f"{read['rows']} rows, {read['span']:.4g} s, {read['rate']:.4g} rows/s"
        lines, others = [f"Read from {plain(self.name)}: {size}"], []
        for name, column in read["columns"].items():
            header = plain(column["header"], 40)
            if name not in WORDS:
                others.append(header)
                continue
            whence = " (the published trials' unit)" if column["assumed"] else ""
            gone = f", {column['missing']} missing" if column["missing"] else ""
            lines.append(f"  {name:<17} {header}, in {column['unit']}{whence}{gone}")
        if others:
            lines.append(f"  not compared: {', '.join(others)}")
        return lines + [f"  {sentence}" for sentence in read["gaps"]]


def read_recording(path: Path, asked: str = "") -> Recording:
    """The recording in a file; ``asked`` as for :func:`read_table`. Raises BadInput, with file, row
    and column.

    Without a time column the rows are frames of the published trials' camera, and a note says so.
    """
    table = read_table(path, asked)
    count, notes = len(table.lines), table.notes
    time = frame_times(0.0, count)
    if "time" in table.columns:
        written = table.columns["time"] - table.columns["time"][0]
        if not np.allclose(written, time, *DIGITS):  # else even frames, whose times are rounded
            time = written
    else:
        notes += (f"No time column: read at {FRAME_RATE:g} frames/s, as the published trials are.",)
    signals = {k: table.columns[k] for k in WORDS if k in table.columns and k != "time"}
    if not signals:
        raise BadInput(" ".join([f"{plain(path)}: no column to compare: {HOW}.", *table.notes]))
    for body in ("surface", "part"):
        if f"z_{body}" in signals:
            velocity = track(signals | {"time": time}, body).v
            if f"v_{body}" in signals or np.isfinite(velocity).sum() > 1:
                signals[f"v_{body}"] = velocity
    for name, values in signals.items():
        if np.isfinite(values).sum() < 2:
            where = f"{plain(path)}: column {plain(table.headers[name], 40)}"
            raise BadInput(f"{where}: it has fewer than two values.")
    notes += (*flaws(time, signals, table.headers),)
    columns = {
        name: {"header": column.header, "unit": column.unit, "assumed": column.assumed}
        | {"missing": int(np.isnan(table.columns[name]).sum())}
        for name, column in table.known.items()
    }
    understood = {
        "rows": count,
        "span": float(time[-1]),
        "rate": 1.0 / float(np.median(np.diff(time))),
        "gaps": _gaps(time),
        "columns": columns,
    }
    return Recording(plain(path.stem), time, signals, notes, understood)


def _gaps(time: Array) -> list[str]:
    """Sentences on the gaps of times (s), or else on their being uneven."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    if not len(gaps):
        apart = f"{steps.min() * 1e3:.3g} to {steps.max() * 1e3:.3g} ms apart"
        sentence = f"Rows are {apart}: if these times are rounded, so are the velocities."
        return [sentence] if steps.max() > EVEN * steps.min() else []
    longest = int(np.argmax(steps))
    return [
        f"Gaps in time: {len(gaps)}, the longest of {steps[longest] * 1e3:.3g} ms at "
        f"{time[longest]:.4g} s; rows are {usual * 1e3:.3g} ms apart."
    ]
