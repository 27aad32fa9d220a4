"""The page of `cosim show`: a folder of results as one HTML file to look into and mail.

The file begins with the page, its script and, for long runs, the lowest and highest value in each
``BUCKET`` rows, so that a browser can draw before it has read the rows, which follow in blocks.
"""

import json
import re
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from csv import DictReader
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array, drawable
from cosim.errors import BadInput, plain
from cosim.files import reader
from cosim.files.atomic import tidy, whole
from cosim.files.cells import read_cells
from cosim.live.page import page, script_of
from cosim.scene import load
from cosim.waveforms import formats
from cosim.waveforms.quantities import bench_unit, label
from cosim.waveforms.report import table
from cosim.waveforms.storage import LARGEST, last_written, read_netcdf, read_sweep, swept

BLOCK = 1 << 15
BUCKET = 256
"""Rows."""

PERIODS = 10
"""A run of more than twice as many opens at so many, its last ones: far more are a mere band."""

MOST_POINTS = 100_000  # of a sweep
_HEAD = re.compile(r"(.+) \[(.+)\]")  # name [unit]

Run = list[Array]
"""Columns; the first is the abscissa."""


def show(results: Path, out: Path | None = None) -> Path:
    """Write the page of a folder that run, sweep, compare or a chart wrote (of several the last),
    or of a chart's table, to ``out``, by default beside them. Raises BadInput."""
    path = out or (results if results.is_dir() else results.parent) / "show.html"
    shown, runs = _read(results)
    given = {"title": results.name, "about": "", "words": "", "pictures": {}, "cloud": None}
    given |= {"signals": None, "block": BLOCK, "bucket": BUCKET} | shown
    code = script_of({"SHOWN": given}, ("plot.js", "show.js"))
    tidy(path.parent)
    with whole(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(page("show.html", code, "'none'"))
        for number, run in enumerate(runs):
            for column, values in enumerate(run):
                for k, start in enumerate(range(0, len(values), BLOCK)):
                    head = f'<script type="text/plain" id="r{number}-{column}-{k}">'
                    file.write(f"{head}{_coded(values[start : start + BLOCK])}</script>\n")
        file.write("</body>\n</html>\n")
    return path


def _read(results: Path) -> tuple[dict[str, Any], list[Run]]:
    """The data of the page's script, and the runs whose rows follow it."""
    last = last_written(results, "waveforms.nc", "sweep.nc", "compare.json")
    if last == "waveforms.nc":
        found, scene = formats.read(results), load(results / "scene.toml")
        runs = [[drawable(x, found.units[name]) for name, x in found.waveforms.items()]]
        with _whole_results(results / "summary.json") as summary:
            words = "\n\n".join([table(scene, summary, found.units), *summary.get("notes", [])])
        told = {"title": scene.name, "about": scene.description, "words": words}
        signals = _signals(found.units, runs)
        periods = float(np.ptp(runs[0][0])) / scene.period
        if periods > 2 * PERIODS:
            signals["opens"] = -PERIODS / periods
        return told | {"signals": signals}, runs
    if last == "sweep.nc":
        return _sweep(results)
    if last == "compare.json":
        shown, runs = _comparison(results / "frames.csv")
        rows = DictReader(reader.read(results / "compare.csv", LARGEST).decode().splitlines())
        units = {row.get("name"): row.get("unit") or "" for row in rows}
        with _whole_results(results / "compare.json") as told:
            lines = []
            for name, value in told.items():
                unit, scale = bench_unit(units.get(name, ""))
                if unit and not (value is None or isinstance(value, dict | list)):
                    lines.append(f"{label(name, unit)}: {value * scale:.6g}")
                elif not isinstance(value, dict | list):
                    lines.append(f"{name}: {value}")
            shown["words"] = "\n".join([*lines, *map(str, told.get("notes", []))])
            shown["title"] = f"{told.get('run')} against {told.get('trial')}"
        return shown, runs
    tables = sorted(results.glob("*.csv")) if results.is_dir() else [results]
    if len(tables) != 1:
        names = f"; name one of: {', '.join(path.name for path in tables)}" if tables else ""
        where = f"{plain(results)}: there is no run, sweep or comparison in this folder"
        raise BadInput(f"{where}{names}.")
    if results.suffix in (".nc", ".json", ".toml"):
        raise BadInput(f"{plain(results)}: this is no table; name the folder that it is in.")
    return _table(tables[0])


def _sweep(folder: Path) -> tuple[dict[str, Any], list[Run]]:
    """A cloud of a sweep's points, and the curves of those whose waveforms were saved."""
    data = read_sweep(folder)
    grid, path = data["failure"], folder / "sweep.nc"
    axes = swept(data)
    if grid.size > MOST_POINTS:
        raise BadInput(f"{plain(path)}: a page shows at most {MOST_POINTS} points.")
    columns = []
    others = sorted(str(name) for name in {*data.coords} - {*axes, *grid.dims})
    for name in [*axes, *others, *data.data_vars]:
        values = data[name].broadcast_like(grid).transpose(*grid.dims).values.ravel()
        unit, text = (data[name].attrs.get(key, "") for key in ("units", "long_name"))
        columns.append(_column(str(name), unit, values.tolist(), text))
    numbers = [each["name"] for each in columns[len(axes) :] if each["most"] is not None]
    if not numbers:
        raise BadInput(f"{plain(path)}: no point of this sweep has a number.")
    best = "v_average" if "v_average" in numbers else numbers[0]
    ways = [axes[1], axes[0], best] if len(axes) > 1 else [axes[0], best, best]  # as the figure
    axes = axes if grid.ndim > 1 else []
    cloud = {"columns": columns, "keys": axes[2:], "ways": ways, "grid": axes}
    shown = {"title": data.attrs["title"], "cloud": cloud | {"count": grid.size, "family": None}}
    points = sorted(int(p.stem) for p in (folder / "points").glob("*.nc") if p.stem.isdecimal())
    if not points:
        return shown, []
    kept = [read_netcdf(folder / "points" / f"{number}.nc") for number in points]
    try:
        frequencies = [float(about["frequency"]) for _, _, about in kept]
    except (KeyError, ValueError):
        frequencies = [nan]
    alike = all(units == kept[0][1] for _, units, _ in kept)
    if not (alike and points[-1] < grid.size and all(map(isfinite, frequencies))):
        raise BadInput(f"{plain(folder / 'points')}: these are not the sweep's own runs.")
    runs = [[*columns.values()] for columns, _, _ in kept]
    shown["signals"] = _signals(kept[0][1], runs)
    for run, frequency in zip(shown["signals"]["runs"], frequencies, strict=True):
        run["frequency"] = frequency
    shown["cloud"]["family"] = points
    return shown, runs


def _table(path: Path) -> tuple[dict[str, Any], list[Run]]:
    """Curves of a table whose first column is time; else a cloud, and a chart's pictures."""
    cells = read_cells(path)
    header, heads = [*cells.rows[0][1]], {}
    if not any(header):
        raise BadInput(f"{cells.name}: row {cells.rows[0][0]}: the header is empty.")
    cells.even(1)
    while not header[-1]:  # a separator too many
        header.pop()
    for cell in header:
        if header.count(cell) > 1:
            raise BadInput(f"{cells.name}: two columns are called {plain(cell, 40)}.")
        match = _HEAD.fullmatch(cell)
        name, unit = (match[1], match[2]) if match else (cell, "")
        heads[cell if name in heads else name] = unit
    if next(iter(heads)) == "time":
        if len(cells.rows) < 3:
            raise BadInput(f"{cells.name}: curves need two rows at least.")
        missing = [set(), *[{"nan", ""}] * (len(heads) - 1)]
        runs = [[cells.numbers(1, k, *of) for k, of in enumerate(zip(heads, missing, strict=True))]]
        return {"title": path.stem, "signals": _signals(heads, runs)}, runs
    columns = []
    for k, (name, unit) in enumerate(heads.items()):
        values = [row[k] if k < len(row) else "" for _, row in cells.rows[1:]]
        try:
            columns.append(_column(name, unit, [float(v) if v else None for v in values]))
        except ValueError:
            columns.append(_column(name, unit, values))
    ways = [column["name"] for column in columns if column["most"] is not None]
    if not ways:
        raise BadInput(f"{plain(path)}: this table has no column of numbers.")
    if "failure" in heads:  # of a search: its keys, then what it found, which is the colour
        ways = [*ways[:2], ways[-1]]
    if "unit" in heads:  # one for each row, so columns without one of their own mix units
        ways.sort(key=lambda name: not heads[name])
    cloud = {"columns": columns, "keys": [], "ways": (ways * 3)[:3], "family": None, "grid": []}
    cloud["count"] = len(cells.rows) - 1
    pictures = [p for p in path.parent.glob("*.png") if f"{p.stem}-".startswith(f"{path.stem}-")]
    content = {p.name: b64encode(reader.read(p, LARGEST)).decode() for p in sorted(pictures)}
    return {"title": path.stem, "cloud": cloud, "pictures": content}, []


def _comparison(path: Path) -> tuple[dict[str, Any], list[Run]]:
    """Curves of a comparison's frames. As in its figure, heights count from the first frame that
    was measured, since a camera's zero is not the machine's."""
    shown, runs = _table(path)
    ((time, *curves),) = runs
    units = {column["name"]: column["unit"] for column in shown["signals"]["columns"]}
    found = dict(zip(units, [time, *curves], strict=True))
    for name, values in found.items():
        if units[name] == "m":
            known = np.isfinite(found[name.replace("_simulated", "_measured")])
            found[name] = values - values[np.argmax(known)]
    runs = [[*found.values()]]
    about = "heights from the first that was measured" if "m" in units.values() else ""
    return {"about": about, "signals": _signals(units, runs)}, runs


@contextmanager
def _whole_results(path: Path) -> Iterator[dict[str, Any]]:
    """The content of a file of results. Raises BadInput where it, or an access to it within the
    context, shows that it is not such a file."""
    try:
        yield dict(json.loads(reader.read(path, LARGEST)))
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError):
        raise BadInput(f"{plain(path)}: this is no whole file of results.") from None


