"""The files of an identification, and its words."""

from pathlib import Path
from typing import Any

from cosim.files.atomic import write_json, write_text
from cosim.studies.identify.problem.gauges import GAUGES
from cosim.studies.identify.report import figures
from cosim.studies.identify.report.measures import Row
from cosim.studies.identify.report.scenes import rig_settings, toml, trial_settings
from cosim.studies.identify.report.solved import Solved
from cosim.studies.tables import write_csv, write_page

COLUMNS = {
    "nrmse_v_surface": "velocity",
    "nrmse_z_surface": "height",
    "nrmse_v_part": "part's velocity",
    "part_error_mm": "part [mm]",
    "straight_line_error_mm": "straight line [mm]",
    "v_average_mm_per_s": "v_average [mm/s]",
    "v_average_measured_mm_per_s": "measured [mm/s]",
}
"""Of the tables, by the names in ``identify.json``."""

WORST = "nrmse_v_surface_worst"
WIDTH = 17

NOTES = (
    "One rig for all trials; amplitude, offset, phase, start, frequency, height at rest and normal "
    "force are each trial's own. Errors of velocities and heights are NRMSE: rms error over the "
    "standard deviation of what was measured; 'floor' is that of the measured cycles among "
    "themselves, 'late' without the first. The part's error is the mean distance of its heights, "
    "means removed; 'straight line' is that of the best straight line. v_average is the slope of "
    "that line.",
    "The volts follow from the force factor, which is known only as the verdict says: they are not "
    "measured volts. A constant force on the ram does what an offset of the drive does: of the "
    "suspension's force only its change from the centre is told, and no offset is measured.",
    "The spring-loaded plate stands still here; in the published trials it moves at 5 to 18 mm/s.",
)


def write(folder: Path, found: Solved) -> None:
    """Everything that :meth:`Identification.save` names."""
    numbers = found.numbers
    write_json(folder / "identify.json", numbers)
    write_csv(folder / "identify.csv", _aligned([*numbers["trials"], *numbers["apart"]]))
    notes = [*NOTES, *_priors(found), *findings(numbers)]
    write_page(folder / "identify.md", "The identified rig", notes, tables(numbers))
    for name, draw in figures.FIGURES.items():
        draw(found).write(folder / f"identify-{name}.png")
    words = f"The rig identified from {len(found.trials)} trials"
    write_text(folder / "rig.toml", toml(words, rig_settings(found.space, found.best.place)))
    for trials, owns in ((found.trials, found.best.own), (found.apart, found.apart_own)):
        for trial, own in zip(trials, owns, strict=True):
            if trial.target.current is not None:
                continue
            rig = rig_settings(found.space, found.best.place)
            settings, first = trial_settings(found.space, found.best.place, trial, own)
            told = f"Trial {trial.label} on the identified rig; its record begins at {first:.4g} s"
            if trial in found.apart:
                told = f"Trial {trial.label} on the identified rig, which does not reproduce it"
            label = f"{int(trial.label):02d}" if trial.label.isdecimal() else trial.label
            write_text(folder / f"trial-{label}.toml", toml(told, rig | settings))


def _priors(found: Solved) -> list[str]:
    weighed = [
        f"{entry.key} {entry.prior:.4g} (σ {entry.sigma:.2g}{' of it' if entry.log else ''})"
        for entry in found.space.free
        if entry.prior is not None and entry.sigma is not None
    ]
    words = (
        f"Weak priors, a thousandth of the cost for each σ², took part: {'; '.join(weighed)}. They "
        "decide where the trials do not tell."
    )
    numbers = found.space.numbers(found.best.place)
    other = [
        f"{name} {value * gauge.scale:.4g} ± {sd * gauge.scale:.2g} {gauge.unit}, on the rig "
        f"{gauge.of(numbers) * gauge.scale:.4g}"
        for name, (value, sd) in found.space.measured.items()
        for gauge in (GAUGES[name],)
    ]
    return [
        *([words] if weighed else []),
        *([f"Measured besides: {'; '.join(other)}."] * bool(other)),
    ]


def findings(numbers: dict[str, Any]) -> list[str]:
    """Of ``identify.json``: what the ranges are worth, where the ram rests, which drives are at a
    bound; a paragraph each."""
    laws, agreed = numbers["laws"], numbers["converged"]
    shares = [f"{one['law']} {max(one['costs']) / min(one['costs']) - 1.0:.1%}" for one in laws]
    if agreed:
        words = (
            f"Two searches with the law {' or '.join(agreed)} have come to the same cost, within "
            f"2 %. Ranges hold the values of all their solutions that are as likely (90 %, of "
            f"{numbers['effective_samples']:.0f} effective samples), and of all these laws."
        )
    elif max(len(one["costs"]) for one in laws) < 2:
        words = "Not converged: one search tells no range. A range needs two that come to the same."
    else:
        words = (
            f"Not converged: two searches differ in their cost by more than 2 % "
            f"({'; '.join(shares)}), so the spread of their solutions is the search's own, and no "
            "range is told."
        )
    rests = [
        f"{one['law']} at q = {', '.join(f'{q:.3g}' for q in one['rests_mm'])} mm"
        for one in laws
        if len(one["rests_mm"]) > 1
    ]
    several = f"Without a current the ram rests at more than one place: {'; '.join(rests)}."
    ends = [f"{row['trial']} ({row['at_bounds']})" for row in numbers["trials"] if row["at_bounds"]]
    bound = f"At a bound of the search lie numbers of the trials {'; '.join(ends)}."
    return [words, *([several] if rests else []), *([bound] if ends else [])]


