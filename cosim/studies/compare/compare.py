"""Simulated against measured: a run and a recording, read by the same instruments.

Simulated heights are averaged over the camera's exposure at the recording's times, and velocities
are the tracker's differences of these. Where a recording has velocities without heights, currents
or voltages, the simulated ones are interpolated at its times. The signals are compared afterwards.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.simulation.checks import MOST_PERIODS
from cosim.studies.compare.hints import hints
from cosim.studies.compare.scores import R2, Number, Signals, both_sides, explained, scores
from cosim.studies.report import Row
from cosim.trials.camera import heights, velocities
from cosim.trials.periods import period_of
from cosim.trials.recording import Recording
from cosim.waveforms.columns import COLUMNS

SHIFTS = 400
"""Start times that are tried within a period, before the best one is refined."""

GUIDES = ("v_surface", "current", "coil_voltage", "command", "v_part")
"""The first of these that was measured is the guide: it gives the period and the run's phase."""

PHASES = 101
"""Number of start times, over one period, at which hints are tested."""

DIGITS = 6e-7, 6e-12
"""Rounding of the heights of an exported trial: relative, and absolute in m."""

LEAST_ROWS = 8
"""Rows of a recording that a run must cover."""

APART = 0.05
"""Share of a period by which run and recording may drift apart before a note says so."""

STILL = 0.1
"""A signal of less than this share of its 95 % quantile counts as at rest."""

LITTLE = 0.1
"""R² below which a note says that the run hardly explains a signal, where no hint tells why."""


@dataclass(frozen=True)
class Found:
    """A run compared with a recording whose first row is at ``start`` (s) of the run.

    ``recording`` has the compared rows and signals, ``simulated`` the run's at the same times; the
    scores come first in ``numbers``.
    """

    recording: Recording
    simulated: Signals
    start: float
    numbers: list[Number]
    notes: list[str]

    @property
    def rows(self) -> list[Row]:
        """A row for each value of each number: name, value, unit and meaning."""
        return [row for number in self.numbers for row in number.rows()]

    @property
    def values(self) -> dict[str, float | None]:
        """The values by the names of ``rows``."""
        return {row["name"]: row["value"] for row in self.rows}


@dataclass(frozen=True, eq=False)
class Seen:
    """A run (its waveforms, SI) as a recording's instruments show it; ``exposure`` of a frame, s.
    In all methods ``start`` is the time of the run, s, at the recording's first row."""

    waveforms: Mapping[str, Array]
    recording: Recording
    exposure: float

    def signal(self, name: str, start: float) -> Array:
        """The run's signal ``name`` at the recording's times."""
        at, (quantity, _, body) = self.recording.time + start, name.partition("_")
        if f"z_{body}" not in self.recording.signals:
            return np.interp(at, self.waveforms["time"], self.waveforms[name])
        z = heights(self.waveforms, body, at, self.exposure)
        return z if quantity == "z" else velocities(at, z)

    def is_own(self, start: float) -> bool:
        """Whether the recording is a trial that was exported from this run: its heights agree to
        the digits of the file, seven, and eight places of a millimetre. False without heights."""
        at, signals = self.recording.time + start, self.recording.signals
        names = [name for name in ("z_surface", "z_part") if name in signals]
        if not names or at[-1] > self.waveforms["time"][-1] + 1e-9:
            return False
        known = {name: np.isfinite(signals[name]) for name in names}
        pairs = ((self.signal(name, start)[k], signals[name][k]) for name, k in known.items())
        return all(np.allclose(run, seen, *DIGITS) for run, seen in pairs)

    def best_start(self, guide: str, earliest: float, latest: float) -> float:
        """The start at which the run explains most of the variance of the signal ``guide``."""
        wanted = self.recording.signals[guide]

        def missed(start: float) -> float:
            return -explained(self.signal(guide, start), wanted)

        # Within a period R² has several maxima: the best of a grid is refined.
        starts = np.linspace(earliest, latest, SHIFTS)
        best = int(np.argmin([missed(float(start)) for start in starts]))
        around = starts[max(best - 1, 0)], starts[min(best + 1, SHIFTS - 1)]
        finer = minimize_scalar(missed, bounds=around, method="bounded", options={"xatol": 1e-6})
        return min((float(starts[best]), float(finer.x)), key=missed)


