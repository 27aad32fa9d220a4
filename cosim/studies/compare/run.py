"""The command and library function that compare a run with a recording."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files.atomic import write_json
from cosim.files.picture import Picture
from cosim.scene import Overrides, Scene, load
from cosim.simulation.rungs.given_surface import surface
from cosim.simulation.simulate import simulate
from cosim.studies.compare import figure
from cosim.studies.compare.compare import Found, measure
from cosim.studies.compare.scores import LINES, SIDES, Number
from cosim.studies.report import Row, markdown
from cosim.studies.report import write_csv as write_rows
from cosim.trials.recording import Recording, read_recording
from cosim.typed import typed
from cosim.waveforms import formats
from cosim.waveforms.columns import UNITS
from cosim.waveforms.formats.tracker import laid_over
from cosim.waveforms.quantities import bench_unit
from cosim.waveforms.result import Result
from cosim.waveforms.storage import write_csv


@dataclass(frozen=True, eq=False)
class Comparison:
    """A run compared with a recording; ``found`` holds the scores and both sides' signals, SI."""

    run: str
    trial: str
    found: Found

    @property
    def numbers(self) -> dict[str, float | None]:
        """All numbers by name; SI but for ``_mm`` and ``_percent``. A score's bare name is that of
        the run; with ``_ceiling``, ``_no_motion``, ``_straight_line`` it is a reference's."""
        return self.found.values

    def plot(self) -> Picture:
        """Every measured signal and the simulated one, over time."""
        return figure.draw(f"{self.run} against {self.trial}", self.found)

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``compare.json``, ``compare.csv``, ``frames.csv`` and ``compare.png``."""
        out = Path(folder)
        about = {"understood": self.found.recording.understood, "notes": self.found.notes}
        content = {"run": self.run, "trial": self.trial, **self.numbers, **about}
        write_json(out / "compare.json", content)
        write_rows(out / "compare.csv", self.found.rows)
        recording, simulated = self.found.recording, self.found.simulated
        table, units = {"time": recording.time}, {"time": "s"}
        for side, signals in (("measured", recording.signals), ("simulated", simulated)):
            table |= {f"{name}_{side}": values for name, values in signals.items()}
            units |= {f"{name}_{side}": UNITS[name] for name in signals}
        write_csv(out / "frames.csv", table, units)
        self.plot().write(out / "compare.png")

    def __repr__(self) -> str:
        scores, pairs, alone = (
            _table([number for number in self.found.numbers if [*number.values] == [*columns]])
            for columns in (LINES, SIDES, ("value",))
        )
        parts = self.found.recording.told(), scores, LEGEND, pairs, alone, self.found.notes
        return "\n\n".join("\n".join(lines) for lines in parts if lines)


FEWEST_ROWS = 2.1
"""Fewest rows of a recording in a period of the run: a little above the two of Nyquist's limit."""

LEGEND = (
    "ceiling: the measured motion's forecast of itself one period later",
    "no motion: of a signal that stays 0, or a height that stays the first",
    "straight line: of the best one through the measured values",
)


def _table(numbers: Sequence[Number]) -> list[str]:
    """A table with a row for each number, in the units of the bench, and their meanings."""
    rows: list[Row] = []
    for number in numbers:
        unit, scale = bench_unit(number.unit)
        values = {of: value and value * scale for of, value in number.values.items()}
        rows.append({"": f"{number.name} [{unit}]", **values})
    meanings = [f"{number.name}: {number.meaning}" for number in numbers]
    return [*markdown(rows), "", *meanings] if rows else []


@typed
def compare(
    run: Result | Scene | str | os.PathLike[str],
    trial: str | os.PathLike[str],
    overrides: Overrides | None = None,
    *,
    columns: str = "",
    aligned: bool = False,
) -> Comparison:
    """Compare a run with a recording (a CSV): a tracked trial, or measurements of surface, part,
    current or voltage by any instrument. :mod:`cosim.trials.table` has the known columns and units;
    ``columns`` names others: ``"time=t:s,surface=top:mm,part=cube:mm"``. How the file was read is
    printed first; ambiguous files are refused.

    ``run`` is a result, a folder that ``Result.save`` wrote, or a scene, which is then run, with
    ``overrides`` for its keys, long enough to cover the recording. The time of the run at the
    recording's first row is chosen within a period so that the surfaces' velocities agree best, or
    the currents, voltages, or parts' velocities where no surface was measured. If ``aligned``, it
    is ``run.settle``: the scenes of the trials begin there as the records do.

    ``numbers`` of what comes back are the scores by name, SI but for ``_mm`` and ``_percent``.
    Raises BadInput for files that cannot be read, and for a run that is too short.
    """
    if isinstance(run, str | os.PathLike) and Path(run).suffix.lower() == ".csv":
        raise BadInput(
            f"{plain(run)}: a table is no run; the run's folder or the scene comes first, the "
            "trial second."
        )
    measured = read_recording(Path(trial), columns)
    name, waveforms, scene = _run(run, overrides, measured)
    start, period = laid_over(scene)
    found = measure(waveforms, measured, start, period, scene.run.shutter, aligned)
    return Comparison(name, measured.name, found)


def _run(
    run: Result | Scene | str | os.PathLike[str], overrides: Overrides | None, trial: Recording
) -> tuple[str, dict[str, Array], Scene]:
    """The run's name, its waveforms and its scene."""
    named = run.scene if isinstance(run, Result) else run
    name = named.name if isinstance(named, Scene) else str(named)
    if isinstance(run, Result) or (isinstance(run, str | os.PathLike) and Path(run).is_dir()):
        if overrides:
            raise BadInput(f"--set cannot change {plain(name)}, which is a finished run.")
        if isinstance(run, Result):
            finished, scene = run.columns, run.scene
        else:
            finished, scene = formats.read(Path(run)).waveforms, load(Path(run) / "scene.toml")
        _check_rate(scene, trial)
        return name, finished, scene
    scene = load(run, overrides)
    period = _check_rate(scene, trial)
    # One row more than the recording, and a period within which the run may be shifted.
    span = float(trial.time[-1]) * len(trial.time) / (len(trial.time) - 1) + (period or 0.0)
    longer = {"duration": max(scene.run.duration, scene.run.settle + span)}
    if scene.drive.waveform == "file":
        longer = {"duration": float(surface(scene).times[-1]), "settle": 0.0}
    scene = scene.model_copy(update={"run": scene.run.model_copy(update=longer)})
    return name, simulate(scene).columns, scene


def _check_rate(scene: Scene, trial: Recording) -> float | None:
    """The period of a scene, s. Raises BadInput where a trial has too few rows in a period, and for
    a scene with its own FMUs, whose waveforms cannot be matched to a recording's."""
    if scene.has_ports:
        raise BadInput(
            f"{scene.name}: compare needs the built-in machine, not a scene's own ports."
        )
    _, period = laid_over(scene)
    rate = 1.0 / float(np.median(np.diff(trial.time)))
    if period and rate * period < FEWEST_ROWS:
        raise BadInput(
            f"{plain(trial.name)}: {rate:.4g} rows/s are too few for a run that repeats at "
            f"{1.0 / period:.4g} Hz: is the time's unit right?"
        )
    return period
