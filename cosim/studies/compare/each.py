"""The trials of a folder, each compared with the built-in scene of its number: the accuracy of the
whole chain from the command to the part."""

from collections.abc import Sequence
from functools import partial
from math import nan
from pathlib import Path
from statistics import median

from cosim.errors import BadInput, plain
from cosim.files.picture import Picture
from cosim.scene import load
from cosim.scene.loading import Overrides, list_scenes
from cosim.studies.compare.run import Comparison, compare
from cosim.studies.plots import BLUE, VERMILION, panels
from cosim.studies.report import Progress, Report, Row, silent
from cosim.trials.tracked import number_of, trial_files


def each(
    folder: Path, overrides: Overrides | None = None, progress: Progress = silent
) -> list[Comparison]:
    """The trials of a folder, each compared with its scene. Raises BadInput."""
    known = {name for name, _ in list_scenes()}
    pairs = []
    for path in trial_files(folder):
        name = f"trial-{number_of(path) or 0:02d}"
        if name not in known:
            raise BadInput(
                f"{plain(path)}: there is no built-in scene {name}; the last number in the "
                "file's name must be that of one of the scenes trial-01 to trial-10."
            )
        pairs.append((load(name, overrides), path))
    found = []
    for scene, path in pairs:
        found.append(compare(scene, path, aligned=True))
        progress(len(found), len(pairs), scene.name)
    return found


SHARE, CEILING = "surface's velocity: R²", "its ceiling"
CENTRED, LINE = "part's height: mean error, means removed [mm]", "of a straight line [mm]"
FIRST, FIRST_LINE = "mean error from the first frame [mm]", "a straight line's from it [mm]"
DRIFT, MEASURED = "drift [mm/s]", "measured drift [mm/s]"
COLUMNS: dict[str, tuple[str, float]] = {
    SHARE: ("velocity_r2", 1.0),
    CEILING: ("velocity_r2_ceiling", 1.0),
    "part's velocity: R²": ("part_velocity_r2", 1.0),
    "ceiling of this": ("part_velocity_r2_ceiling", 1.0),
    CENTRED: ("centred_error_mm", 1.0),
    LINE: ("centred_error_mm_straight_line", 1.0),
    FIRST: ("mean_error_mm", 1.0),
    FIRST_LINE: ("mean_error_mm_straight_line", 1.0),
    DRIFT: ("drift_simulated", 1e3),
    MEASURED: ("drift_measured", 1e3),
    "kick [mm/s]": ("kick_simulated", 1e3),
    "measured kick [mm/s]": ("kick_measured", 1e3),
}
"""The table's columns: the name in ``Comparison.numbers`` and the factor to the column's unit."""


def trials(
    trials: Path, overrides: Overrides | None = None, *, progress: Progress = silent
) -> Report:
    """Compare the published trials of a folder with their scenes: how well a single machine model
    reproduces them all. Raises BadInput."""
    rows = [_row(comparison) for comparison in each(trials, overrides, progress)]
    said, tables, figures = [message(rows), *NOTES], {"Trials": rows}, {"": partial(draw, rows)}
    return Report("trials", "The whole chain against the trials", rows, said, tables, figures)


def _row(found: Comparison) -> Row:
    """A trial's row of the table."""
    numbers = {name: nan if x is None else x for name, x in found.numbers.items()}
    cells = {title: scale * numbers.get(name, nan) for title, (name, scale) in COLUMNS.items()}
    return {"scene": found.run, **cells}


NOTES = (
    "Each scene has the identified rig and the trial's own drive; nothing measured goes in beside "
    "these. Simulated motion is read as the camera reads it, from the moment on at which the "
    "identification put the record's first frame. A ceiling is what the measured motion explains "
    "of itself one period later. Errors of the part's height are mean distances, means removed, "
    "and from the first frame on, as the paper has them. Drift is the part's mean velocity over "
    "whole periods, a kick the largest change of the surface's velocity between frames.",
    "The drives and the rig were fitted to these trials, trial 6 apart: this tells how well one "
    "machine can repeat them. What it predicts of trials that it has not seen is in "
    "[identify.md](identify.md), under what was held out.",
    "Measured: the trials of Yako, Nowak, Yuan and Salisbury.",
)


def message(rows: Sequence[Row]) -> str:
    """The result in a sentence."""
    shares = [row[SHARE] for row in rows]
    # In how many trials the simulation is closer to the part's path than a straight line.
    closer, from_first = (
        sum(row[error] < row[of_line] for row in rows)
        for error, of_line in ((CENTRED, LINE), (FIRST, FIRST_LINE))
    )
    apart = [abs(row[DRIFT] - row[MEASURED]) for row in rows]
    return (
        f"Over {len(rows)} trials the chain from the command to the part explains "
        f"{min(shares):.2f} to {max(shares):.2f} of the variance of the surface's velocity, "
        f"{median(shares):.2f} in the middle one, is closer to the part's path than the best "
        f"straight line in {closer} (means removed; in {from_first} by the paper's measure, "
        f"from the first frame on), and misses the part's drift by "
        f"{sum(apart) / len(apart):.2g} mm/s on average and {max(apart):.2g} mm/s at most."
    )


def draw(rows: Sequence[Row]) -> Picture:
    """Draw R² of the surface, errors and drifts of the part, with a bar for each trial."""
    figure, (shares, errors, drifts) = panels(
        message(rows),
        "Bars: simulated by the whole chain. Marks: what the measurements give for comparison.",
        (12.0, 4.6),
        3,
    )
    at, speed = range(len(rows)), "Part's mean velocity [mm/s]"
    for axis, bars, marks, title, label in (
        (shares, SHARE, CEILING, "Surface's velocity: R²", "its own, a period later"),
        (errors, CENTRED, LINE, CENTRED[0].upper() + CENTRED[1:], "best straight line"),
        (drifts, DRIFT, MEASURED, speed, "measured"),
    ):
        axis.bar(at, [row[bars] for row in rows], 0.6, color=BLUE, label="simulated")
        values = [row[marks] for row in rows]
        axis.plot(at, values, color=VERMILION, ls="", marker="_", ms=18, mew=2.5, label=label)
        axis.set_xticks(at, [row["scene"].removeprefix("trial-").lstrip("0") for row in rows])
        axis.set_xlabel("trial")
        axis.margins(y=0.25)
        axis.legend(fontsize=8, ncols=2, loc="upper left")
        axis.set_title(title, loc="left", fontsize=10.5)
    values = [row[FIRST] for row in rows]
    errors.plot(at, values, "k.", label="from the first frame (the paper's)")
    errors.margins(y=0.5)
    errors.legend(fontsize=8, loc="upper left")
    shares.set_ylim(min(0.0, *(row[SHARE] for row in rows)), 1.25)
    return figure
