"""What a search leaves: every run, the best settings, and a sentence on how safe they are."""

from collections.abc import Sequence
from math import inf, isfinite
from pathlib import Path

from cosim.errors import BadInput, plain
from cosim.evaluate.keys import numeric_key, split
from cosim.files.atomic import write_json, write_text
from cosim.scene import to_toml
from cosim.scene.tables import KNOBS
from cosim.studies.tables import write_csv
from cosim.studies.tune.found import TURNS, Run, Search
from cosim.waveforms.quantities import bench_unit, with_unit


def write(folder: Path, tuning: Search) -> None:
    """Write ``tune.json``, ``tune.csv`` and ``best.toml``."""
    drive, summary = tuning.scene.drive, tuning.best.outcome.numbers
    numbers = {
        "quantity": tuning.quantity,
        "largest": tuning.largest,
        "value": tuning.best.value,
        "settings": tuning.best.values,
        "drive": {name: getattr(drive, name) for name in ("frequency", "amplitude", "offset")},
        "ranges": tuning.ranges,
        "runs": len(tuning.runs),
        "failed": tuning.failed,
        "seed": tuning.seed,
        "search": "Latin hypercube, then CMA-ES",
        "scouts": tuning.scouts,
        "value_by_fast_solver": tuning.by_fast,
        "turns": list(TURNS),
        "neighbours": tuning.neighbours,
        "robustness": robustness(tuning),
        "summary": {name: x if isfinite(x) else None for name, x in summary.items()},
    }
    write_runs(folder / "tune.csv", tuning.runs, tuning.quantity)
    aim = f"{'largest' if tuning.largest else 'least'} {tuning.quantity}"
    found = {"name": f"{tuning.scene.name}-tuned"[:64], "description": f"Tuned for the {aim}"}
    write_json(folder / "tune.json", numbers)
    write_text(folder / "best.toml", to_toml(tuning.scene.model_copy(update=found)))


def write_runs(path: Path, runs: Sequence[Run], quantity: str) -> None:
    """The runs in order: their settings (SI), the value asked for, and why one failed."""
    if runs:
        heads = {name: f"{name} [{numeric_key(name).unit}]" for name in runs[0].values}
        rows = [
            {heads[name]: setting for name, setting in run.values.items()}
            | {quantity: run.value, "failure": run.outcome.failure}
            for run in runs
        ]
        write_csv(path, rows)


def robustness(tuning: Search) -> str:
    """What it costs to turn a key a little, in words."""
    said = []
    for turn in sorted({abs(turn) for turn in TURNS}):
        lost = tuning.lost(turn)
        if lost is None:
            continue
        cost = "loses it altogether" if lost >= 1.0 else f"costs at most {max(lost, 0.0):.1%}"
        if lost == inf:
            cost = "leads to a run that fails"
        said.append(f"turning one key by {turn:.0%} of its range {cost}")
    if not tuning.neighbours:
        said.append("the budget ended before its neighbourhood was heard: a larger one may help")
    return "; ".join(said)


def ranges_of(over: Sequence[str]) -> dict[str, tuple[float, float]]:
    """The ranges that ``--over table.key=low:high`` options give. Raises BadInput."""
    ranges: dict[str, tuple[float, float]] = {}
    for text, name, ends in split(over, "table.key=low:high"):
        try:
            low, high = (float(end) for end in ends.split(":"))
        except ValueError:
            raise BadInput(f"--over {plain(text)}: must be table.key=low:high.") from None
        ranges[name] = (low, high)
    return ranges


def table(tuning: Search) -> str:
    """The best settings for a reader."""
    value = tuning.best.value
    assert value is not None
    unit, scale = bench_unit(tuning.quantity)
    ahead = f" ({tuning.scouts} ahead, cheaper)" if tuning.scouts else ""
    lines = [
        f"{tuning.quantity} = {with_unit(value * scale, unit, 5)} after {len(tuning.runs)} runs"
        f"{ahead}, {tuning.failed} failed, at"
    ]
    if tuning.by_fast is not None:
        told = with_unit(tuning.by_fast * scale, unit, 5)
        lines.append(f"  by the FMU; the fast solver, which searched, has {told}")
    for name, setting in tuning.best.values.items():
        line = f"  {name} = {with_unit(setting, numeric_key(name).unit)}"
        if key := KNOBS.get(name.removeprefix("drive.")):
            meant = with_unit(getattr(tuning.scene.drive, key), numeric_key(f"drive.{key}").unit, 4)
            line += f" ({key} {meant})"
        lines.append(line)
    if words := robustness(tuning):
        lines.append(f"  {words}")
    return "\n".join(lines)