def summary(found: Solved) -> str:
    """The rig with its verdicts, and the errors trial by trial."""
    numbers = found.numbers
    rig = numbers["rig"]
    lines = [f"{one.key:<32}{rig[one.key]:>10.4g}  {one.words}" for one in found.verdicts]
    lines += ["", *findings(numbers)]
    heads = ("trial", "velocity", "height", "floor", "part [mm]", "v_average [mm/s]", "measured")
    lines += ["", "".join(f"{head:>{WIDTH}}" for head in heads)]
    lines += [_line(row) for row in numbers["trials"]]
    lines += [f"{_line(row)}   (not fitted)" for row in numbers["apart"]]
    lines += [_line(numbers["overall"] | {"trial": "mean"})]
    lines += [f"worst velocity {_brief(numbers['overall'], WORST)}, cost {numbers['cost']:.4f}"]
    if held := numbers["held_out_overall"]:
        mean, worst = (_brief(held["surface"], name) for name in ("nrmse_v_surface", WORST))
        lines += [f"held out, with the rig of the other folds: velocity {mean}, worst {worst}"]
    return "\n".join(lines)


def _line(row: Row) -> str:
    names = ("nrmse_v_surface", "nrmse_z_surface", "floor_late", "part_error_mm")
    names += ("v_average_mm_per_s", "v_average_measured_mm_per_s")
    cells = [row["trial"], *(_brief(row, name) for name in names)]
    return "".join(f"{cell:>{WIDTH}}" for cell in cells)


def _brief(row: Row, name: str) -> str:
    value = row.get(name)
    return "–" if value is None else f"{value:.3f}"


def _aligned(rows: list[Row]) -> list[Row]:
    """The same columns in all rows."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name) for name in names} for row in rows]


def _between(row: Row, unit: str) -> str:
    low, high = (f"{row[f'{end}_{unit}']:.2f}" for end in ("low", "high"))
    return low if low == high else f"{low} to {high}"


def tables(numbers: dict[str, Any]) -> dict[str, list[Row]]:
    """Of ``identify.json``: the tables of the page, by heading."""
    agreed = "" if numbers["converged"] else " (not converged: the search's own scatter)"
    tables: dict[str, list[Row]] = {
        "The rig": [
            {"key": v["key"], "value": numbers["rig"][v["key"]], "verdict": v["words"]}
            for v in numbers["verdicts"]
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
        f"The suspension's force F(q) - F(0) on {len(numbers['ensemble'])} rigs{agreed}": [
            {
                "q [mm]": row["q_mm"],
                "force [N]": _between(row, "N"),
                "force/Bl [A]": _between(row, "A"),
            }
            for row in numbers["force"]
        ],
        "The trials": [_told(row, floors=True) for row in numbers["trials"]],
    }
    if numbers["apart"]:
        tables["Trials that were not fitted"] = [
            _told(row, floors=True) for row in numbers["apart"]
        ]
    both = "surface and part, whose heights count twice"
    for kind, words in (("surface", "surface alone"), ("surface_and_part", both)):
        rows = [one[kind] for one in numbers["held_out"]]
        if rows:
            tables[f"Held out: rig from the other folds, own numbers from the trial's {words}"] = [
                *map(_told, rows), _whole(numbers["held_out_overall"][kind])
            ]  # fmt: skip
    made_up = numbers["made_up_rig"]
    tables["The rig of the scenes' defaults with its best drives"] = [
        *map(_told, made_up["trials"]),
        _whole(made_up["overall"]),
    ]
    tables["The trials"].append(_whole(numbers["overall"]) | {"floor": "", "late": ""})
    if numbers["exact_rungs_v_average_mm_per_s"]:
        checks = numbers["exact_rungs_v_average_mm_per_s"]
        names = ("trial", "steps", "limited", "amplifier")
        tables["v_average [mm/s] by the search's steps and on the bench's rungs"] = [
            {name: "-" if row.get(name) is None else row[name] for name in names} for row in checks
        ]
    return tables


def _told(row: Row, floors: bool = False) -> Row:
    found: Row = {"trial": row["trial"]}
    found |= {words: row[name] for name, words in COLUMNS.items() if name in row}
    if floors:
        found |= {"floor": row["floor"] or "-", "late": row["floor_late"] or "-"}
    return found


def _whole(overall: Row) -> Row:
    return {"trial": "mean"} | {
        words: overall[name] for name, words in COLUMNS.items() if name in overall
    }
