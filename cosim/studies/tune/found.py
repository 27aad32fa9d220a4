"""The result of a search: every run, the best settings, and a sentence on their robustness."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import BadInput, plain
from cosim.evaluate.keys import numeric_key, split
from cosim.evaluate.point import Number, Outcome
from cosim.files.atomic import write_json, write_text
from cosim.files.picture import Picture
from cosim.scene import Scene, to_toml
from cosim.scene.tables import COMMANDS, KNOBS
from cosim.search.turns import TURN
from cosim.studies.plots import headline
from cosim.studies.report import write_csv
from cosim.typed import typed
from cosim.waveforms.quantities import bench_unit, label, meaning, percent, with_unit
from cosim.waveforms.report import motion_in_words, of_the_start

COLORS = ("#1f6fb2", "#d1495b", "#2a9d8f", "#e9a03b", "#8d99ae", "#6a4c93")
_OF_WAVEFORM = re.compile(rf"best-({'|'.join(COMMANDS)})(-\d+)?")
"""The names of files with the best of other waveforms, such as ``best-steps-6``."""
MOST_KEYS = 4
"""The figure shows the settings of at most so many keys."""


@dataclass(frozen=True)
class Run:
    """One simulation of a search: its settings (SI), its summary, and the value asked for."""

    values: dict[str, Number]
    outcome: Outcome
    value: float | None


@dataclass(frozen=True)
class Aim:
    """The largest, or the least, value of a number of the summary within ranges of keys."""

    quantity: str
    largest: bool
    ranges: dict[str, tuple[float, float]]
    heat: float
    """Limit of the heat in a coil, W."""
    seed: int
    waveform: str
    """The family that is searched; empty for the scene's own waveform."""
    turned: int
    """How many of the keys, from the first on, are turned at each setting of a robust search, whose
    values are medians over the turns, or the worst if their signs differ; 0 without turns."""


