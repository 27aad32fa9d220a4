"""The files of `cosim show`: exact under zoom, words as text, nobody asked."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import cosim
from cosim.cli.main import main
from cosim.live.show import BLOCK, _comparison, _read, _table, show
from cosim.waveforms import formats
from cosim.waveforms.storage import netcdf
from tests.helpers.examples import examples

pytestmark = pytest.mark.usefixtures("undrawn")

MARKUP = "</script><img src=x onerror=alert(1)><b>bold</b>"
DRAWN = "() => document.readyState === 'complete'"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a scene whose own words are markup."""
    folder = tmp_path_factory.mktemp("results")
    scene = folder / "mine.toml"
    scene.write_text(f'base = "paper-limited"\ndescription = "{MARKUP}"\n', encoding="utf-8")
    settings = ["--set", "run.duration=0.3", "--set", "run.settle=0.1"]
    assert main(["run", str(scene), *settings, "--show", "--out", str(folder / "run")]) == 0
    return folder / "run"


def opened(tab: Any, path: Path) -> None:
    tab.goto(path.as_uri())
    tab.wait_for_function(DRAWN)
    tab.wait_for_timeout(100)
    assert not tab.faults
    assert tab.asked == [path.as_uri()]


def test_a_run(tab: Any, run: Path) -> None:
    """Every number is that of waveforms.nc, to the last bit."""
    opened(tab, run / "show.html")
    columns = formats.read(run).waveforms
    for place, (name, values) in enumerate(columns.items()):
        assert tab.evaluate("(k) => signals.columns[k].name", place) == name
        code = """(k) => Array.from({ length: signals.runs[0].count },
            (_, row) => signals.runs[0].value(k, row))"""
        assert tab.evaluate(code, place) == values.tolist()
    assert tab.inner_text("#about") == MARKUP
    assert tab.locator("img, b").count() == 0
    told = tab.inner_text("#words")
    notes = json.loads((run / "summary.json").read_text())["notes"]
    assert "mean velocity" in told and notes and all(note in told for note in notes)
    titles = tab.evaluate("() => signals.plots.map(({ plot }) => plot.name)")
    assert titles[0] == "V" and "sticking, 0 or 1" in titles
    assert tab.evaluate("() => document.documentElement.scrollWidth") <= 390

    # to a stretch, by drag; then a cursor, by key
    box = tab.locator("#signals canvas").first.bounding_box()
    tab.mouse.move(box["x"] + 100, box["y"] + 80)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 200, box["y"] + 80, steps=4)
    tab.mouse.up()
    begin, end = tab.evaluate("() => signals.view")
    share = 100 / (box["width"] - 62)
    assert end - begin == pytest.approx(share * 0.3, rel=0.05)
    before = tab.evaluate("() => signals.cursors.at[0]")
    tab.locator("#signals canvas").first.press("ArrowLeft")
    assert tab.evaluate("() => signals.cursors.at[0]") != before


def test_a_long_run_opens_at_its_last_periods(tab: Any, tmp_path: Path) -> None:
    """All of it is a button away."""
    settings = {"drive.frequency": 50.0, "run.duration": 1.0, "run.settle": 0.2}
    cosim.run("paper-limited", settings).save(tmp_path)
    show(tmp_path)
    opened(tab, tmp_path / "show.html")
    assert tab.evaluate("() => signals.view") == pytest.approx([0.8, 1.0])
    assert tab.evaluate("() => signals.cursors.at") == pytest.approx([0.85, 0.95])
    tab.get_by_role("button", name="All").click()
    assert tab.evaluate("() => signals.view") == pytest.approx([0.0, 1.0])


def test_many_rows(tab: Any, run: Path, tmp_path: Path) -> None:
    """Far out, lowest and highest of all rows in each column of pixels; close up, each row."""
    source, count = formats.read(run), 5 * BLOCK
    columns = {"time": 1e-5 * np.arange(count), "current": np.sin(np.arange(count) / 700.0)}
    columns["current"][[5, 77_777]] = 7.125, -3.0625
    for name in ("scene.toml", "summary.json"):
        shutil.copy(run / name, tmp_path / name)
    units = {"time": "s", "current": "A"}
    with open(tmp_path / "waveforms.nc", "wb") as file:
        netcdf(file, columns, units, dict(source.attributes))
    opened(tab, show(tmp_path))
    shape = """(view) => {
      const { low, high } = signals.runs[0].shape(1, 1, view, 300);
      return [[...low], [...high]];
    }"""
    whole = [0.0, 1e-5 * (count - 1)]
    low, high = np.array(tab.evaluate(shape, whole))
    assert (low.min(), high.max()) == (-3.0625, 7.125)
    assert (high.argmax(), low.argmin()) == (0, int(77_777 / (count - 1) * 300))
    close = [0.7, 0.9]
    low, high = np.array(tab.evaluate(shape, close))
    rows = np.flatnonzero((columns["time"] >= close[0]) & (columns["time"] < close[1]))
    places = ((columns["time"][rows] - 0.7) / 0.2 * 300).astype(int)
    for place in (0, 117, 299):
        own = columns["current"][rows[places == place]]
        assert low[place] == pytest.approx(own.min(), abs=2e-3)
        assert high[place] == pytest.approx(own.max(), abs=2e-3)


