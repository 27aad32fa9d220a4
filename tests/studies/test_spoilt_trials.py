"""Trials that are written wrong: each is refused, or what is wrong is told; none is only scored.

The truth is a run's own trial, film and all: an unspoilt one scores R² 1 and is told nothing.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import cosim
from cosim.cli.main import main
from cosim.trials.camera import hermite

pytestmark = pytest.mark.usefixtures("undrawn")

Array = npt.NDArray[np.float64]
HEADER = "time [s],surface [mm],part [mm]"
FRAMES = np.arange(300) / 960.0


@pytest.fixture(scope="module")
def run() -> cosim.Result:
    """A run that repeats, with impacts, at 20 Hz, and moves the part."""
    settings = {"circuit.model": "ideal", "run.duration": 0.8, "run.settle": 0.3}
    return cosim.run("reference", settings)


def table(run: cosim.Result, time: Array = FRAMES) -> list[Array]:
    """Times (s) and heights of surface and part (mm), with a camera's noise of 2 µm."""
    noise = np.random.default_rng(1).normal(0.0, 2e-3, (2, len(time)))
    bodies = ("surface", "part")
    z = [
        hermite(0.3125 + time, *(run.columns[c] for c in ("time", f"z_{body}", f"v_{body}")))
        for body in bodies
    ]
    return [time, *(1e3 * one + more for one, more in zip(z, noise, strict=True))]


