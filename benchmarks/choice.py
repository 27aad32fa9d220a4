"""Which circuit model and tolerance to take: error and CPU time over settings of the knobs.

The solver's error is taken against the same model with much shorter steps, the whole error against
the schematic ("full") with such steps. Only settings with regular motion have errors: in others the
start, or the ninth digit of a setting, determines the mean velocity.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import ceil, inf, nan
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Settings, point
from cosim.files.picture import Picture
from cosim.scene import changed, load
from cosim.simulation.checks import motion
from cosim.simulation.fast import summaries
from cosim.simulation.fidelity import COMPLETE, JUDGES, SEARCHES, relative_error
from cosim.simulation.simulate import summary
from cosim.stepper.stepper import LANES
from cosim.studies.plots import BLUE, GREEN, ORANGE, PURPLE, VERMILION, panels
from cosim.studies.report import Report, Row, brief, markdown
from cosim.studies.speed.bench import take_turns
from cosim.toolchain.processes import in_place
from cosim.version import __version__

SETTINGS, QUICK, TIMED = 18, 2, 2
"""Settings of each machine: drawn, drawn if ``quick``, and timed (the first regular ones)."""

KNOBS = ("drive.frequency", "drive.amplitude", "drive.offset")
LOW, HIGH = np.array([10.0, 3.0, -3.0]), np.array([90.0, 10.0, 3.0])
"""Ranges of KNOBS, Hz, V, V; with larger offsets the part mostly stays."""

BASE = changed(load("reference"), {"run.duration": 1.0, "run.settle": 0.5}, "choice")
"""The scene that all settings change; runs in whole periods are at least as long."""

OWN, COST, ALL = "own model", "CPU time over amplifier's", "all"
SHARES = {"median": 0.5, "90 %": 0.9, "worst": 1.0}
"""Quantiles of the error over the regular settings, by their names in the tables."""

LEAST, MOST = 1e-5, 1e3
"""Range of the figure, %; smaller errors are drawn at LEAST, larger ones are not drawn."""


def of(line: str, *every: Settings) -> dict[str, Settings]:
    """The settings of a line of the figure, named by the line and their steps; ``{}``: default."""
    model, _, solver = line.partition(", ")
    own: Settings = {"circuit.model": model, **({"run.solver": solver} if solver else {})}
    words = [", ".join(f"{key} = {value:.2g}" for key, value in x.items()) for x in every]
    return {f"{line}: {w or 'default'}": {**own, **x} for w, x in zip(words, every, strict=True)}


def steps(longer: float) -> Settings:
    """Steps of ngspice ``longer`` times the default; the tolerance grows with their cube."""
    reltol, max_step = BASE.circuit.reltol, BASE.circuit.max_step
    return {"circuit.reltol": reltol * longer**3, "circuit.max_step": max_step * longer}


LOOSE, LOOSER = {"mechanics.tolerance": 1e-6}, {"mechanics.tolerance": 1e-4}
FAST = f"{SEARCHES}, fast"
CHOICES = {
    **of("ideal", LOOSER, LOOSE, {}),
    **of(FAST, *({"run.step": step} for step in (1e-4, 5e-5, 2e-5, 1e-5))),
    **of(SEARCHES, LOOSER, LOOSE, {}),
    **of(JUDGES, steps(3.0), steps(1.7), {}, steps(0.5)),
    **of(COMPLETE, steps(3.0), steps(1.7), {}),
}
"""The compared settings, each line from coarse to fine."""
DEFAULT = f"{JUDGES}: default"

FINEST = {"ideal": {"mechanics.tolerance": 1e-12}, SEARCHES: {"mechanics.tolerance": 1e-12}}
FINEST |= {JUDGES: steps(1.0 / 4.0), COMPLETE: steps(1.0 / 3.0)}
TRUTHS: dict[str, Settings] = {m: {"circuit.model": m, **fine} for m, fine in FINEST.items()}
"""The settings of each model with the finest steps, against which errors are taken."""


def machines() -> dict[str, Settings]:
    """The machines as changes of BASE. All have the data sheet's swing losses in the amplifier, as
    the scene `paper`: otherwise a parameter, not the model, would make its error."""
    base, paper = BASE.as_dict(), load("paper").as_dict()
    tables = ("circuit", "coil", "mechanics", "friction")
    keys = [(table, key, value) for table in tables for key, value in paper[table].items()]
    rig = {f"{table}.{key}": value for table, key, value in keys if base[table].get(key) != value}
    losses = {key: value for key, value in rig.items() if key.startswith("circuit.swing_loss")}
    return {
        f"{name}, {contact}": {**own, "mechanics.contact": contact}
        for name, own in (("paper", rig), ("reference", losses))
        for contact in ("compliant", "rigid")
    }


def choice(quick: bool, out: Path) -> Report:
    """The error of v_average and the CPU time of each circuit model at each tolerance, on settings
    of the knobs drawn at random, and what to take for 10, 1 and 0.1 %; ``quick``: few settings.

    It leaves what ``Report.save`` writes in ``out``, and resumes an interrupted call.
    """
    path = out / "choice.sqlite"
    with Evaluator(BASE, path, whole_periods=True, kept=("v_average",)) as bench:
        found = measure(bench, QUICK if quick else SETTINGS)
        found.save(out)
        bench.forget()
    return found


def measure(bench: Evaluator, draws: int) -> Report:
    """The report on ``draws`` settings of each machine, which ``bench`` runs."""
    cube = qmc.Sobol(len(KNOBS), rng=np.random.default_rng(0)).random_base2(5)[:draws]
    drawn = [
        (machine, {**own, **dict(zip(KNOBS, row, strict=True))})
        for machine, own in machines().items()
        for row in (LOW + (HIGH - LOW) * cube).round(3).tolist()
    ]
    motions = [_kind(own) for _, own in drawn]
    kinds: dict[str, Counter[str]] = {machine: Counter() for machine in machines()}
    for (machine, _), kind in zip(drawn, motions, strict=True):
        kinds[machine][kind] += 1
    regular = [pair for pair, kind in zip(drawn, motions, strict=True) if kind == "regular"]
    variants = CHOICES | TRUTHS
    asked = [
        (what, n, settings)
        for n, (_, own) in enumerate(regular)
        for what, change in variants.items()
        if _able(settings := {**own, **change})
    ]
    timed = [s for m in kinds for s in [own for name, own in regular if name == m][:TIMED]]
    # v_average by variant and regular setting; NaN: not able, inf: failed.
    found = {what: np.full(len(regular), nan) for what in variants}
    for k, outcome in bench.run((k, settings) for k, (*_, settings) in enumerate(asked)):
        what, n, _ = asked[k]
        found[what][n] = outcome.numbers.get("v_average", inf)
    seconds, costs = [], {what: [] for what in CHOICES}
    for settings in timed:
        taken = _time(settings)
        seconds.append(taken[DEFAULT])
        for what, second in taken.items():
            costs[what].append(second / taken[DEFAULT])
    rows: list[Row] = []
    for machine in (*kinds, ALL):
        of_machine = np.array([machine in (ALL, name) for name, _ in regular], bool)
        for what, own in CHOICES.items():
            model = str(own["circuit.model"])
            row = {"machine": machine, "circuit.model": model, "steps": what.partition(": ")[2]}
            row |= {"line": what.partition(":")[0], COST: float(np.median(costs[what]))}
            for against, truth in {OWN: model, JUDGES: JUDGES, COMPLETE: COMPLETE}.items():
                pairs = zip(found[what][of_machine], found[truth][of_machine], strict=True)
                errors = np.sort([100.0 * relative_error(v, true) for v, true in pairs])
                errors = errors[~np.isnan(errors)]  # where the fast solver cannot run
                row["regular settings"] = len(errors)
                for name, share in SHARES.items() if len(errors) else ():
                    row[_column(against, name)] = float(errors[ceil(share * len(errors)) - 1])
            if row["regular settings"]:
                rows.append({**row, "version": __version__})
    return report(rows, kinds, float(np.median(seconds)))


def _able(settings: Settings) -> bool:
    """Whether the solver can run the settings: the fast one has no rigid walls."""
    return "run.solver" not in settings or settings["mechanics.contact"] == "compliant"


def _kind(settings: Settings) -> str:
    """The kind of motion, or why it is unknown."""
    try:
        point(BASE, {**settings, **TRUTHS[COMPLETE]}, True)
    except BadInput:
        return "beyond the knobs"
    return motion(point(BASE, settings, True), lambda _: None).get("motion", "unknown")


def _time(own: Settings) -> dict[str, float]:
    """CPU time of each choice for a simulated second, s, in turns in this process; the fast solver
    runs LANES settings at once."""
    calls: dict[str, Callable[[], object]] = {}
    for what, choice in CHOICES.items():
        if _able({**own, **choice}):
            scene = point(BASE, {**own, **choice}, True)
            many = partial(summaries, [scene] * LANES)
            calls[what] = partial(summary, scene) if scene.run.solver == "fmu" else many
    with in_place():
        taken = take_turns(calls, 1)
    lasted = point(BASE, own, True).run.duration
    return {k: t / lasted / (LANES if "fast" in k else 1) for k, (t,) in taken.items()}


def _column(against: str, share: str) -> str:
    return f"against {against}: {share} [%]"


def advice(rows: Sequence[Row], wanted: float) -> Row:
    """The cheapest choices whose error against the schematic is at most ``wanted``, %."""
    found: Row = {"error wanted [%]": wanted}
    for words, share in (("in half of the settings", "median"), ("in nine of ten", "90 %")):
        good = [row for row in rows if row[_column(COMPLETE, share)] <= wanted]
        best = min(good, key=lambda row: row[COST], default={COST: nan})
        found[words] = f"{best['line']}, {best['steps']}" if good else "none"
        found[f"{words}: {COST}"] = best[COST]
    return found


def report(rows: Sequence[Row], kinds: Mapping[str, Counter[str]], second: float) -> Report:
    """The report, of the ``rows`` of each machine and of ALL, the number of settings with each kind
    of motion, and the CPU time of DEFAULT for a simulated ``second``, s."""
    overall = [row for row in rows if row["machine"] == ALL]
    advised = [advice(overall, wanted) for wanted in (10.0, 1.0, 0.1)]
    default = {row["line"]: row for row in overall if row["steps"] == "default"}
    half = {line: brief(row[_column(COMPLETE, "median")]) for line, row in default.items()}
    cost = brief(default[SEARCHES][COST])
    title = (
        f"Against the schematic limited errs {half[SEARCHES]} %, at {cost} of the CPU time "
        f"of amplifier, which errs {half[JUDGES]} %; ideal errs {half['ideal']} % (medians)"
    )
    notes = [
        f"{title}.",
        f"{sum(map(Counter.total, kinds.values()))} settings of the knobs on the rigs of scenes "
        "`paper` and `reference`. The regular ones count; elsewhere the start decides, or no mean "
        "over a second is right. Errors are of v_average, relative: against the own model with "
        "much finer steps, so what the solver errs, and against the schematic, so all. On the rig "
        "`reference` the amplifier has the data sheet's swing losses here, as in `paper`. The "
        "sawtooth is smooth. The fast solver has no rigid walls, and runs eight settings at once.",
        "CPU times are over that of `amplifier` with default steps on the same settings, side by "
        f"side in one process, medians; that took {second:.2g} s for a simulated second.",
    ]
    names = sorted(set().union(*kinds.values()))
    counts = [{"machine": m} | {name: count[name] for name in names} for m, count in kinds.items()]
    hidden = ("machine", "line", "version")
    shown = [{key: row[key] for key in row if key not in hidden} for row in overall]
    return Report(
        "choice", "Which circuit model, which tolerance", rows, notes,
        {"What to take": advised, "All machines": shown, "Kinds of motion": counts},
        {"": partial(draw, overall, title)}, "\n".join([f"{title}.", "", *markdown(advised)]),
    )  # fmt: skip


def draw(rows: Sequence[Row], title: str) -> Picture:
    """Draw error over cost: of the solver alone, and of model and solver."""
    note = (
        "A line from coarse to fine steps; ring: default. Solid: the median; dotted: the worst. "
        f"What is less stands at {LEAST:g} %."
    )
    figure, axes = panels(title, note, (11.0, 5.2), 2, sharex=True, sharey=True)
    lines = dict.fromkeys(row["line"] for row in rows)
    looks = zip((ORANGE, GREEN, BLUE, PURPLE, VERMILION), "osD^v", strict=True)
    styles = dict(zip(lines, looks, strict=True))
    panel = {OWN: "Solver, against its own model", COMPLETE: "All, against the schematic"}
    for axis, (against, words) in zip(axes, panel.items(), strict=True):
        for line, (color, marker) in styles.items():
            mine = [row for row in rows if row["line"] == line]
            rings = [k for k, row in enumerate(mine) if row["steps"] == "default"]
            x = [row[COST] for row in mine]
            worst, y = (
                [max(row[_column(against, s)], LEAST) for row in mine] for s in ("worst", "median")
            )
            axis.plot(x, worst, ":", color=color, marker=".")
            axis.plot(x, y, color=color, marker=marker, ms=4, label=line)
            axis.plot(x, y, "o", ms=10, mfc="none", color=color, markevery=rings)
        axis.set_title(words, loc="left")
        axis.set(
            xscale="log", yscale="log", ylim=(LEAST / 2.0, MOST), xlabel="CPU time over amplifier's"
        )
    axes[0].legend(fontsize=9)
    axes[0].set_ylabel("error of v_average [%]")
    return figure
