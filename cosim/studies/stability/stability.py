"""The stability study: the limits of the coupling methods, their page and their figure."""

import os
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from cosim.evaluate.store import Store
from cosim.studies.plots import BLUE, GREEN, ORANGE, VERMILION, End, label_ends, panels
from cosim.studies.report import Progress, Report, silent
from cosim.studies.stability.limits import (
    LONGEST,
    METHODS,
    REGIMES,
    Limit,
    limits,
    over_strength,
    with_limits,
)
from cosim.studies.stability.machines import DIRECT
from cosim.studies.tables import Row, span

STORE = "stability.sqlite"

_COLORS = {1: ORANGE, 2: BLUE, 3: GREEN}
"""By the order of a method."""


def stability(
    *,
    quick: bool = False,
    out: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
) -> Report:
    """The largest stable macro step of every coupling method, predicted and observed; ``quick``: of
    few machines.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput.
    """
    regimes = [*(REGIMES[:1] if quick else REGIMES), *over_strength(3 if quick else 9)]
    with Store(None if out is None else Path(out) / STORE, quick) as store:
        found: list[Limit] = []
        for limit in limits(regimes, store):
            found.append(limit)
            progress(len(found), len(METHODS) * len(regimes), limit.method)
        made = report(found, list(with_limits((4e-3, 5e-3, 6e-3))))
        if out is not None:
            made.save(out)
        store.remove()
    return made


def report(found: Sequence[Limit], clamped: Sequence[Row]) -> Report:
    """What the limits show.

    ``clamped`` is the table of what becomes of the current behind an amplifier's limits.
    """
    driven = [x for x in found if x.machine == DIRECT.name and x.cut == "coil in circuit"]
    free = [m for m in METHODS if all(x.predicted >= LONGEST for x in driven if x.method == m)]
    message = "The stronger the coil couples, the shorter the macro step must be"
    if free:
        have = "has" if len(free) == 1 else "have"
        message += f"; only {' and '.join(free)} {have} no limit below {LONGEST:g} s"
    worst = max(abs(x.observed / x.predicted - 1.0) for x in found)
    swept = [x for x in driven if x.strength != DIRECT.strength]
    notes = [
        f"{message}.",
        "Limits: largest macro step at which a coupling is stable, predicted from the spectral "
        "radius of the coupled linear map, and observed by running it (with the FMU as the "
        "mechanics where the coil is in the circuit). The greatest difference between the two is "
        f"{worst:.1%}. Both are in stability.csv, over a strength of the coupling Bl²/(m R) of "
        f"{span([x.strength for x in swept])} 1/s.",
        "An amplifier's limits add what no linear map knows: where its clamped output makes an "
        "unstable coupling, the growing oscillation ends as soon as the output leaves the limit, "
        "and what remains is bounded but false (last table; steady, it would be 1.26 A). In the "
        "scene reference the output is clamped for less than a macro step after each fall of the "
        "command, so the limit of the clamped state is never met there.",
    ]
    tables: dict[str, Sequence[Row]] = {
        f"Predicted limits in ms, {cut}; - is none below {LONGEST * 1e3:g} ms": by_method(
            [x for x in found if x.cut == cut and x not in swept]
        )
        for cut in dict.fromkeys(x.cut for x in found)
    }
    tables["Gauss-Seidel k = 1 on Bl 3 N/A, behind the limit of a clamped amplifier"] = clamped
    return Report(
        "stability", "Stability of the coupling methods", [asdict(limit) for limit in found],
        notes, tables, {"": partial(draw, driven, free, message)}, message,
    )  # fmt: skip


def by_method(limits: Sequence[Limit]) -> list[Row]:
    """A row a method, a column a machine at a working state."""
    rows: dict[str, Row] = {}
    for x in limits:
        said = f"{x.predicted * 1e3:.3g}" if x.predicted < LONGEST else "-"
        rows.setdefault(x.method, {"method": x.method})[f"{x.machine}, {x.output}, {x.part}"] = said
    return list(rows.values())


def draw(limits: Sequence[Limit], free: Sequence[str], title: str, path: Path) -> None:
    """Draw the limits of each method over the strength of the coupling into ``path`` (a PNG)."""
    note = "Direct drive with other force factors. Lines: predicted; dots: observed with the FMU."
    figure, (axis,) = panels(title, note, (11.0, 5.6))
    strengths = sorted({x.strength for x in limits})
    none = LONGEST * 1e3
    axis.plot(strengths, [none] * len(strengths), color=VERMILION, lw=2.0, marker="o", ms=4)
    axis.plot(strengths, [1e3 / s for s in strengths], color="0.4", lw=1.0, ls="--")
    ends = [
        End(strengths[-1], none, "\n".join([*free, "(none below 100 ms)"]), VERMILION),
        End(strengths[-1], 1e3 / strengths[-1], "m R/Bl²", "0.3"),
    ]
    for method in METHODS:
        own = sorted((x for x in limits if x.method == method), key=lambda x: x.strength)
        known = [x for x in own if x.predicted < LONGEST]
        if method in free:
            continue
        p = METHODS[method].order
        x, color = [limit.strength for limit in known], _COLORS[p]
        axis.plot(x, [limit.predicted * 1e3 for limit in known], color=color, lw=1.6)
        axis.plot(x, [limit.observed * 1e3 for limit in known], "o", color=color, ms=4)
        ends.append(End(x[-1], known[-1].predicted * 1e3, f"{method} (order {p})", color))
    axis.axvline(DIRECT.strength, color="0.4", lw=0.9, ls=":")
    axis.annotate(
        f"direct drive, {DIRECT.scene.coil.force_factor:g} N/A",
        (DIRECT.strength, 40.0),
        (5, 0),
        textcoords="offset points",
        color="0.3",
    )
    axis.set(
        xscale="log",
        yscale="log",
        xlabel="strength of the coupling Bl²/(m R) [1/s]",
        ylabel="largest stable macro step [ms]",
    )
    label_ends(axis, ends, gap=0.052)
    figure.write(path)
