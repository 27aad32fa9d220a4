"""The function that users call, and its report: measure.csv, measure.md and the figure."""

import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import inputs
from cosim.evaluate.store import Store, reported
from cosim.files.picture import Picture
from cosim.scene import Overrides, Scene, load
from cosim.studies.limits.study import checked, ensemble
from cosim.studies.measure.sample import (
    CANDIDATES,
    KEPT,
    TARGETS,
    Candidate,
    Sample,
    drawn,
    held_currents,
    sample,
    whole,
)
from cosim.studies.measure.worth import FEWEST, Worth, chance, worth
from cosim.studies.plots import BLUE, ORANGE, panels
from cosim.studies.report import Progress, Report, Row, brief, counted, silent
from cosim.studies.study import check_seed
from cosim.typed import typed
from cosim.waveforms.quantities import percent, signed

RIGS, QUICK, LEAST = 48, 24, 4
"""Number of rigs in the sample; with ``quick``; least number of rigs in a file."""

WIDTH, LEFT = "width [mm/s]", "left [%]"
NOTHING, USELESS = "nothing", "chance"
"""Names of two rows: no measurement, and a measurement that does not depend on the targets."""


@typed
def measure(
    scene: Scene | str | os.PathLike[str] = "paper",
    overrides: Overrides | None = None,
    *,
    rigs: str | os.PathLike[str],
    seed: int = 0,
    quick: bool = False,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> Report:
    """Which single measurement narrows most, for its accuracy, the 90 % interval of the mean
    velocity upwards that the knobs reach robustly.

    ``rigs`` is a file of those that may be meant, such as ``identify.json``, all equally; as they
    are few, others are drawn about them. Each rig in turn is taken as the truth and left out: the
    others are weighted by how well they agree with what it would show, noise added. ``quick`` draws
    few. The same for the same ``seed``.

    Each of the report's ``rows`` is a ``measurement``, the most telling first, behind "nothing"
    and "chance", one that has nothing to do with it: its ``accuracy``, its range over ``90 % of the
    rigs``, and for each target, "as it is" and "falling sawtooth", ``TARGET: width [mm/s]`` of the
    90 % interval that is left, its standard error ``TARGET: ± [mm/s]``, ``TARGET: left [%]`` of the
    present width, and how often the truth lies within, ``TARGET: holds [%]``; ``how`` to measure.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput.
    """
    check_seed(seed)
    base = load(scene, overrides)
    checked(base)
    others = ensemble(Path(rigs), base)
    given = whole(base, others)
    if len(given) < LEAST:
        raise BadInput(
            f"{plain(rigs)}: {len(given)} rigs are too few; it must have {LEAST} at least."
        )
    count = max(len(given), QUICK if quick else RIGS)
    more = drawn(base, given, count - len(given), np.random.default_rng(seed))
    tick = counted(progress, 1 + len(given) + len(more))
    open_ = partial(Evaluator, kept=KEPT, workers=workers)

    def found(store: Store) -> Report:
        rigs = sample(base, [*given, *more], store, open_, seed, tick)
        return report(rigs, len(given), seed, held_currents(base))

    return reported(found, out, "measure.sqlite", inputs(base), others, seed, quick)


def worths(found: Sample, seed: int) -> tuple[Worth, list[tuple[Candidate, Worth]]]:
    """The worth for TARGETS of no measurement, and that of each candidate, sorted by the width that
    it leaves of the first target."""
    nothing = np.empty((len(found.targets), 0))
    now = worth(nothing, nothing, found.targets, np.random.default_rng(seed))
    each = [
        (one, worth(values, one.accuracy(values), found.targets, np.random.default_rng(seed)))
        for one, values in zip(CANDIDATES, found.values, strict=True)
    ]
    return now, sorted(each, key=lambda pair: pair[1].width[0])


def report(found: Sample, given: int, seed: int, currents: tuple[float, float]) -> Report:
    """The report of a sample. ``given`` of its rigs are those of the file; the device's source can
    hold ``currents`` (A, least and most) in its coil."""
    low, high = currents
    now, each = worths(found, seed)
    values = dict(zip(CANDIDATES, found.values, strict=True))
    luck = chance(found.targets, np.random.default_rng(seed))
    words = "a fine measurement of something that has nothing to do with it"
    told = [(NOTHING, "", "", "", now), (USELESS, words, "", "", luck)]
    told += [
        (one.name, one.how, _accuracy(one), _range(one, values[one]), after) for one, after in each
    ]
    rows = [_row(*one, now) for one in told]
    (first, best), (second, next_) = each[:2]
    # By rig: the median width that the other measurements leave.
    usual = np.median([after.each[:, 0] for _, after in each[1:]], axis=0)
    often = 100.0 * np.mean(best.each[:, 0] < usual)
    other, leaves = min(each, key=lambda pair: pair[1].width[1])
    title = (
        f"Measure next: {first.name}. It is expected to narrow the 90 % interval of the robust "
        f"velocity upwards from {brief(now.width[0] * 1e3)} to {brief(best.width[0] * 1e3)} mm/s"
    )
    ends = np.quantile(found.targets, (0.05, 0.95), axis=0) * 1e3
    notes = [
        f"{title}; the next best ({second.how.partition(':')[0]}) to "
        f"{brief(next_.width[0] * 1e3)} mm/s. On {often:.0f} % of the rigs it leaves less than the "
        f"median of the others. How: {first.how}.",
        f"That velocity is {ends[0, 0]:.1f} to {ends[1, 0]:.1f} mm/s as the device is, and "
        f"{ends[0, 1]:.1f} to {ends[1, 1]:.1f} mm/s with a falling sawtooth; of the latter's width "
        f"{other.name} leaves the least, {100.0 * leaves.width[1] / now.width[1]:.0f} %.",
        "The knobs have to be set on the machine: at the best settings of the scene's rig, 90 % of "
        f"the rigs give {_films(values)}.",
        f"The sample is {len(found.targets)} rigs: {given} that were found from the trials, and "
        "others drawn about them. Each in turn is taken as the truth and left out, and the others "
        "are weighted by how well they agree with what it would show, noise added. Widths are "
        "means over that, ± their standard error; 'holds' is how often the interval has the truth "
        f"in it. No interval stands on less than {FEWEST:.0f} effective rigs, so what is finer "
        "than the sample can tell is worth more than is said here. Fewer rigs span less, too: "
        "'chance' is what a fine measurement leaves that has nothing to do with it.",
        "Rigs count equally: their misfits differ by less than the searches that found them "
        "scatter. The velocity is the median over the knobs' turns by 2 %, at the best setting for "
        "that on each rig. Accuracies are assumed, but for the velocity in a film: that is what a "
        "rig misses of a trial that it was not fitted to. A current is measured as far as the "
        f"device's own source holds it, {low:.2f} to {high:.2f} A; of one beyond nothing but that "
        "is seen.",
    ]
    return Report(
        "measure", "What to measure next", rows, notes, {"Each measurement": rows},
        {"": partial(draw, rows, title)}, notes[0],
    )  # fmt: skip


def _row(name: str, how: str, accuracy: str, over: str, after: Worth, now: Worth) -> Row:
    row: Row = {"measurement": name, "accuracy": accuracy, "90 % of the rigs": over}
    for k, target in enumerate(TARGETS):
        row |= {
            f"{target}: {WIDTH}": float(after.width[k]) * 1e3,
            f"{target}: ± [mm/s]": float(after.error[k]) * 1e3,
            f"{target}: {LEFT}": float(100.0 * after.width[k] / now.width[k]),
            f"{target}: holds [%]": 100.0 * float(after.held[k]),
        }
    return row | {"how": how}


def _films(values: Mapping[Candidate, Array]) -> str:
    """The 5 and 95 % quantiles over the rigs of the mean velocity in three films, in words."""
    shapes = ("rising sawtooth", "falling sawtooth", "sine")
    ends = {one.name: np.quantile(shown[:, 0], (0.05, 0.95)) * 1e3 for one, shown in values.items()}
    told = ((shape, [signed(end, ".0f") for end in ends[f"film, {shape}"]]) for shape in shapes)
    return ", ".join(f"{low} to {high} mm/s with a {shape}" for shape, (low, high) in told)


def _accuracy(one: Candidate) -> str:
    return ", ".join(
        percent(gauge.share) if gauge.share else f"{gauge.sd * gauge.scale:.2g} {gauge.unit}"
        for gauge in one.gauges
    )


def _range(one: Candidate, values: Array) -> str:
    ends = np.quantile(values, (0.05, 0.95), axis=0).T
    return ", ".join(
        f"{low * gauge.scale:.3g} to {high * gauge.scale:.3g} {gauge.unit}"
        for (low, high), gauge in zip(ends.tolist(), one.gauges, strict=True)
    )


def draw(rows: Sequence[Row], title: str) -> Picture:
    """Draw the widths that each measurement leaves, a panel for each target."""
    note = (
        "Bars: expected width of the 90 % interval of the robust v_up after one measurement, ± "
        "standard error. Solid line: now; dotted: after one that tells nothing."
    )
    figure, axes = panels(f"{title}.", note, (11.0, 5.2), len(TARGETS), sharey=True)
    now, luck, *after = rows
    for axis, target, color in zip(axes, TARGETS, (BLUE, ORANGE), strict=True):
        names = [row["measurement"] for row in after]
        widths, errors = ([row[f"{target}: {of}"] for row in after] for of in (WIDTH, "± [mm/s]"))
        axis.barh(names, widths, xerr=errors, color=color, ecolor="0.3")
        axis.axvline(now[f"{target}: {WIDTH}"], color="0.2", lw=1.2)
        axis.axvline(luck[f"{target}: {WIDTH}"], color="0.2", lw=1.2, ls=":")
        axis.set_title(target, loc="left")
        axis.set(xlabel="width of the 90 % interval [mm/s]", xlim=(0.0, None))
        axis.set_xticks([x for x in axis.get_xticks() if x <= axis.get_xlim()[1]])
    axes[0].invert_yaxis()
    return figure
