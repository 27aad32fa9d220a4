"""What was measured of a machine, whatever its instruments: a camera, a vibrometer, a scope."""

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
"""Of a published trial's times, s: seven digits, and eight places; relative and absolute."""

GAP = 1.5
"""Of the median step, from which on a step is a gap."""

EVEN = 1.1
"""The longest step over the shortest, up to which times count as even."""


@dataclass(frozen=True)
class Recording:
    """``signals`` over ``time`` (s, from the first row on) by waveforms' names, SI; NaN if unknown.

    Where there are heights there are velocities too: Tracker's, or differences as it makes them.
    """

    name: str
    time: Array
    signals: dict[str, Array]
    v_across: Array
    """Horizontal velocity of the surface, m/s; NaN where it was not tracked."""
    notes: tuple[str, ...]
    """What was taken for granted or left out, a sentence each."""
    understood: dict[str, Any] = field(default_factory=dict)
    """What was made of the file, for a JSON file: ``rows``, ``span`` (s), ``rate`` (1/s), ``gaps``
    (sentences), and for each of ``columns`` its header, unit, and how many values are missing."""

    def rows(self, chosen: slice) -> "Recording":
        """Some of the rows; time 0 is the first of them."""
        return replace(
            self,
            time=self.time[chosen] - self.time[chosen][0],
            signals={name: values[chosen] for name, values in self.signals.items()},
            v_across=self.v_across[chosen],
        )

    def told(self) -> list[str]:
        """What was understood, in lines."""
        read = self.understood
        if not read:
            return []
        size = f"{read['rows']} rows, {read['span']:.4g} s, {read['rate']:.4g} rows/s"
        lines, others = [f"Read from {plain(self.name)}: {size}"], []
        for name, one in read["columns"].items():
            header = plain(one["header"], 40)
            if name not in WORDS:
                others.append(header)
                continue
            whence = " (the published trials' unit)" if one["assumed"] else ""
            gone = f", {one['missing']} missing" if one["missing"] else ""
            lines.append(f"  {name:<17} {header}, in {one['unit']}{whence}{gone}")
        if others:
            lines.append(f"  not compared: {', '.join(others)}")
        return lines + [f"  {sentence}" for sentence in read["gaps"]]


def read_recording(path: Path, asked: str = "") -> Recording:
    """One recording; ``asked`` as :func:`read_table` has it. Raises BadInput, with file, row and
    column, for what is wrong with it.

    Without a time column the rows are frames of the published trials' camera, and a note says so.
    """
    table = read_table(path, asked)
    count, notes = len(table.lines), table.notes
    time = frame_times(0.0, count)
    if "time" in table.columns:
        written = table.columns["time"] - table.columns["time"][0]
        if not np.allclose(written, time, *DIGITS):  # rounded times of even frames are made even
            time = written
    else:
        notes += (f"No time column: read at {FRAME_RATE:g} frames/s, as the published trials are.",)
    signals = {k: table.columns[k] for k in WORDS if k in table.columns and k != "time"}
    if not signals:
        raise BadInput(" ".join([f"{plain(path)}: no column to compare: {HOW}.", *table.notes]))
    for body in ("surface", "part"):
        if f"z_{body}" in signals:
            there = track(signals | {"time": time}, body).v
            if f"v_{body}" in signals or np.isfinite(there).any():
                signals[f"v_{body}"] = there
    for name, values in signals.items():
        if np.isfinite(values).sum() < 2:
            where = f"{plain(path)}: column {plain(table.headers[name], 40)}"
            raise BadInput(f"{where}: it has fewer than two values.")
    notes += (*flaws(time, signals, table.headers),)
    across = table.columns.get("v_across_surface", np.full(count, np.nan))
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
    return Recording(plain(path.stem), time, signals, across, notes, understood)


def _gaps(time: Array) -> list[str]:
    """What is to be told of times (s) that are not even."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    if not len(gaps):
        apart = f"{steps.min() * 1e3:.3g} to {steps.max() * 1e3:.3g} ms apart"
        told = f"Rows are {apart}: if these times are rounded, so are the velocities."
        return [told] if steps.max() > EVEN * steps.min() else []
    longest = int(np.argmax(steps))
    return [
        f"Gaps in time: {len(gaps)}, the longest of {steps[longest] * 1e3:.3g} ms at "
        f"{time[longest]:.4g} s; rows are {usual * 1e3:.3g} ms apart."
    ]