def measure(
    waveforms: Mapping[str, Array],
    recording: Recording,
    earliest: float,
    period: float | None,
    shutter: float = 0.0,
    aligned: bool = False,
) -> Found:
    """Scores and numbers, and the signals of both sides at the recording's times.

    ``earliest`` is the first time of the run, s, that may correspond to the recording's first row.
    From there the run is shifted by up to the drive's ``period``, s, for the best agreement; not if
    that is None, or if the run is ``aligned``. ``shutter`` is the exposure as a share of the time
    between rows.
    """
    recording, notes = _comparable(recording, waveforms)
    row = float(np.median(np.diff(recording.time)))
    seen = Seen(waveforms, recording, shutter * row)
    own = seen.is_own(earliest)
    end = float(waveforms["time"][-1])
    if period is None and not own:
        recording = _covered(recording, end - earliest)
        if len(recording.time) < LEAST_ROWS:
            raise BadInput(
                f"The run ends at {end:.4g} s, and covers {len(recording.time)} rows of "
                f"{plain(recording.name)}: there must be {LEAST_ROWS}."
            )
    elif earliest + recording.time[-1] > end + 1e-9 >= earliest + recording.time[-2]:
        # A run of a trial's own scene ends at the last multiple of its output step.
        recording = recording.rows(slice(-1))
        notes.append("The recording's last row lies beyond the run's end, and is left out.")
    seen = replace(seen, recording=recording)
    rows, span = len(recording.time), float(recording.time[-1])
    if earliest + span > end + 1e-9:
        needed = earliest + span * rows / (rows - 1)
        raise BadInput(
            f"The run ends at {end:.4g} s, too early to cover the {rows} rows of "
            f"{plain(recording.name)}: run.duration must be at least {needed:.4g} s."
        )
    guide, repeats = _period(recording, period)  # ``repeats``: the measured period, s
    start = earliest
    if guide and period is not None and not own and not aligned:
        start = seen.best_start(guide, earliest, max(earliest, min(end - span, earliest + period)))
    simulated = {name: seen.signal(name, start) for name in recording.signals}
    notes += _of_periods(repeats, period, span, row)
    if guide and period is not None and not own:
        notes += _at_rest(recording, simulated[guide], guide, period)
    if not own and guide:
        phases = np.linspace(-0.5, 0.5, 0 if aligned or period is None else PHASES)
        starts = start + phases * (period or 0.0)
        starts = starts[(starts >= 0.0) & (starts + span <= end)]

        def shown(at: Recording, name: str, first: float) -> Array:
            return Seen(waveforms, at, 0.0).signal(name, first)

        told = [*hints(recording, shown, guide, np.concatenate([[start], starts]))]
        notes += told or _unexplained(recording, simulated)
    rate = "rows of the recording in a second, the median"
    first = "time of the run that is laid over the recording's first row"
    numbers = [
        *scores(recording, simulated, repeats),
        *both_sides(recording, simulated, (repeats, period or repeats)),
        Number("rate", "1/s", rate, {"value": 1.0 / row}),
        Number("start", "s", first, {"value": start}),
    ]
    if own:
        notes.append(
            "This trial is the run's own. Both sides went through the same camera: mean_error_mm "
            "is what the digits of the file make."
        )
    return Found(recording, simulated, start, numbers, notes)


def _unexplained(recording: Recording, simulated: Signals) -> Iterator[str]:
    for name in filter(simulated.__contains__, R2):
        if (share := explained(simulated[name], recording.signals[name])) < LITTLE:
            yield (
                f"The run hardly explains the recording's {COLUMNS[name].text} (R² {share:.2g}), "
                "and no unit, sign or exchange of columns is why: is it of this machine and drive, "
                "and is what is in this column what was to be tracked?"
            )