def test_a_sweep_with_its_families(tab: Any, tmp_path: Path) -> None:
    """A click on a point shows its run."""
    over = ["--over", "drive.amplitude=6,8", "--over", "drive.frequency=20,40"]
    settings = ["--set", "run.duration=0.3", "--set", "run.settle=0.1"]
    kept = ["--keep", "current,v_surface", "--show", "--out", str(tmp_path)]
    assert main(["sweep", "paper-limited", *over, *settings, *kept]) == 0
    opened(tab, tmp_path / "show.html")
    free = tab.evaluate("""() => [0, 1, 2, 3].map((k) => cloud.places(k)).flatMap(([x, y]) =>
        [x - LEFT, cloud.plot.right - x, y - cloud.plot.top, cloud.plot.bottom - y])""")
    assert min(free) >= 30  # pixels: half of the largest square
    assert "v_average, mm/s" in tab.inner_text("#cloud .scale")
    code = """([x, y]) => Array.from({ length: 4 }, (_, k) => k).find((k) =>
        cloud.columns.find(({ name }) => name === "frequency").values[k] === x &&
        cloud.columns.find(({ name }) => name === "amplitude").values[k] === y)"""
    point = tab.evaluate(code, [40, 6])
    left, top = tab.evaluate("(k) => cloud.places(k)", point)
    tab.locator("#cloud canvas").click(position={"x": left, "y": top})
    assert tab.evaluate("() => [cloud.chosen, signals.chosen]") == [point, point]
    changes = {"drive.amplitude": 6, "drive.frequency": 40}
    times = {"run.settle": 0.1, "run.duration": 0.3}
    expected = cosim.run("paper-limited", changes | times)
    later = expected.columns["time"] >= 0.1
    found = tab.evaluate("""() => { const run = signals.runs[signals.chosen];
        return Array.from({ length: run.count }, (_, row) => run.value(2, row)); }""")
    assert found == expected.columns["v_surface"][later].tolist()
    shown = f"{1e3 * expected.summary['v_average']:.4f}".replace("-", "−")[:5]
    assert shown in tab.inner_text("#cloud dl")


