"""The files of an identification, and the text of its report."""

from functools import partial
from pathlib import Path
from typing import Any

from cosim.evaluate.keys import numeric_key
from cosim.files.atomic import write_json, write_text
from cosim.studies.identify.problem.gauges import GAUGES
from cosim.studies.identify.problem.space import OWN_KEYS
from cosim.studies.identify.report import figures
from cosim.studies.identify.report.scenes import rounded, scene_file, trial_settings
from cosim.studies.identify.report.solved import KINDS, Solved
from cosim.studies.report import Report, Row, markdown
from cosim.waveforms.quantities import label, percent

COLUMNS = {
    "nrmse_v_surface": "velocity",
    "nrmse_z_surface": "height",
    "nrmse_v_part": "part's velocity",
    "part_error_mm": "part [mm]",
    "straight_line_error_mm": "straight line [mm]",
    "v_average_mm_per_s": "v_average [mm/s]",
    "v_average_measured_mm_per_s": "measured [mm/s]",
}
"""Headings of the tables' columns, by the names in ``identify.json``."""

MEAN = {"trial": "mean"}

HELD_OUT = {
    kind: f"Held out: rig from the other folds, own numbers from the trial's {words}"
    for kind, words in zip(KINDS, ("surface alone", "surface and part"), strict=True)
}
"""Headings of the tables of held-out trials."""

NOT_FITTED = "Trials that were not fitted"
PRINTED = ("The rig", "Laws of the suspension", "The trials", NOT_FITTED, HELD_OUT["surface"])
"""Headings of the tables that are printed."""

NOTES = (
    "One rig for all trials; amplitude, offset, phase, start, frequency, height at rest and normal "
    "force are each trial's own. Errors of velocities and heights are NRMSE: rms error over the "
    "standard deviation of what was measured; 'floor' is that of the measured cycles among "
    "themselves, 'late' without the first. The part's error is the mean distance of its heights, "
    "means removed; 'straight line' is that of the best straight line. v_average is the slope of "
    "that line, of fitted trials as their scenes run it on the circuit limited.",
    "The volts follow from the force factor, which is known only as the verdict says: they are not "
    "measured volts. A constant force on the ram does what an offset of the drive does: of the "
    "suspension's force only its change from the centre is told, and no offset is measured.",
    "The spring-loaded plate stands still here; in the published trials it moves at 5 to 18 mm/s.",
)


def write(folder: Path, found: Solved) -> None:
    """Write all files that :meth:`Identification.save` names."""
    numbers, rig = found.numbers, rounded(found.rig)
    rows = [*numbers["trials"], *numbers["apart"]]
    names = {name: name for row in rows for name in row}
    names |= {own: label(own, numeric_key(key).unit) for key, own in OWN_KEYS.items()}
    names["lift"] = "lift"  # a share
    Report(
        *("identify", "The identified rig"),
        [{head: row.get(name) for name, head in names.items()} for row in rows],
        [*NOTES, *_priors(found), *findings(numbers)],
        tables(numbers),
        {f"-{name}": partial(draw, found) for name, draw in figures.FIGURES.items()},
    ).save(folder)
    write_json(folder / "identify.json", numbers)
    words = f"The rig identified from {len(found.trials)} trials"
    write_text(folder / "rig.toml", scene_file(words, rig))
    fitted = zip(found.trials, found.best.own, strict=True)
    for trial, own in (*fitted, *zip(found.apart, found.apart_own, strict=True)):
        if trial.target.current is not None:
            continue
        settings, first = trial_settings(found.rig, trial, own)
        told = f"Trial {trial.label} on the identified rig; its record begins at {first:.4g} s"
        if trial in found.apart:
            told = f"Trial {trial.label} on the identified rig, which does not reproduce it"
        number = f"{int(trial.label):02d}" if trial.label.isdecimal() else trial.label
        write_text(folder / f"trial-{number}.toml", scene_file(told, rig | settings))


def _priors(found: Solved) -> list[str]:
    """Paragraphs on what enters the cost beside the trials: priors, and other measurements."""
    said, rig, space = [], found.best.numbers, found.best.space
    known = [entry for entry in space.free if entry.prior is not None and entry.sigma is not None]
    off = space.residuals(found.best.point[None])[0][len(space.measured) :].tolist()
    weighed = [
        f"{entry.key} {entry.prior:.4g} (σ {entry.sigma:.2g}{' of it' if entry.log else ''}; the "
        f"rig is {sigmas:+.1f} σ off)"
        for entry, sigmas in zip(known, off, strict=True)
    ]
    if weighed:
        said.append(
            f"Priors took part, normal ones in a likelihood: {'; '.join(weighed)}. They decide "
            "where the trials do not tell. Ranges hold the truth as often as they say only where "
            "the priors do, too."
        )
    other = [
        f"{name} {value * gauge.scale:.4g} ± {sd * gauge.scale:.2g} {gauge.unit}, on the rig "
        f"{gauge.of(rig) * gauge.scale:.4g}"
        for name, (value, sd) in found.best.space.measured.items()
        for gauge in (GAUGES[name],)
    ]
    return said + [f"Measured besides: {'; '.join(other)}."] * bool(other)


