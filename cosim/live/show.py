"""The page of `cosim show`: what a folder of results holds, as one HTML file to look into and mail.

A file begins with the page, its script and, of long runs, lowest and highest values of each
``BUCKET`` rows; so it is there before the rows, which follow in blocks that are read when one looks
closely.
"""

import json
import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files import reader
from cosim.files.atomic import whole
from cosim.files.cells import read_cells
from cosim.live.page import page, script_of
from cosim.scene import load
from cosim.waveforms import formats
from cosim.waveforms.report import table
from cosim.waveforms.storage import LARGEST

if TYPE_CHECKING:
    import xarray as xr

NAME = "show.html"
BLOCK = 1 << 15
BUCKET = 256
"""Rows."""

MOST_POINTS = 100_000
_PICTURE = 20_000_000  # bytes
_PER_PANEL = 4
_GROUPS = {
    "V": "voltage",
    "A": "current",
    "m": "height",
    "m/s": "velocity",
    "m/s2": "acceleration",
    "N": "force",
    "1": "state",
}
_HEAD = re.compile(r"(.+) \[(.+)\]")


@dataclass
class Shown:
    """What a page shows: rows of one run or of several, a table as a cloud of points, words."""

    title: str
    about: str = ""
    words: str = ""
    names: Sequence[str] = ()
    """Of the columns of each of the ``runs``; the first is what they go over."""
    units: Sequence[str] = ()
    runs: Sequence[Sequence[Array]] = ()
    frequencies: Sequence[float] = ()
    """Of the drives of a family, Hz."""
    panels: dict[str, list[str]] = field(default_factory=dict)
    cloud: dict[str, Any] | None = None
    pictures: dict[str, str] = field(default_factory=dict)