@dataclass(frozen=True, repr=False)
class Tuning(Aim):
    """A finished search.

    ``neighbours`` gives for each key the values with this key turned by TURN of its range down and
    up from the best run, None beyond the end of the range or where the run failed. It is empty
    where such a turn became the best run itself and the budget had no runs left for its turns.
    """

    runs: list[Run]
    best: Run
    neighbours: dict[str, list[float | None]]
    scene: Scene
    """The scene at the best settings."""
    scouts: int
    """Number of preceding, cheaper runs on the rung "limited" or with the fast solver."""
    by_fast: float | None = None
    """The fast solver's value at the best run, where it searched; ``value`` is then the FMU's."""
    motion: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The summary's numbers on the kind of motion at the best settings. Where it is chaotic, the
    value is one sample of many."""
    others: tuple["Tuning", ...] = ()
    """The searches of the other waveforms, the best one first."""

    @property
    def failed(self) -> int:
        """How many runs have no value."""
        return sum(run.value is None for run in self.runs)

    @property
    def lost(self) -> float | None:
        """Greatest loss when one key is turned by TURN of its range either way.

        As a share of the best value; inf where such a run failed; None where there is none.
        """
        losses = []
        for key, values in self.neighbours.items():
            low, high = self.ranges[key]
            for turn, value in zip((-TURN, TURN), values, strict=True):
                # Beyond the end of the range nothing was run, and None is no failure.
                if low <= self.best.values[key] + turn * (high - low) <= high:
                    change = inf if value is None else self.value - value
                    losses.append(change if self.largest or value is None else -change)
        return max(losses) / (abs(self.value) or 1.0) if losses else None

    @property
    def value(self) -> float:
        """The value of the best run."""
        assert self.best.value is not None
        return self.best.value

    @property
    def robustness(self) -> str:
        """In words, the greatest loss of value when one key is turned by TURN of its range."""
        if not self.neighbours:
            return "the budget ended before its neighbours were run: a larger one may help"
        if (lost := self.lost) is None:
            return ""
        cost = "loses it altogether" if lost >= 1.0 else f"costs at most {percent(max(lost, 0.0))}"
        if lost == inf:
            cost = "leads to a run that fails or is too hot"
        return f"turning one key by {percent(TURN)} of its range {cost}"

    def plot(self) -> Picture:
        """The path of the search, which settings it ran, and what a small turn costs."""
        from matplotlib.ticker import MaxNLocator

        figure = Picture(13.0, 8.0, "constrained")
        rows: Any = figure.subfigures(2, 1)
        top, bottom = rows
        unit, scale = bench_unit(meaning(self.quantity)["units"])
        ylabel = label(self.quantity, unit)
        values = np.array([np.nan if run.value is None else run.value for run in self.runs]) * scale
        number = np.arange(1, len(values) + 1)

        path_axis, turn_axis = top.subplots(1, 2)
        path_axis.scatter(number, values, c=number, cmap="viridis", s=14)
        ranked = values if self.largest else -values
        so_far = np.fmax.accumulate(ranked)  # of the runs up to each, ignoring failed ones (NaN)
        path_axis.step(number, so_far if self.largest else -so_far, where="post", color="#d1495b")
        failed = number[~np.isfinite(values)]
        path_axis.plot(
            failed, np.full(len(failed), 0.02), "x", color="#d1495b", ms=6,
            transform=path_axis.get_xaxis_transform(),
        )  # fmt: skip
        path_axis.set(xlabel="run", ylabel=ylabel)
        lost = f"; {len(failed)} failed or too hot (×)" if len(failed) else ""
        path_axis.set_title(f"Every run, and the best so far{lost}", loc="left", fontsize=10.5)

        turns = 100 * np.array([-TURN, 0.0, TURN])
        styles = [(color, style) for style in ("-", "--", ":") for color in COLORS]
        for (key, row), (color, style) in zip(self.neighbours.items(), styles, strict=False):
            low, high = (np.nan if value is None else value * scale for value in row)
            heights = [low, self.value * scale, high]
            turn_axis.plot(turns, heights, color=color, ls=style, marker="o", ms=4, label=key)
        turned = "turned by [% of the key's range]"
        turn_axis.set(xlabel=turned, ylabel=ylabel, xlim=1.1 * turns[[0, -1]])
        turn_axis.set_title(self.robustness.capitalize(), loc="left", fontsize=10.5)
        if self.neighbours:
            turn_axis.axhline(self.value * scale, color="0.7", lw=0.9)
            turn_axis.legend(fontsize=8.5)
        else:
            turn_axis.set_axis_off()

        keys = list(self.ranges)[:MOST_KEYS]
        for axis, key in zip(np.atleast_1d(bottom.subplots(1, len(keys))), keys, strict=True):
            settings = [run.values[key] for run in self.runs]
            shown = axis.scatter(settings, values, c=number, cmap="viridis", s=14)
            axis.axvline(self.best.values[key], color="#d1495b", lw=0.9)
            axis.set(xlabel=label(key, numeric_key(key).unit), ylabel=ylabel)
            axis.xaxis.set_major_locator(MaxNLocator(6))
            if key == keys[-1]:
                bottom.colorbar(shown, ax=axis, label="run")
        for axis in figure.axes:
            if axis.get_label() != "<colorbar>":
                axis.grid(alpha=0.25)
        best = with_unit(self.value * scale, unit, 4)
        where = [
            f"{key} = {with_unit(value, numeric_key(key).unit, 4)}"
            for key, value in self.best.values.items()
        ]
        headline(
            figure,
            f"{self.scene.name}{self.waveform and f', {self.waveform}'}: "
            f"{'robust ' if self.turned else ''}{self.quantity} {best} at "
            f"{', '.join(where[:MOST_KEYS])}\n"
            f"{len(values)} runs" + (f", and {self.scouts} ahead, cheaper" if self.scouts else ""),
        )
        return figure

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``tune.json``, ``tune.csv``, ``best.toml`` and ``figure.png``; of each other
        waveform ``best-WAVEFORM.toml``."""
        out = Path(folder)
        drive, summary = self.scene.drive, self.best.outcome.numbers
        numbers = {
            "quantity": self.quantity,
            "largest": self.largest,
            "value": self.value,
            "settings": self.best.values,
            "drive": {name: getattr(drive, name) for name in ("frequency", "amplitude", "offset")},
            "ranges": self.ranges,
            "runs": len(self.runs),
            "failed": self.failed,
            "seed": self.seed,
            "search": "Sobol sequence, then CMA-ES",
            "scouts": self.scouts,
            "value_by_fast_solver": self.by_fast,
            "waveforms": {
                each.waveform: {"value": each.value, "settings": each.best.values}
                for each in (self, *self.others)
                if each.waveform
            },
            "robust": bool(self.turned),
            "heat_limit": self.heat if isfinite(self.heat) else None,
            "turns": [-TURN, TURN],
            "neighbours": self.neighbours,
            "robustness": self.robustness,
            **self.motion,
            "summary": {name: x if isfinite(x) else None for name, x in summary.items()},
        }
        write_runs(out / "tune.csv", self.runs, self.quantity)
        aim = f"{'largest' if self.largest else 'least'} {self.quantity}"
        found = {"name": f"{self.scene.name}-tuned"[:64], "description": f"Tuned for the {aim}"}
        write_json(out / "tune.json", numbers)
        for path in out.glob("best-*.toml"):
            if _OF_WAVEFORM.fullmatch(path.stem):  # of an earlier search
                path.unlink()
        for each in (self, *self.others):
            name = "best" if each is self else f"best-{each.waveform.replace(':', '-')}"
            tuned = each.scene.model_copy(update=found)
            write_text(out / f"{name}.toml", to_toml(tuned, folder=out))
        self.plot().write(out / "figure.png")

    def __repr__(self) -> str:
        """The best settings for a reader."""
        unit, scale = bench_unit(meaning(self.quantity)["units"])
        ahead = f" ({self.scouts} ahead, cheaper)" if self.scouts else ""
        value = with_unit(self.value * scale, unit, 5)
        lines = [
            f"{self.quantity} = {value} after {len(self.runs)} runs{ahead}, {self.failed} failed "
            "or too hot, at"
        ]
        if self.by_fast is not None:
            by_fast = with_unit(self.by_fast * scale, unit, 5)
            lines.append(f"  by the FMU; the fast solver, which searched, has {by_fast}")
        for name, setting in self.best.values.items():
            line = f"  {name} = {with_unit(setting, numeric_key(name).unit)}"
            if key := KNOBS.get(name.removeprefix("drive.")):
                meant, meant_unit = getattr(self.scene.drive, key), numeric_key(f"drive.{key}").unit
                line += f" ({key} {with_unit(meant, meant_unit, 4)})"
            lines.append(line)
        if words := self.robustness:
            lines.append(f"  {words}")
        if words := motion_in_words(self.motion):
            lines.append(f"  motion: {words}")
        if self.quantity == "v_average":
            early = of_the_start(self.scene, {**self.best.outcome.numbers, **self.motion})
            lines += [f"  {early}"] * bool(early)
        if self.turned:
            lines.append(
                f"  values are medians over the keys' turns by {percent(TURN)}, or the worst of "
                "them where their signs differ"
            )
        for each in (self, *self.others) if self.others else ():
            lines.append(f"  {each.waveform}: {with_unit(each.value * scale, unit, 4)}")
        return "\n".join(lines)


def write_runs(path: Path, runs: Sequence[Run], quantity: str) -> None:
    """The runs in order: their settings (SI), the value asked for, and why one failed."""
    if runs:
        names = dict.fromkeys(name for run in runs for name in run.values)
        heads = {name: f"{name} [{numeric_key(name).unit}]" for name in names}
        value = f"{quantity} [{meaning(quantity)['units']}]"
        rows = [
            {head: run.values.get(name) for name, head in heads.items()}
            | {value: run.value, "failure": run.outcome.failure}
            for run in runs
        ]
        write_csv(path, rows)


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
