"""What a search leaves: every run, the best settings, and a sentence on how safe they are."""

import csv
import io
import json
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any

from cosim.errors import BadInput
from cosim.files.atomic import whole
from cosim.scene import to_toml
from cosim.scene.messages import plain
from cosim.scene.tables import KNOBS
from cosim.simulation.summary import UNITS
from cosim.studies.sweep.design import numeric_key
from cosim.studies.tune.run import TURNS, Run, Tuning


def write(folder: Path, tuning: Tuning, seed: int) -> dict[str, Any]:
    """Write ``tune.json``, ``tune.csv`` and ``best.toml``; gives what the first one holds."""
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
        "seed": seed,
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
    for name, text in (
        ("tune.json", json.dumps(_plain(numbers), indent=2) + "\n"),
        ("best.toml", to_toml(scene)),
    ):
        with whole(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return numbers


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
    with whole(path) as temporary:
        temporary.write_text(content.getvalue(), encoding="utf-8")


def robustness(tuning: Tuning) -> str:
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


def table(numbers: dict[str, Any]) -> str:
    """The best settings for a reader."""
    quantity, value = numbers["quantity"], numbers["value"]
    unit, scale = UNITS.get(quantity, ""), 1.0
    if unit == "m/s":
        unit, scale = "mm/s", 1e3
    ahead = f" ({numbers['scouts']} ahead without ngspice)" if numbers["scouts"] else ""
    lines = [
        f"{quantity} = {value * scale:.5g} {unit}".rstrip()
        + f" after {numbers['runs']} runs{ahead}, {numbers['failed']} failed, at"
    ]
    for name, setting in numbers["settings"].items():
        about = numeric_key(name, "--over").unit
        key = KNOBS.get(name.removeprefix("drive."))
        meant = ""
        if key is not None:
            meant = f" ({key} {numbers['drive'][key]:.4g} {numeric_key(f'drive.{key}', '').unit})"
        lines.append(f"  {name} = {setting:.6g}{'' if about == '1' else f' {about}'}{meant}")
    words = numbers["robustness"]
    return "\n".join([*lines, f"  {words}"] if words else lines)


def _plain(value: Any) -> Any:
    """Without what JSON has no word for."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, float) and not abs(value) < inf:
        return None
    return value