def _column(name: str, unit: str, values: list[Any], text: str = "") -> dict[str, Any]:
    """A column of a cloud; ``most``, its largest magnitude, is None for a column of words."""
    finite = [v if isinstance(v, str) or (v is not None and isfinite(v)) else None for v in values]
    known = [v for v in finite if v is not None]
    words = not known or any(isinstance(v, str) for v in known)
    most = None if words else max(abs(float(v)) for v in known)
    return {"name": name, "unit": unit, "text": text, "values": finite, "most": most}


def _signals(units: dict[str, str], runs: list[Run]) -> dict[str, Any]:
    """Data on the runs' columns, which precede the rows; columns of one unit share a panel."""
    (x, unit), *others = units.items()
    panels: dict[str, list[int]] = {}
    columns = [{"name": x, "unit": unit, "most": 0.0}]
    for k, (name, unit) in enumerate(others, 1):
        if unit == "1" and all(np.isin(run[k], (0.0, 1.0)).all() for run in runs):
            unit = "0 or 1"
        panels.setdefault(unit, []).append(k)
        most = max(float(np.nanmax(np.abs(run[k]), initial=0.0)) for run in runs)
        columns.append({"name": name, "unit": unit, "most": most})
    heads = [_head(run) for run in runs]
    opens = 1.0 if len(runs) == 1 else 0.15
    return {"columns": columns, "panels": [*panels.values()], "runs": heads, "opens": opens}


def _head(run: Run) -> dict[str, Any]:
    time, count = run[0], len(run[0])
    step = float(time[-1] - time[0]) / max(1, count - 1)
    # Rows at even times, as most runs have them, need no times on the page: two ends suffice.
    even = np.abs(time - (time[0] + step * np.arange(count))) <= 1e-6 * step
    # Without a step the page takes the times from the rows, which it reads later.
    ends = {"begin": float(time[0]), "end": float(time[-1])}
    found = ends | {"count": count, "step": step if even.all() else None}
    if count > 4 * BLOCK:
        # Neighbouring least and greatest values cover the same pixels as all rows between them.
        starts = np.arange(0, count, BUCKET)
        pairs = [(np.fmin.reduceat(x, starts), np.fmax.reduceat(x, starts)) for x in run]
        found["peaks"] = [_coded(np.stack(pair, axis=1)) for pair in pairs]
    return found


def _coded(values: Array) -> str:
    return b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