def show(results: Path, out: Path | None = None) -> Path:
    """Write the page of a folder that run, sweep, compare or a chart wrote, or of a chart's table,
    to ``out``, by default beside them. Raises BadInput."""
    path = out or (results if results.is_dir() else results.parent) / NAME
    shown = _read(results)
    code = script_of({"SHOWN": _as_json(shown)}, ("plot.js", "show.js"))
    with whole(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(page("show.html", code, "'none'"))
        for number, run in enumerate(shown.runs):
            for column, values in enumerate(run):
                if column == 0 and _step(values):
                    continue
                for k, start in enumerate(range(0, len(values), BLOCK)):
                    content = _coded(values[start : start + BLOCK])
                    head = f'<script type="text/plain" id="r{number}-{column}-{k}">'
                    file.write(f"{head}{content}</script>\n")
        file.write("</body>\n</html>\n")
    return path


def _read(results: Path) -> Shown:
    if (results / "waveforms.nc").exists():
        return _run(results)
    if (results / "sweep.nc").exists():
        return _sweep(results)
    if (results / "frames.csv").exists():
        return _comparison(results)
    tables = sorted(results.glob("*.csv")) if results.is_dir() else [results]
    if len(tables) != 1:
        which = f"one of {', '.join(path.name for path in tables)}" if tables else "another folder"
        raise BadInput(
            f"{plain(str(results))}: this holds no run, sweep or comparison; name {which}."
        )
    return _chart(tables[0])


def _run(folder: Path) -> Shown:
    run = formats.read(folder)
    scene = load(folder / "scene.toml")
    summary = _json(folder / "summary.json")
    names = list(run.waveforms)
    shown = Shown(scene.name, scene.description, table(scene, summary), names)
    shown.units = [run.units[name] for name in names]
    shown.runs = [[run.waveforms[name] for name in names]]
    shown.panels = _by_unit(names, shown.units)
    return shown


def _sweep(folder: Path) -> Shown:
    data = _dataset(folder / "sweep.nc")
    whole_grid = data["failure"]
    swept, dims = [str(n) for n in data.coords if "key" in data[n].attrs], whole_grid.dims
    if whole_grid.size > MOST_POINTS:
        raise BadInput(f"{plain(str(folder))}: a page shows at most {MOST_POINTS} points.")
    names = [*swept, *(str(n) for n in data.coords if n not in swept and n not in dims)]
    names += [str(name) for name in data.data_vars]
    columns = []
    for name in names:
        values = data[name].broadcast_like(whole_grid).transpose(*dims).values.ravel()
        about = data[name].attrs
        columns.append(
            _column(name, about.get("units", ""), about.get("long_name", ""), values.tolist())
        )
    best = "v_average" if "v_average" in data else str(next(iter(data.data_vars)))
    ways = [swept[0], swept[1] if len(swept) > 1 else best, best]
    failed = int((whole_grid != "").sum())
    shown = Shown(str(data.attrs["title"]), f"{whole_grid.size} points, {failed} failed")
    shown.cloud = {"columns": columns, "keys": swept[2:] if len(dims) > 1 else [], "ways": ways}
    if (folder / "families.nc").exists():
        kept = _dataset(folder / "families.nc")
        shown.names = ["time", *(str(n) for n in kept.data_vars if n not in ("time", "frequency"))]
        shown.units = [str(kept[name].attrs["units"]) for name in shown.names]
        counts = np.isfinite(kept.time.values).sum(axis=1)
        shown.runs = [
            [kept[name].values[k, :count] for name in shown.names] for k, count in enumerate(counts)
        ]
        shown.frequencies = kept.frequency.values.tolist()
        shown.panels = {name: [name] for name in shown.names[1:]}
        shown.cloud["family"] = kept.point.values.tolist()
    return shown


def _dataset(path: Path) -> "xr.Dataset":
    import xarray as xr

    try:
        return xr.load_dataset(BytesIO(reader.read(path, LARGEST)), engine="scipy")
    except (ValueError, TypeError, IndexError, KeyError, OSError) as error:
        raise BadInput(f"{plain(str(path))}: this is not a whole netCDF ({error}).") from None


def _comparison(folder: Path) -> Shown:
    cells = read_cells(folder / "frames.csv")
    names, units = _heads(cells.rows[0][1])
    columns = [cells.numbers(1, k, name, {"nan", ""}) for k, name in enumerate(names)]
    told = _json(folder / "compare.json")
    shown = Shown(f"{told['run']} against {told['trial']}", names=names, units=units)
    shown.runs = [columns]
    shown.words = "\n".join(f"{name}: {value}" for name, value in told.items())
    for name in names[1:]:
        shown.panels.setdefault(name.rpartition("_")[0], []).append(name)
    return shown


def _chart(path: Path) -> Shown:
    cells = read_cells(path)
    names, units = _heads(cells.rows[0][1])
    columns = []
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        texts = [row[k] if k < len(row) else "" for _, row in cells.rows[1:]]
        columns.append(_column(name, unit, "", _numbers(texts)))
    numeric = [column["name"] for column in columns if column["most"] is not None]
    if not numeric:
        raise BadInput(f"{plain(str(path))}: this table has no column of numbers.")
    ways = [numeric[min(k, len(numeric) - 1)] for k in range(3)]
    shown = Shown(path.stem, cloud={"columns": columns, "keys": [], "ways": ways})
    page_of = path.with_suffix(".md")
    if page_of.exists():
        shown.words = reader.read(page_of, _PICTURE).decode("utf-8", "replace")
    for picture in sorted(path.parent.glob("*.png")):
        if picture.stem == path.stem or picture.stem.startswith(f"{path.stem}-"):
            content = b64encode(reader.read(picture, _PICTURE)).decode()
            shown.pictures[picture.name] = content
    return shown


def _json(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(reader.read(path, _PICTURE))
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise BadInput(f"{plain(str(path))}: this is no whole JSON file.")
    return found


def _heads(cells: Iterable[str]) -> tuple[list[str], list[str]]:
    """Names and units of a header."""
    found = [_HEAD.fullmatch(cell) for cell in cells]
    pairs = [
        (match[1], match[2]) if match else (cell, "")
        for match, cell in zip(found, cells, strict=True)
    ]
    return [name for name, _ in pairs], [unit for _, unit in pairs]


def _numbers(texts: list[str]) -> list[Any]:
    """Numbers where all that is there is one."""
    try:
        return [float(text) if text else None for text in texts]
    except ValueError:
        return list(texts)


def _column(name: str, unit: str, text: str, values: list[Any]) -> dict[str, Any]:
    """A column of a cloud; ``most`` is None where it has words."""
    numbers = [abs(v) for v in values if isinstance(v, int | float) and isfinite(v)]
    words = any(isinstance(v, str) for v in values)
    values = [v if isinstance(v, str) or (v is not None and isfinite(v)) else None for v in values]
    most = None if words or not numbers else max(numbers)
    return {"name": name, "unit": unit, "text": text, "values": values, "most": most}


def _by_unit(names: Sequence[str], units: Sequence[str]) -> dict[str, list[str]]:
    """Panels of the columns but the first; a few of one unit in each."""
    found: dict[str, list[str]] = {}
    for name, unit in [*zip(names, units, strict=True)][1:]:
        group, count = _GROUPS.get(unit, unit), 1
        while len(found.get(group, ())) == _PER_PANEL:
            count += 1
            group = f"{_GROUPS.get(unit, unit)} {count}"
        found.setdefault(group, []).append(name)
    return found


def _as_json(shown: Shown) -> dict[str, Any]:
    found: dict[str, Any] = {"block": BLOCK, "bucket": BUCKET, "signals": None, "cloud": None}
    found |= {name: getattr(shown, name) for name in ("title", "about", "words", "pictures")}
    if shown.cloud is not None:
        count = len(shown.cloud["columns"][0]["values"])
        found["cloud"] = {"family": None, "count": count} | shown.cloud
    if shown.runs:
        place = {name: k for k, name in enumerate(shown.names)}
        columns = [
            {"name": name, "unit": unit, "most": max(_most(run[k]) for run in shown.runs)}
            for k, (name, unit) in enumerate(zip(shown.names, shown.units, strict=True))
        ]
        found["signals"] = {
            "x": f"{shown.names[0]}, {shown.units[0]}",
            "columns": columns,
            "panels": [
                {"name": name, "columns": [place[column] for column in group]}
                for name, group in shown.panels.items()
            ],
            "runs": [_head(run) for run in shown.runs],
        }
        for run, frequency in zip(found["signals"]["runs"], shown.frequencies, strict=False):
            run["frequency"] = frequency
    return found


def _head(run: Sequence[Array]) -> dict[str, Any]:
    """What is there before the rows."""
    count, step = len(run[0]), _step(run[0])
    found: dict[str, Any] = {"count": count, "begin": float(run[0][0]), "step": step}
    if count > 4 * BLOCK:
        starts = np.arange(0, count, BUCKET)
        ends = [(np.fmin.reduceat(x, starts), np.fmax.reduceat(x, starts)) for x in run]
        found["peaks"] = [_coded(np.stack(pair, axis=1)) for pair in ends]
    return found


def _step(time: Array) -> float | None:
    """The step of even rows; None where they are not."""
    step = float(time[-1] - time[0]) / max(1, len(time) - 1)
    even = np.abs(time - (time[0] + step * np.arange(len(time)))) <= 1e-6 * step
    return step if step > 0.0 and even.all() else None


def _most(values: Array) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else 0.0


def _coded(values: Array) -> str:
    return b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