def test_a_comparison_and_a_chart(tab: Any, tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text(
        "time [s],v_surface_measured [m/s],v_surface_simulated [m/s]\n"
        "0,nan,0.5\n0.1,-0.25,0.125\n0.201,0.75,\n",  # a camera's rounded times are no even steps
        encoding="utf-8",
    )
    told = {"run": "paper", "trial": MARKUP, "drift_error": 0.125}
    (tmp_path / "compare.json").write_text(json.dumps(told), encoding="utf-8")
    rows = "name,value,unit,meaning\ndrift_error,0.125,m/s,less measured\n"
    (tmp_path / "compare.csv").write_text(rows, encoding="utf-8")
    opened(tab, show(tmp_path))
    values = "() => [1, 2].map((k) => [0, 1, 2].map((row) => signals.runs[0].value(k, row)))"
    assert tab.evaluate("() => signals.view") == [0.0, 0.201]
    found = np.array(tab.evaluate(values), dtype=float)
    np.testing.assert_array_equal(found, [[np.nan, -0.25, 0.75], [0.5, 0.125, np.nan]])
    assert tab.locator("img").count() == 0
    assert "drift_error [mm/s]: 125" in tab.inner_text("#words")
    assert "drag the cursors" in tab.inner_text("footer")

    table = tmp_path / "mine" / "table.csv"
    table.parent.mkdir()
    table.write_text(f'name,"size [mm]",gain\n{MARKUP},1,2\nb,3,4\n', encoding="utf-8")
    tab.asked.clear()
    opened(tab, show(table))
    assert tab.evaluate("() => cloud.ways.map(({ name, unit }) => name + unit)") == [
        *("sizemm", "gain", "sizemm"),
    ]
    assert tab.evaluate("() => cloud.chosen") == 1
    assert "Click on a point" in (how := tab.inner_text("footer")) and "cursors" not in how
    tab.locator("#cloud canvas").press("ArrowRight")
    assert MARKUP in tab.inner_text("#cloud dl") and tab.locator("img").count() == 0


def test_heights_of_a_comparison_are_from_the_first_that_was_measured(tmp_path: Path) -> None:
    """As in its figure: a camera's zero is not the machine's."""
    rows = "time [s],z_part_measured [m],z_part_simulated [m],v_part_measured [m/s]\n"
    rows += "0,nan,2,7\n1,5,3,nan\n2,5.25,3.5,9\n"
    (tmp_path / "frames.csv").write_text(rows, encoding="utf-8")
    shown, ((_, *columns),) = _comparison(tmp_path / "frames.csv")
    found = [[np.nan, 0.0, 0.25], [-1.0, 0.0, 0.5], [7.0, np.nan, 9.0]]
    np.testing.assert_array_equal(columns, found)
    assert [each["most"] for each in shown["signals"]["columns"]] == [0.0, 0.25, 1.0, 9.0]


def test_a_search_is_coloured_by_what_it_found(tmp_path: Path) -> None:
    """And not by its third knob, whose greatest value stood out as the best."""
    path = tmp_path / "tune.csv"
    path.write_text("a [V],b [Hz],c [1],v_average,failure\n1,2,3,4,\n1,2,9,,too hot\n")
    assert _table(path)[0]["cloud"]["ways"] == ["a", "b", "v_average"]
    path.write_text("a [V],v_average,failure\n1,4,\n2,,too hot\n")
    assert _table(path)[0]["cloud"]["ways"] == ["a", "v_average", "v_average"]


def test_a_table_opens_on_columns_of_one_unit_each(tmp_path: Path) -> None:
    """And not on one whose rows are in mm/s and in m/s², as their column `unit` says."""
    path = tmp_path / "limits.csv"
    rows = "1,23,mm/s,22,151,3\n1,151,m/s²,19,151,2\n"
    path.write_text(f"rig,value,unit,v [mm/s],a [m/s²],heat [W]\n{rows}", encoding="utf-8")
    assert _table(path)[0]["cloud"]["ways"] == ["v", "a", "heat"]


def test_columns_of_one_name_in_two_units_are_two(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "time [s],z [mm],z [m],v [m/s],,\n0,1,0.001,7,,\n1,2,0.002,8,,\n"
    path.write_text(rows, encoding="utf-8")
    shown, ((_, *columns),) = _table(path)
    assert [each["name"] for each in shown["signals"]["columns"]] == ["time", "z", "z [m]", "v"]
    assert [column.tolist() for column in columns] == [[1, 2], [0.001, 0.002], [7, 8]]


@pytest.mark.reliability
def test_of_two_results_in_a_folder_the_last_is_shown_and_exported(tmp_path: Path) -> None:
    """A sweep's own page was that of the run before it, and a run after a sweep was no run."""
    short = ["ideal-current", "--set", "run.duration=0.1", "--out", str(tmp_path), "--show"]
    for more, title, form in (
        (["run"], "ideal-current", "wav"),
        (["sweep", "--over", "drive.amplitude=6,8"], "Sweep of ideal-current", "csv"),
        (["run"], "ideal-current", "wav"),
    ):
        assert main([*more, *short]) == 0
        assert f'"title":"{title}"' in (tmp_path / "show.html").read_text(encoding="utf-8")
        assert main(["export", str(tmp_path), "--as", form]) == 0
    assert (tmp_path / "sweep.csv").exists() and (tmp_path / "surface.wav").exists()


def test_what_cannot_be_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "two").mkdir()
    for name in ("a.csv", "b.csv"):
        (tmp_path / "two" / name).write_text("x\n1\n", encoding="utf-8")
    (tmp_path / "words.csv").write_text("x\nword\n", encoding="utf-8")
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "sweep.nc").write_bytes(b"CDF\x02\x00\x00")
    (tmp_path / "short.csv").write_text("time [s],v [m/s]\n0,1\n1\n", encoding="utf-8")
    (tmp_path / "head.csv").write_text("time [s],v [m/s]\n", encoding="utf-8")
    (tmp_path / "gone.csv").write_text("time [s],v [m/s]\n0,1\n,2\n2,3\n", encoding="utf-8")
    (tmp_path / "twice.csv").write_text("time [s],z [m],z [m]\n0,1,2\n1,2,3\n", encoding="utf-8")
    (tmp_path / "blank.csv").write_text("\n;;\n;;\n", encoding="utf-8")
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "waveforms.nc").write_bytes(b"CDF\x01")
    for name, said in (
        ("empty", "there is no run, sweep or comparison in this folder.\n"),
        ("half/waveforms.nc", "this is no table; name the folder that it is in"),
        ("two", "name one of: a.csv, b.csv"),
        ("words.csv", "no column of numbers"),
        ("torn", "not a whole"),
        ("short.csv", "row 3: it has 1 cells, the header 2"),
        ("head.csv", "curves need two rows"),
        ("gone.csv", "row 3, column time"),
        ("twice.csv", "two columns are called z [m]"),
        ("blank.csv", "row 2: the header is empty"),
        ("half", "not a whole"),
        ("nothing", "nothing"),
    ):
        assert main(["show", str(tmp_path / name)]) == 2
        told = capsys.readouterr().err
        assert said in told and told.startswith("cosim: ") and told.count("\n") == 1
    assert not list(tmp_path.rglob("*.html"))