def _at_rest(recording: Recording, simulated: Array, guide: str, period: float) -> Iterator[str]:
    """Notes on ends of a recording that rest for more than a ``period``, s, where the run does not:
    of a camera that runs before the drive is switched on, or after it is switched off."""
    known = np.isfinite(recording.signals[guide])  # what is missing is not at rest
    wanted, run = np.abs(recording.signals[guide][known]), np.abs(simulated[known])
    least = STILL * float(np.quantile(wanted, 0.95))
    moves = np.flatnonzero(wanted > least)
    row = float(np.median(np.diff(recording.time)))
    for end, rows in (("first", slice(moves[0])), ("last", slice(moves[-1] + 1, None))):
        length = len(wanted[rows]) * row
        if length > period and np.nanmax(run[rows]) > least:
            yield (
                f"The recording's {COLUMNS[guide].text} rests in its {end} {length:.3g} s, where "
                "the run's does not: leave these rows out, which spoil the scores and the drift."
            )


def _of_periods(
    repeats: float | None, period: float | None, span: float, row: float
) -> Iterator[str]:
    """Notes on the periods (s) of a recording of length ``span`` and of the run."""
    if repeats is None:
        yield "The recording does not repeat: there is no ceiling, and no whole period."
    elif (
        period
        and 2 <= (each := round(repeats / period)) <= MOST_PERIODS
        and abs(each / repeats - 1.0 / period) * span <= APART
    ):
        yield (
            f"The recording repeats at {1.0 / repeats:.4g} Hz, after {each} periods of the run's "
            f"drive: so may motion that is driven at {1.0 / period:.4g} Hz. If it was not, "
            "drive.frequency or the times' unit is wrong, which spoils the scores."
        )
    elif (
        period and (apart := abs(1.0 / repeats - 1.0 / period) * span) > APART + 0.5 * row / repeats
    ):
        yield (
            f"The frequencies differ: the recording repeats at {1.0 / repeats:.4g} Hz, the run is "
            f"driven at {1.0 / period:.4g} Hz (drive.frequency). At the end of the recording they "
            f"are {apart:.2g} periods apart, which spoils the scores."
        )
        power = round(np.log10(period / repeats))  # such as milliseconds taken for seconds
        if power and abs(period / repeats / 10.0**power - 1.0) < APART:
            yield f"Hint: with times multiplied by {10.0**power:g} they would not differ."
    if period and span < period:
        yield (
            f"The recording is {span:.3g} s long, and a period of the run {period:.3g} s: is the "
            "time's unit right?"
        )


def _comparable(
    recording: Recording, waveforms: Mapping[str, Array]
) -> tuple[Recording, list[str]]:
    """The recording without signals that the run lacks, and notes. Raises BadInput where none is
    left, or one is constant."""
    notes, name = list(recording.notes), plain(recording.name)
    common = {name: values for name, values in recording.signals.items() if name in waveforms}
    missing = ", ".join(COLUMNS[x].text for x in recording.signals if x not in common)
    if not common:
        raise BadInput(f"{name}: the run has no {missing} to compare it with.")
    if missing:
        notes.append(f"Left out, since the run has none: {missing}.")
    for signal, values in common.items():
        if np.ptp(values[np.isfinite(values)]) == 0.0:
            words = f"the {COLUMNS[signal].text} does not change"
            raise BadInput(f"{name}: {words}: there is nothing to compare.")
    return replace(recording, signals=common), notes


def _covered(recording: Recording, length: float) -> Recording:
    """The rows that a run of this length (s) covers, from the first row with a known velocity of
    the surface: there begins a run that has its surface's motion from a recording."""
    v = recording.signals.get("v_surface")
    first = 0 if v is None else int(np.argmax(np.isfinite(v)))
    time = recording.time - recording.time[first]
    return recording.rows(slice(first, int(np.searchsorted(time, length + 1e-9, side="right"))))


def _period(recording: Recording, hint: float | None) -> tuple[str, float | None]:
    """The first measured guide, or "", and the first period, s, that a guide has, or None."""
    guides = [name for name in GUIDES if name in recording.signals]
    found = (period_of(recording.time, recording.signals[name], hint) for name in guides)
    return next(iter(guides), ""), next(filter(None, found), None)