def write(path: Path, header: str, columns: list[Array]) -> Path:
    rows = [
        ",".join("" if np.isnan(x) else f"{x:.9g}" for x in row)
        for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


Spoil = Callable[[list[Array]], list[Array]]


def scaled(time: float = 1.0, surface: float = 1.0, part: float = 1.0) -> Spoil:
    factors = time, surface, part
    return lambda columns: [f * c for f, c in zip(factors, columns, strict=True)]


def same(columns: list[Array]) -> list[Array]:
    return columns


def without(rows: slice, of: int) -> Spoil:
    """Empty cells of a column."""

    def spoil(columns: list[Array]) -> list[Array]:
        columns = [c.copy() for c in columns]
        columns[of][rows] = np.nan
        return columns

    return spoil


REFUSED = {
    "no units": ("time,surface,part", same, "what time, surface, part is, or its unit"),
    "letters without units": ("t,zs,zp", same, "what t, zs, zp is, or its unit, is not clear"),
    "letters that mean two things": ("t [s],zs [mm],zp [mm]", same, "what zs [mm], zp [mm] is"),
    "the platform or the part": ("t [s],zp [mm],x", same, "what zp [mm] is"),
    "one unit forgotten": ("time [s],surface [mm],part", same, "what part is, or its unit"),
    "the time's unit forgotten": ("time,surface [mm],part [mm]", same, "what time is, or its"),
    "published letters without units": ("t,zp,zo", same, "what t, zp, zo is, or its unit"),
    "a unit of another kind": ("time [s],surface [mm/s],part [mm]", same, "the unit mm/s is not m"),
    "an unknown unit": ("time [s],surface [inch],part [mm]", same, "the unit inch is not m"),
    "an unknown time": ("Zeit [s],surface [mm],part [mm]", same, "which column is the time is not"),
    "one body twice": ("time [s],surface [mm],height [mm]", same, "are the same column"),
    "times in ms as s": (
        HEADER,
        scaled(time=1e3),
        "0.96 rows/s are too few for a run that repeats",
    ),
    "times without end": (HEADER, scaled(time=1e-300), "is the time's unit right?"),
    "times that go back": (HEADER, lambda c: [c[0][::-1], *c[1:]], "the time does not increase"),
    "a missing time": (HEADER, without(slice(7, 8), 0), "row 9, column time [s]: the value is"),
}


@pytest.mark.parametrize("spoilt", REFUSED)
def test_what_is_not_clear_is_refused(spoilt: str, run: cosim.Result, tmp_path: Path) -> None:
    header, spoil, words = REFUSED[spoilt]
    file = write(tmp_path / "a.csv", header, spoil(table(run)))
    with pytest.raises(cosim.BadInput) as caught:
        cosim.compare(run, file)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def beside_velocities(columns: list[Array]) -> list[Array]:
    time, *heights = columns
    return [time, *(1e3 * z for z in heights), *(np.gradient(z, time) for z in heights)]


def with_rows(rows: slice, of: int, value: float) -> Spoil:
    """A value in the place of what was measured there."""

    def spoil(columns: list[Array]) -> list[Array]:
        columns = [c.copy() for c in columns]
        columns[of][rows] = value
        return columns

    return spoil


def mixed_up(columns: list[Array]) -> list[Array]:
    """The marks of surface and part exchanged from the middle on."""
    time, surface, part = columns
    late = time > time[150]
    return [time, np.where(late, part, surface), np.where(late, surface, part)]


EXCHANGED = "the columns of surface and part exchanged"
TOLD = {
    "mm as m": (HEADER.replace("mm", "m"), same, ["surface [m] times 0.001", "part [m] times"]),
    "µm as mm": (HEADER, scaled(1, 1e3, 1e3), ["surface [mm] times 0.001", "part [mm] times"]),
    "cm as mm": (HEADER, scaled(1, 0.1, 0.1), ["surface [mm] times 10:", "part [mm] times 10:"]),
    "inches as mm": (HEADER, scaled(1, 1 / 25.4, 1 / 25.4), ["surface [mm] times 25.4: is it in"]),
    "m as mm": (HEADER, scaled(1, 1e-3, 1e-3), ["surface [mm] times 1000", "part [mm] times"]),
    "the part alone in m": (HEADER, scaled(part=1e-3), ["part [mm] times 1000: is it in mm"]),
    "the part alone in cm": (HEADER, scaled(part=0.1), ["column part [mm] times 10: is it in mm"]),
    "up is negative": (HEADER, scaled(1, -1, -1), ["surface [mm] times -1: is its"]),
    "µm as mm beside velocities": (
        *(HEADER + ",v_surface [mm/s],v_part [mm/s]", beside_velocities),
        ["column surface [mm] times 0.001: is it in mm", "column part [mm] times 0.001: is it in"],
    ),
    "the part downwards": (HEADER, scaled(part=-1), ["part [mm] times -1: is its"]),
    "µm downwards": (HEADER, scaled(1, -1e3, -1e3), ["surface [mm] times -0.001: is it in mm and"]),
    "exchanged": (HEADER, lambda c: [c[0], c[2], c[1]], [EXCHANGED]),
    "a clock 1 % fast": (HEADER, scaled(time=1 / 1.01), ["times multiplied by 1.010"]),
    "a clock 0.5 % slow": (HEADER, scaled(time=1 / 0.995), ["times multiplied by 0.99"]),
    "a rate of 1000 for 960": (HEADER, scaled(time=0.96), ["the recording repeats at 20.8"]),
    "times ten times as long": (HEADER, scaled(time=10), ["with times multiplied by 0.1 they"]),
    "s as ms": (HEADER.replace("[s]", "[ms]"), same, ["is the time's unit right?"]),
    "empty cells": (HEADER, without(slice(40, 45), 2), ["part [mm], in mm, 5 missing"]),
    "an empty first cell": (HEADER, without(slice(0, 1), 1), ["surface [mm], in mm, 1 missing"]),
    "dropped frames": (
        *(HEADER, lambda c: [np.delete(x, [50, 51, 52, 120]) for x in c]),
        ["Gaps in time: 2, the longest of 4.17 ms"],
    ),
    "no times": ("surface [mm],part [mm]", lambda c: c[1:], ["No time column: read at 960"]),
    "zeros for lost frames": (HEADER, with_rows(slice(100, 110), 2, 0.0), ["part [mm] jumps 2"]),
    "two wild values": (HEADER, with_rows(slice(50, 200, 80), 1, 9.0), ["surface [mm] jumps 4"]),
    "mixed up midway": (HEADER, mixed_up, ["surface [mm] jumps once", "part [mm] jumps once"]),
    "doubled frames": (
        *(HEADER, lambda c: [c[0], *(z[np.arange(300) // 2 * 2] for z in c[1:])]),
        ["150 of 300 rows repeat the heights of the row before"],
    ),
    "out of the picture": (
        *(HEADER, lambda c: [c[0], np.minimum(c[1], np.quantile(c[1], 0.8)), c[2]]),
        ["surface [mm] has its greatest value, -0.35", "in 60 of 300 rows"],
    ),
    "rounded heights": (
        *(HEADER, lambda c: [c[0], *(np.round(4.0 * z) / 4.0 for z in c[1:])]),
        ["surface [mm] has 4 different values", "part [mm] has 16 different"],
    ),
    "rounded times": (
        *(HEADER, lambda c: [np.round(2.0 * c[0], 3), *c[1:]]),
        ["Rows are 2 to 3 ms apart: if these times are rounded"],
    ),
    "one body's heights twice": (HEADER, lambda c: [*c[:2], c[1]], ["hold the same values"]),
    "the part seen from the surface": (
        *(HEADER, lambda c: [*c[:2], c[2] - c[1]]),
        ["with the surface's height added to it: is it measured from the surface?"],
    ),
    "velocities as heights": (
        *(HEADER, lambda c: [c[0], *(np.gradient(z, c[0]) for z in c[1:])]),
        ["column surface [mm] would agree much better", "as a velocity, in mm/s: is it one?"],
    ),
    "the surface 4 rows late": (
        *(HEADER, lambda c: [c[0][4:], c[1][:-4], c[2][4:]]),
        ["height of the part would agree", "4 rows later: were both filmed at once?"],
    ),
    "a film played backwards": (
        *(HEADER, lambda c: [c[0], *(z[::-1] for z in c[1:])]),
        ["hardly explains the recording's velocity of the surface (R² -0.03)", "of the part (R² -"],
    ),
    "a mark that does not move": (
        *(HEADER, lambda c: [c[0], np.random.default_rng(3).normal(0.0, 2e-3, 300), c[2]]),
        ["hardly explains the recording's velocity of the surface", "what was to be tracked?"],
    ),
    "the part's mark lost midway": (
        *(HEADER, lambda c: [c[0], c[1], np.where(np.arange(300) < 150, c[2], c[2][150])]),
        ["hardly explains the recording's velocity of the part"],
    ),
    "heights smoothed over 15 frames": (
        *(HEADER, lambda c: [c[0], *(np.convolve(z, np.full(15, 1 / 15), "same") for z in c[1:])]),
        ["hardly explains the recording's velocity of the surface"],
    ),
    "a column of something else": (
        *(HEADER + ",foo", lambda c: [*c, c[0]]),
        ["Left out, not understood: foo."],
    ),
}  # fmt: skip


@pytest.mark.parametrize("spoilt", TOLD)
def test_what_may_be_wrong_is_told(spoilt: str, run: cosim.Result, tmp_path: Path) -> None:
    header, spoil, words = TOLD[spoilt]
    columns = spoil(table(run))
    span = columns[0][-1] if "time [s]" in header else 0.0
    if span > 0.45:
        run = cosim.run(run.scene, {"run.duration": 0.5 + float(span)})
    compared = cosim.compare(run, write(tmp_path / "a.csv", header, columns))
    for sentence in words:
        assert sentence in repr(compared)
    numbers = compared.numbers
    if "cell" in spoilt or spoilt == "dropped frames":  # what is missing spoils nothing
        assert numbers["velocity_r2"] == pytest.approx(1.0, abs=0.01)
        assert numbers["mean_error_mm"] == pytest.approx(0.0, abs=0.01)
        assert numbers["drift_simulated"] == pytest.approx(numbers["drift_measured"], rel=0.02)


def every(n: int, first: int = 0) -> Spoil:
    """Nothing of the part but every ``n``-th row; nothing of the surface in these, if ``first``."""

    def spoil(columns: list[Array]) -> list[Array]:
        time, surface, part = (column.copy() for column in columns)
        rows = np.arange(len(time)) % n == 0
        part[~rows] = np.nan
        if first:
            surface[rows] = np.nan
        return [time, surface, part]

    return spoil


SPARSE = {
    "the part in each third row": every(3),
    "two instruments, in turn": every(2, 1),
    "the part in two rows": every(200),
}


@pytest.mark.parametrize("sparse", SPARSE)
def test_cells_may_be_missing_where_both_are_never_known(
    sparse: str, run: cosim.Result, tmp_path: Path
) -> None:
    """Without velocities there is no guide in some; each number is told or is null."""
    file = write(tmp_path / "a.csv", HEADER, SPARSE[sparse](table(run)))
    compared = cosim.compare(run, file)
    compared.save(tmp_path)
    told = json.loads((tmp_path / "compare.json").read_text())
    if sparse.startswith("two"):
        assert told["slip_fraction_measured"] is None
    else:
        assert told["mean_error_mm"] >= 0.0 and "part_velocity_r2" not in told
    if not sparse.endswith("two rows"):
        assert told["mean_error_mm"] == pytest.approx(0.0, abs=0.01)


def test_a_hint_names_the_column_that_is_wrong(run: cosim.Result, tmp_path: Path) -> None:
    """A velocity in mm/s that is said to be in m/s, beside heights that are right."""
    time, surface, _ = table(run)
    v = np.interp(0.3125 + time, run.columns["time"], run.columns["v_surface"])
    head = "time [s],surface height [mm],surface velocity [m/s]"
    said = repr(cosim.compare(run, write(tmp_path / "a.csv", head, [time, surface, 1e3 * v])))
    assert "with column surface velocity [m/s] times 0.001" in said


@pytest.mark.parametrize("rate", [120, 240, 480, 960, 4000])
def test_a_clean_trial_is_told_nothing_and_keeps_its_frequency(
    rate: int, run: cosim.Result, tmp_path: Path
) -> None:
    columns = table(run, np.arange(0.0, 0.32, 1.0 / rate))
    compared = cosim.compare(run, write(tmp_path / "a.csv", HEADER, columns))
    assert compared.found.notes == []
    assert compared.numbers["frequency_measured"] == pytest.approx(20.0, rel=3e-3)


def test_a_map_names_the_columns_and_all_that_was_understood_is_written(
    run: cosim.Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run.save(tmp_path / "run")
    columns = table(run)
    clear = write(tmp_path / "clear.csv", HEADER, columns)
    letters = write(tmp_path / "letters.csv", "t,zs,zp (mm)", columns)
    asked = "time=t:s, surface=zs:mm, part=zp"
    for file, more in ((clear, []), (letters, ["--columns", asked])):
        out = ["--out", str(tmp_path / file.stem)]
        assert main(["compare", str(tmp_path / "run"), str(file), *more, *out]) == 0
    said = capsys.readouterr().out
    assert said.index("zp (mm), in mm") < said.rindex("mean_error_mm")
    found = [
        json.loads((tmp_path / name / "compare.json").read_text()) for name in ("clear", "letters")
    ]
    for name in ("velocity_r2", "mean_error_mm", "drift_measured"):
        assert found[0][name] == found[1][name]
    read = found[1]["understood"]
    assert read["rows"] == 300 and read["rate"] == pytest.approx(960.0, rel=1e-6)
    assert read["columns"]["z_part"] == {
        **{"header": "zp (mm)", "unit": "mm", "assumed": False, "missing": 0}
    }


def test_a_camera_counts_downwards(run: cosim.Result, tmp_path: Path) -> None:
    """Rows of a picture count down: -mm turns a column, by --columns or in the header."""
    t, surface, part = table(run)
    down = [t, -surface, -part]
    asked = "time=t:s,surface=top:-mm,part=cube:-mm"
    named = cosim.compare(run, write(tmp_path / "a.csv", "t,top,cube,n", [*down, t]), columns=asked)
    head = "time [s],surface [-mm],part [-mm]"
    headed = cosim.compare(run, write(tmp_path / "b.csv", head, down))
    up = cosim.compare(run, write(tmp_path / "c.csv", head.replace("-", ""), [t, surface, part]))
    assert named.numbers == headed.numbers == up.numbers
    turned = cosim.compare(run, write(tmp_path / "d.csv", head.replace("-", ""), down))
    assert any("(-mm as its unit turns it)" in note for note in turned.found.notes)
    assert "Left out: n." in named.found.notes  # what the user has named needs no list of names


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("surface=nothing:mm", "there is no column nothing (found: t, zs, zp)"),
        ("colour=zs:mm", "--columns colour=zs:mm: write surface=NAME[:unit],part=NAME[:unit]"),
        ("surface=zs:mm,part=zs:mm", "not one column of its own is zs"),
        ("surface=zs:mm,surface=zp:mm", "each once"),
        ("surface=zs,part=zp:mm,time=t:s", "what zs is, or its unit, is not clear"),
        ("surface=zs:kg,part=zp:mm,time=t:s", "the unit kg is not m"),
        ("surface=zs:mm,part=zp:mm", "which column is the time is not clear (t)"),
    ],
)
def test_bad_maps(asked: str, words: str, run: cosim.Result, tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", "t,zs,zp", table(run))
    with pytest.raises(cosim.BadInput) as caught:
        cosim.compare(run, file, columns=asked)
    assert words in str(caught.value) and "\n" not in str(caught.value)