# --- what somebody has changed ---------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda each: st.lists(each, max_size=3) | st.dictionaries(st.text(max_size=3), each),
    max_leaves=4,
)


@examples(60)
@given(data=st.data())
def test_a_summary_that_somebody_has_changed(run: Path, data: st.DataObject) -> None:
    whole = json.loads((run / "summary.json").read_text())
    changed = whole | data.draw(st.dictionaries(st.sampled_from([*whole]), JSON, min_size=1))
    for name in data.draw(st.lists(st.sampled_from([*whole]), max_size=2)):
        changed.pop(name, None)
    with TemporaryDirectory() as place:
        folder = Path(place) / "run"
        shutil.copytree(run, folder)
        (folder / "summary.json").write_text(json.dumps(changed))
        assert main(["show", str(folder), "--out", str(folder / "page.html")]) in (0, 2)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    over = {"drive.amplitude": [3.0, 4.0], "drive.frequency": [20.0, 30.0]}
    cosim.sweep("paper-limited", over, {"run.duration": 0.1}, out=folder)
    return folder


CHANGES: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "other points": lambda data: data.assign(v_average=("other", np.zeros(5))),
    "no points": lambda data: data.drop_vars("failure").assign(failure=1.0),
    "an own axis": lambda data: data.drop_vars("amplitude").assign(amplitude=("x", np.zeros(5))),
    "numbers for a unit": lambda data: data.assign(
        v_average=data.v_average.assign_attrs(units=[1, 2])
    ),
    "no title": lambda data: data.assign_attrs(title=3.0),
    "no key": lambda data: data.assign_coords(amplitude=[3.0, 4.0], frequency=[20.0, 30.0]),
    "a number for a failure": lambda data: data.assign(failure=0.0 * data.v_average),
    "bytes": lambda data: data.assign(v_average=data.failure.astype("S1")),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_sweep_that_somebody_has_changed(
    sweep: Path, change: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "sweep.nc"
    data = xr.load_dataset(sweep / "sweep.nc", engine="scipy")
    CHANGES[change](data).to_netcdf(path, engine="scipy")
    assert main(["show", str(tmp_path)]) == 2
    assert main(["export", str(tmp_path), "--as", "csv"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and all(f"{path}: not a whole sweep (" in line for line in said)
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.nc"]


@pytest.mark.parametrize("frequency", ["twenty", "nan", None])
def test_points_that_are_not_the_sweeps(
    sweep: Path, frequency: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(sweep / "sweep.nc", tmp_path)
    (tmp_path / "points").mkdir()
    about = {} if frequency is None else {"frequency": frequency}
    with (tmp_path / "points" / "0.nc").open("wb") as file:
        netcdf(file, {"time": np.arange(3.0), "v": np.zeros(3)}, {"time": "s", "v": "m/s"}, about)
    assert main(["show", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert told == f"cosim: {tmp_path / 'points'}: these are not the sweep's own runs.\n"
    assert not list(tmp_path.glob("*.html"))


@pytest.mark.parametrize("taken", [None, 3, [], {"circuit.reltol": []}])
def test_steps_that_were_not_taken(run: Path, taken: Any, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    told = json.loads((run / "summary.json").read_text())
    told |= {"error_estimate": 1e-3, "coupling_taken": taken}
    (folder / "summary.json").write_text(json.dumps(told))
    assert main(["show", str(folder), "--out", str(tmp_path / "page.html")]) == 2


def test_a_waveform_whose_name_netcdf_cannot_have(tmp_path: Path) -> None:
    settings = {"circuit.save": ["v(d)/2", "-v(d)"], "run.duration": 0.02, "run.settle": 0.0}
    cosim.run("relay", settings).save(tmp_path)
    words = show(tmp_path).read_text(encoding="utf-8")
    assert "  v(d)/2  " in words and "  -v(d)  " in words


def test_no_impact_in_sight_is_not_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """1e9 s made the panel a flat line."""
    columns = {"time": np.arange(3.0), "rig.time_to_impact": np.array([1e9, 0.25, 1e9])}
    result = cosim.run("relay", {"run.duration": 0.02, "run.settle": 0.0})
    units = {"time": "s", "rig.time_to_impact": "s"}
    monkeypatch.setattr("cosim.live.show.table", lambda *of: "")
    replace(result, columns=columns, units=units).save(tmp_path)
    _, told = _read(tmp_path)[0]["signals"]["columns"]
    assert told["most"] == 0.25
