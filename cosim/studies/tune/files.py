"""What a search leaves: every run, the best settings, and a sentence on how safe they are."""

import csv
import io
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any

from cosim.errors import BadInput
from cosim.files.atomic import write_json, write_text
from cosim.scene import to_toml
from cosim.scene.messages import plain
from cosim.scene.tables import KNOBS
from cosim.simulation.summary import UNITS
from cosim.studies.sweep.design import numeric_key
from cosim.studies.tune.found import TURNS, Run, Search


def write(folder: Path, tuning: Search) -> None:
    """Write ``tune.json``, ``tune.csv`` and ``best.toml``."""
    drive = tuning.scene.drive
    numbers = {
        "quantity": tuning.quantity,
        "largest": tuning.largest,
        "value": tuning.best.value,
        "settings": tuning.best.values,
        "drive": {
            "frequency": drive.frequency,
            "amplitude": drive.amplitude,
            "offset": drive.offset,
        },
        "ranges": tuning.ranges,
        "runs": len(tuning.runs),
        "failed": sum(run.value is None for run in tuning.runs),
        "seed": tuning.seed,
        "search": "Latin hypercube, then the cross-entropy method",
        "scouts": tuning.scouts,
        "turns": list(TURNS),
        "neighbours": tuning.neighbours,
        "robustness": robustness(tuning),
        "summary": tuning.best.outcome.numbers,
    }
    write_runs(folder / "tune.csv", tuning.runs, tuning.quantity)
    aim = f"{'largest' if tuning.largest else 'least'} {tuning.quantity}"
    found = {"name": f"{tuning.scene.name}-tuned"[:64], "description": f"Tuned for the {aim}"}
    scene = tuning.scene.model_copy(update=found)
    write_json(folder / "tune.json", _plain(numbers))
    write_text(folder / "best.toml", to_toml(scene))


def write_runs(path: Path, runs: Sequence[Run], quantity: str) -> None:
    """The runs in order: their settings (SI), the value asked for, and why one failed."""
    content = io.StringIO(newline="")
    table = csv.writer(content, lineterminator="\n")
    if runs:
        names = list(runs[0].values)
        units = [numeric_key(name, "--over").unit for name in names]
        heads = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
        table.writerow([*heads, quantity, "failure"])
    for run in runs:
        value = "" if run.value is None else repr(run.value)
        table.writerow([*map(repr, run.values.values()), value, run.outcome.failure])
    write_text(path, content.getvalue())


def robustness(tuning: Search) -> str:
    """What it costs to turn a key a little, in words."""
    best = tuning.best.value
    assert best is not None
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
    for text in over:
        name, _, ends = (part.strip() for part in text.partition("="))
        try:
            low, high = (float(end) for end in ends.split(":"))
        except ValueError:
            raise BadInput(f"--over {plain(text)}: must be table.key=low:high.") from None
        if name in ranges:
            raise BadInput(f"--over {plain(name)}: this key is given twice.")
        ranges[name] = (low, high)
    return ranges


def table(tuning: Search) -> str:
    """The best settings for a reader."""
    quantity, value = tuning.quantity, tuning.best.value
    assert value is not None
    unit, scale = UNITS.get(quantity, ""), 1.0
    if unit == "m/s":
        unit, scale = "mm/s", 1e3
    ahead = f" ({tuning.scouts} ahead without ngspice)" if tuning.scouts else ""
    failed = sum(run.value is None for run in tuning.runs)
    lines = [
        f"{quantity} = {value * scale:.5g} {unit}".rstrip()
        + f" after {len(tuning.runs)} runs{ahead}, {failed} failed, at"
    ]
    for name, setting in tuning.best.values.items():
        about = numeric_key(name, "--over").unit
        key = KNOBS.get(name.removeprefix("drive."))
        meant = ""
        if key is not None:
            unit = numeric_key(f"drive.{key}", "").unit
            meant = f" ({key} {getattr(tuning.scene.drive, key):.4g} {unit})"
        lines.append(f"  {name} = {setting:.6g}{'' if about == '1' else f' {about}'}{meant}")
    words = robustness(tuning)
    return "\n".join([*lines, f"  {words}"] if words else lines)


def _plain(value: Any) -> Any:
    """Without what JSON has no word for."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, float) and not abs(value) < inf:
        return None
    return value
