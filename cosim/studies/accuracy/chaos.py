"""Where a scene is chaotic: statistics over an ensemble in the place of single paths.

A scene is chaotic where a change of the normal force by 1e-9 of itself moves the part's path by
more than :data:`CHAOTIC` times as much. No method can follow such a path, whatever its steps. What
can be compared is an ensemble: the same runs from normal forces a little apart, of which each
method must give the same mean velocity, share of sticking and counts of events, within what the
ensemble's own spread leaves open.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.ensemble import Ensemble
from cosim.studies.accuracy.figures import draw_chaos
from cosim.studies.tables import Row, write_csv, write_page
from cosim.waveforms.result import Result

CHAOTIC = 1e4
"""Growth of a small difference from which on single paths are not compared."""
NUDGE, APART = 1e-9, 1e-6
"""Relative changes of the normal force: of the run that tells of chaos, and between the ensemble's
members."""
MEMBERS, DURATION, SETTLE = 12, 1.0, 0.5
STATISTICS = ("v_average", "stick_fraction", "impacts", "stick_slip_events")
SCENE = ("drive.pot_max=0.508", "drive.pot_frequency=0.5452", "drive.pot_offset=0.5565")
"""What differs from ``paper``: three knobs of its signal generator."""
METHODS = {
    "step-locked, fine steps": ("circuit.reltol=1e-6", "circuit.max_step=2e-5"),
    "step-locked (default)": (),
    "Gauss-Seidel, 0.1 ms": ("coupling.method=gauss-seidel", "coupling.macro_step=1e-4"),
    "mean current, 0.2 ms": ("coupling.method=mean-current", "coupling.macro_step=2e-4"),
}
"""What is compared with the first of them."""


def solved(scene: Sequence[str], more: Sequence[str], change: float = 0.0) -> Result:
    """A run of ``paper`` with overrides, its normal force greater by the share ``change``."""
    force = load("paper", list(scene)).friction.normal_force * (1.0 + change)
    short = [f"run.duration={DURATION!r}", f"run.settle={SETTLE!r}", "run.output_step=1e-3"]
    return simulate(load("paper", [*scene, *short, f"friction.normal_force={force!r}", *more]))


def growth(scene: Sequence[str], more: Sequence[str] = ()) -> float:
    """How many times a small relative change of the normal force is found again in the path."""
    path, nudged = (solved(scene, more, c).columns["z_part"] for c in (0.0, NUDGE))
    return float(np.abs(nudged - path).max() / np.ptp(path)) / NUDGE


def ensemble(name: str, scene: Sequence[str], more: Sequence[str], members: int) -> Ensemble:
    """The statistics of runs with normal forces apart by :data:`APART`."""
    found: dict[str, list[float]] = {name: [] for name in STATISTICS}
    for k in range(members):
        summary = solved(scene, more, APART * k).summary
        for statistic in STATISTICS:
            value = summary[statistic]
            assert isinstance(value, int | float)
            found[statistic].append(float(value))
    return Ensemble(name, found)


def run(out: Path) -> str:
    """Write ``chaos`` as png, csv and md into ``out``; gives what it shows."""
    grown = growth(SCENE)
    ensembles = [ensemble(name, SCENE, more, MEMBERS) for name, more in METHODS.items()]
    first, *others = ensembles
    most = max(first.apart(one, statistic) for one in others for statistic in STATISTICS)
    message = (
        f"In a chaotic scene no two paths agree, but the methods' statistics do: {most:.1f} "
        "standard errors apart at most"
    )
    notes = [
        f"{message}.",
        f"The scene paper with {', '.join(SCENE)}. A change of the normal force by {NUDGE:g} of "
        f"itself moves the path by {grown:.1e} times as much: chaotic (from {CHAOTIC:g}), so "
        f"statistics are compared and not paths. Means over {MEMBERS} runs of {DURATION:g} s whose "
        f"normal forces are apart by {APART:g}, ± their standard errors; in parentheses the "
        "distance from the first method's mean, in standard errors of the difference.",
    ]
    raw = [
        {"method": one.name, "run": k} | {name: one.values[name][k] for name in STATISTICS}
        for one in ensembles
        for k in range(MEMBERS)
    ]
    write_csv(out / "chaos.csv", raw)
    write_page(out / "chaos.md", "A chaotic scene", notes, {"Ensembles": rows(ensembles)})
    draw_chaos(ensembles, message, out / "chaos.png")
    return message


def rows(ensembles: Sequence[Ensemble]) -> list[Row]:
    """A row a method, a column a statistic."""

    def cell(one: Ensemble, statistic: str) -> str:
        middle, error = one.mean(statistic)
        return f"{middle:.4g} ± {error:.2g} ({one.apart(ensembles[0], statistic):.1f})"

    return [
        {"method": one.name} | {name: cell(one, name) for name in STATISTICS} for one in ensembles
    ]
