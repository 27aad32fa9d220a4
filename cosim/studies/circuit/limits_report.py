"""The limits in words, tables and a figure."""

from collections.abc import Sequence
from math import isnan, nan
from pathlib import Path

from cosim.studies.circuit import limits_figure
from cosim.studies.circuit.limits import LIMITS, TREMBLES, UNTOLD, Study, name_of
from cosim.studies.tables import Row, write_csv, write_page

MATTERED = 1.05
"""Least factor by which the ideal current must be off for the circuit to be said to matter."""


def write(folder: Path, studies: Sequence[Study]) -> str:
    """Write limits.csv, .md and .png into ``folder``; gives what is printed."""
    said: list[str] = []
    found: dict[str, Sequence[Row]] = {}
    for study in studies:
        name = name_of(study.scene)
        found[f"Which limit binds: {name}"] = rows(study)
        found[f"Two lifted together: {name}"] = pairs(study)
        if study.turned:
            found[f"Each limit turned: {name}"] = turned(study)
        said.append(words(study))
    write_csv(folder / "limits.csv", rows(studies[0]))
    write_page(folder / "limits.md", "Which limit binds?", said, found)
    limits_figure.draw(studies, folder / "limits.png")
    printed: list[str] = []
    for study, sentence in zip(studies, said, strict=True):
        lines = [
            f"  {name:<20}{verdict:<18}{v_average:+8.3f} mm/s ({change:+.3f})"
            for name, verdict, v_average, change, *_ in (row.values() for row in rows(study))
        ]
        printed += [sentence, "", *lines, ""]
    return "\n".join([*printed, f"Written to {folder}: limits.csv, limits.md, limits.png"])


def rows(study: Study) -> list[Row]:
    """The ranked table: which limit binds here."""
    gap = study.ideal.v_average - study.own.v_average
    return [
        {
            "limit": name,
            "verdict": study.verdict(name),
            "v_average without it [mm/s]": study.without[name].v_average * 1e3,
            "change [mm/s]": study.gain(name) * 1e3,
            "change on the rung limited [mm/s]": study.reduced_gain.get(name, nan) * 1e3,
            "of the way to the ideal current [%]": 100.0 * study.gain(name) / gap,
            "peak downward acceleration without it [m/s2]": study.without[name].fall,
            "output at a limit without it [% of the time]": study.without[name].saturated * 100.0,
        }
        for name in study.ranked()
    ]


def pairs(study: Study) -> list[Row]:
    """Two limits lifted together, the pair that gains most first."""
    found: list[Row] = [
        {
            "limits": " + ".join(pair),
            "v_average without both [mm/s]": motion.v_average * 1e3,
            "change [mm/s]": (motion.v_average - study.own.v_average) * 1e3,
            "more than one by one [mm/s]": study.together(pair) * 1e3,
        }
        for pair, motion in study.pairs.items()
    ]
    return sorted(found, key=lambda row: -abs(row["change [mm/s]"]))


def turned(study: Study) -> list[Row]:
    """Each limit turned, as numbers."""
    return [
        {
            "limit": name,
            "times its own": factor,
            "v_average [mm/s]": motion.v_average * 1e3,
            "peak downward acceleration [m/s2]": motion.fall,
            "output at a limit [% of the time]": motion.saturated * 100.0,
        }
        for name, row in study.turned.items()
        for factor, motion in sorted(row.items())
    ]


def words(study: Study) -> str:
    """The answer in a few sentences."""
    own, ideal, (peak, between) = study.own.v_average, study.ideal.v_average, study.peaks
    said = [
        f"{name_of(study.scene)}: the circuit moves the part at {own * 1e3:+.3g} mm/s, an ideal "
        f"current source at {ideal * 1e3:+.3g} mm/s{_ratio(own, ideal)}."
    ]
    binding, little = _named(study, "binds"), _named(study, "acts a little")
    said.append(f"What binds: {_listed(binding)}." if binding else "No limit binds.")
    if little:
        said.append(f"Little: {_listed(little)}.")
    rest = [limit.name for limit in LIMITS if study.verdict(limit.name) == "does not matter"]
    if rest:
        said.append(f"The {_listed(rest)} {'do' if len(rest) > 1 else 'does'} not matter.")
    untold = [name for name in study.ranked() if study.verdict(name) in UNTOLD]
    if untold:
        said.append(
            f"Of the {_listed(untold)} nothing can be told: without it the part goes over to "
            "another motion, or not, by how it started."
        )
    if study.all_gone is not None and not study.all_gone.failure:
        said.append(f"Without any of them: {study.all_gone.v_average * 1e3:+.3g} mm/s.")
    said.append(
        f"The part slips where the surface falls away faster than {study.needed:.3g} m/s²; it "
        f"reaches {between:.3g} m/s² without its walls' help"
        + ("." if isnan(peak) else f" and {peak:.3g} m/s² with it.")
    )
    if study.unsteady > 0.01 * max(abs(own), abs(ideal)):
        said.append(
            f"v_average is unsteady here: {max(TREMBLES):g} more normal force or coil's force, "
            f"relative, moves it by up to {study.unsteady * 1e3:.2g} mm/s."
        )
    return " ".join(said)


def _ratio(own: float, ideal: float) -> str:
    if own * ideal <= 0.0:
        return ""
    more = ideal / own
    if 1.0 / MATTERED < more < MATTERED:
        return f", {abs(more - 1.0):.1%} {'more' if more > 1.0 else 'less'}"
    return f", {more:.3g} times as fast" if more > 1.0 else f", only {more:.2g} times as fast"


def _named(study: Study, verdict: str) -> list[str]:
    return [
        f"{name} ({study.gain(name) * 1e3:+.3g} mm/s without it)"
        for name in study.ranked()
        if study.verdict(name) == verdict
    ]


def _listed(names: list[str]) -> str:
    *rest, last = names
    return f"{', '.join(rest)} and {last}" if rest else last