def findings(numbers: dict[str, Any]) -> list[str]:
    """Paragraphs on convergence, on where the ram rests, and on trials' numbers at bounds."""
    laws, agreed = numbers["laws"], numbers["converged"]
    shares = [
        f"{one['law']} {percent(max(one['costs']) / min(one['costs']) - 1.0)}" for one in laws
    ]
    if agreed:
        words = (
            f"Two searches with the law {' or '.join(agreed)} have come to the same cost, within "
            "2 %. Ranges hold the 90 % intervals about all their solutions that are as likely (of "
            f"{numbers['effective_samples']:.0f} effective samples, twice as wide as if the model "
            "lacked nothing), and about each law's best."
        )
    elif max(len(one["costs"]) for one in laws) < 2:
        words = "Not converged: one search tells no range. A range needs two that come to the same."
    else:
        words = (
            f"Not converged: two searches differ in their cost by more than 2 % "
            f"({'; '.join(shares)}), so the spread of their solutions is the search's own, and no "
            "range is told."
        )
    said, laws = [words], [one for one in laws if len(one["rests_mm"]) > 1]
    if laws:
        rests = (
            f"{one['law']} at q = {', '.join(f'{q:.3g}' for q in one['rests_mm'])} mm"
            for one in laws
        )
        said.append(f"Without a current the ram rests at more than one place: {'; '.join(rests)}.")
    ends = [f"{row['trial']} ({row['at_bounds']})" for row in numbers["trials"] if row["at_bounds"]]
    if ends:
        said.append(f"At a bound of the search lie numbers of the trials {'; '.join(ends)}.")
    return said


def summary(found: Solved) -> str:
    """What is printed: the findings, and some of the report's tables."""
    lines = findings(found.numbers)
    for heading, rows in tables(found.numbers).items():
        if heading in PRINTED:
            lines += ["", f"{heading}:", *markdown(rows)]
    return "\n".join(lines)


def _between(row: Row, unit: str) -> str:
    low, high = (f"{row[f'{end}_{unit}']:.2f}" for end in ("low", "high"))
    return low if low == high else f"{low} to {high}"


def tables(numbers: dict[str, Any]) -> dict[str, list[Row]]:
    """The report's tables by heading, from the content of ``identify.json``."""
    agreed = "" if numbers["converged"] else " (not converged: the search's own scatter)"
    count = len(numbers["ensemble"])
    rig, whole = numbers["rig"], _told(numbers["overall"] | MEAN) | {"floor": "", "late": ""}
    tables: dict[str, list[Row]] = {
        "The rig": [
            {"key": label(key, numeric_key(key).unit), "value": rig[key], "verdict": one["words"]}
            for one in numbers["verdicts"]
            for key in (one["key"],)
        ],
        "Laws of the suspension": [
            {
                "law": one["law"],
                "cost of each search": ", ".join(f"{cost:.4f}" for cost in one["costs"]),
                "rests at q [mm]": ", ".join(f"{q:.2f}" for q in one["rests_mm"]),
                "velocity": one["nrmse_v_surface"],
                "worst": one["nrmse_v_surface_worst"],
                "v_average, error [mm/s]": one["v_average_error_mm_per_s"] or "-",
            }
            for one in numbers["laws"]
        ],
        f"The suspension's force F(q) - F(0) on {count} rig{'s' * (count > 1)}{agreed}": [
            {"q [mm]": row["q_mm"]}
            | {"force [N]": _between(row, "N"), "force/Bl [A]": _between(row, "A")}
            for row in numbers["force"]
        ],
        "The trials": [*map(_told, numbers["trials"]), whole],
    }
    if numbers["apart"]:
        tables[NOT_FITTED] = [*map(_told, numbers["apart"])]
    for kind, heading in HELD_OUT.items():
        if numbers["held_out"]:
            rows = [_told(one[kind]) for one in numbers["held_out"]]
            tables[heading] = [*rows, _told(numbers["held_out_overall"][kind] | MEAN)]
    if checks := numbers["exact_rungs_v_average_mm_per_s"]:
        names = ("trial", "steps", "limited", "amplifier")
        tables["v_average [mm/s] by the search's steps and on the bench's rungs"] = [
            {name: "-" if row.get(name) is None else row[name] for name in names} for row in checks
        ]
    return tables


def _told(row: Row) -> Row:
    """A trial's row with the tables' headings, and with its repeatability where it has one."""
    floors = {"floor": "floor", "late": "floor_late"}
    return (
        {"trial": row["trial"]}
        | {words: row[name] for name, words in COLUMNS.items() if name in row}
        | {words: row[name] or "-" for words, name in floors.items() if name in row}
    )
