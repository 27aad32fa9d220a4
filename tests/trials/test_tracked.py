"""Reading tracked trials: every form that such a file takes, and every way in which it is wrong."""

import os
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import BadInput
from cosim.files.cells import LARGEST
from cosim.trials.table import read_table
from cosim.trials.tracked import number_of, read, read_folder

HEADER: str = "t,xp,zp,vxp,vzp,axp,azp,xo,zo,vxo,vzo,axo,azo,xs,zs,vxs,vzs,axs,azs"
GONE = "\ufffd"
ROWS = 12


def height(i: int) -> float:
    return 0.5 * i * i - 3.0  # mm; velocity i mm a row


def table(azo: str = GONE) -> list[list[str]]:
    """A made-up trial as the published ones are: 19 columns, v and a missing at the ends."""
    cells: list[list[str]] = [list(HEADER.split(","))]
    for i in range(ROWS):
        inner, deep = 0 < i < ROWS - 1, 1 < i < ROWS - 2
        row = [f"{i / 1000:.8f}"]
        for k, body in enumerate("pos"):
            v = f"{(i + k) * 1000:.8f}" if inner else GONE
            a = "1000000.00000000" if deep else (azo if body == "o" else GONE)
            row += ["1.50000000", f"{height(i) + k * i:.8f}", v if inner else GONE, v, a, a]
        cells.append(row)
    return cells


def text(cells: list[list[str]], separator: str = ",", end: str = "\r\n") -> str:
    return end.join(separator.join(row) for row in cells)


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def check(path: Path) -> None:
    trial = read(path)
    rows = np.arange(ROWS)
    np.testing.assert_allclose(trial.time, rows / 1000)
    np.testing.assert_allclose(trial.platform.z, 1e-3 * (0.5 * rows**2 - 3.0), atol=1e-15)
    np.testing.assert_allclose(trial.part.z, 1e-3 * (0.5 * rows**2 - 3.0 + rows), atol=1e-15)
    for track, k in ((trial.platform, 0), (trial.part, 1)):
        assert np.isnan(track.v[[0, -1]]).all()
        np.testing.assert_allclose(track.v[1:-1], rows[1:-1] + k)


def test_a_published_trial(tmp_path: Path):
    path = write(tmp_path / "Trial #7.csv", text(table()))
    check(path)
    trial = read(path)
    assert trial.name == "Trial #7" and number_of(path) == 7
    assert trial.plate is not None
    accelerations = read_table(path).columns["a_surface"]
    assert np.isnan(accelerations[[0, 1, -2, -1]]).all()
    np.testing.assert_allclose(accelerations[2:-2], 1000.0)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
@pytest.mark.parametrize("last", ["", "end", "blank"])
def test_encodings_and_line_ends(tmp_path: Path, encoding: str, end: str, last: str):
    more = {"": "", "end": end, "blank": end + end + end}[last]
    check(write(tmp_path / "trial.csv", (text(table(), end=end) + more).encode(encoding)))


@pytest.mark.parametrize("missing", [GONE, GONE * 2, "", " ", "NaN", "nan", "?", '""'])
def test_marks_of_a_missing_value(tmp_path: Path, missing: str):
    check(write(tmp_path / "trial.csv", text(table()).replace(GONE, missing)))


def test_bytes_that_are_no_utf_8_are_missing_values(tmp_path: Path):
    check(write(tmp_path / "trial.csv", text(table()).encode().replace(GONE.encode(), b"\x90")))


def test_empty_cells_among_marks_as_in_trial_9(tmp_path: Path):
    check(write(tmp_path / "Trial #9.csv", text(table(azo=""))))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separators_and_comment_lines(tmp_path: Path, separator: str):
    content = "#exported\r\n# again\r\n" + text(table(), separator)
    check(write(tmp_path / "trial.txt", content))


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas(tmp_path: Path, separator: str):
    content = text(table(), separator).replace(".", ",")
    check(write(tmp_path / "trial.txt", content))


def test_the_columns_needed_suffice_in_any_order(tmp_path: Path):
    lines = ["zo [mm],t [s],extra,zp [mm]"]
    lines += [f"{height(i) + i},{i / 1000},x,{height(i)}" for i in range(ROWS)]
    path = write(tmp_path / "a.csv", "\n".join(lines))
    check(path)  # velocities by central differences, exact on a parabola
    assert read(path).plate is None
    assert number_of(path) is None


def tracker(velocity: str = "v_{y}", names: str = "\tplatform\t\t\tpart\t\t\t") -> str:
    lines = ["#multi:", names, f"t\tx\ty\t{velocity}\tx\ty\t{velocity}\t"]
    for i in range(ROWS):
        v = [f"{(i + k) * 1e3:.6E}" if 0 < i < ROWS - 1 else "" for k in (0, 1)]
        first, second = f"{height(i):.6E}", f"{height(i) + i:.6E}"
        lines.append(f"{i / 1000:.6E}\t1.5\t{first}\t{v[0]}\t1.5\t{second}\t{v[1]}\t")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("velocity", ["v_{y}", "vy", "v"])
def test_trackers_own_export(tmp_path: Path, velocity: str):
    check(write(tmp_path / "trial.txt", tracker(velocity)))


def test_trackers_own_export_with_decimal_commas_and_other_names(tmp_path: Path):
    content = tracker(names="\tSurface\t\t\tObject\t\t\t").replace(".", ",")
    check(write(tmp_path / "trial.txt", content))


def changed(row: int, column: str, value: str) -> str:
    cells = table()
    cells[row][cells[0].index(column)] = value
    return text(cells)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "holds no table"),
        ("# only a comment\n", "holds no table"),
        (b"\x00\x01\x02\x03", "row 1: the control character U+0000"),
        ("a,b\n1,2\n", "row 1: no column is understood (found: a, b)"),
        ("t [s],surface [mm]\n" + "".join(f"{i},0\n" for i in range(9)), "no column zo (found: t"),
        (
            "t [s],zp [mm],zo [m],zp [mm]\n0,0,0,0\n",
            "row 1: the column zp [mm] stands there twice",
        ),
        (changed(5, "zp", "abc"), "row 6, column zp: “abc” is not a number"),
        (changed(5, "vzo", "1_0"), "row 6, column vzo: “1_0” is not a number"),
        (changed(5, "vzo", "1,5"), "row 6: it has 20 cells, the header 19"),
        (changed(5, "azs", "1e999"), "row 6, column azs: “1e999” is not finite"),
        (changed(5, "zo", "-inf"), "row 6, column zo: “-inf” is not finite"),
        (changed(3, "t", ""), "row 4, column t: the value is missing"),
        (changed(3, "t", "0.001"), "row 4, column t: the time does not increase"),
        (text(table()[:8]), "it has 7 of the 8 rows needed"),
        (text(table()) + "\r\n0.5,1", "row 14: it has 2 cells, the header 19"),
        (tracker(names="\tmass A\t\t\tmass B\t\t\t"), "(found: mass A, mass B)"),
        ("#multi:\n\tpart\n\nx\ty\n", "row 2: a header t x y … of Tracker's is missing"),
        ("#multi:\n\tplatform\n0\t1\n", "row 2: a header t x y … of Tracker's is missing"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, content: str | bytes, words: str):
    path = write(tmp_path / "bad.csv", content)
    with pytest.raises(BadInput) as caught:
        read(path)
    told = str(caught.value)
    assert words in told
    assert told.startswith(f"{path}: ")
    assert "\n" not in told


def test_frames_in_which_a_body_is_missing_are_left_out(tmp_path: Path):
    trial = read(write(tmp_path / "gap.csv", changed(5, "zo", GONE)))
    whole = read(write(tmp_path / "whole.csv", text(table())))
    kept = np.arange(len(whole.time)) != 4
    assert np.array_equal(trial.time, whole.time[kept])
    assert np.array_equal(trial.part.z, whole.part.z[kept])
    cells = table()
    for row in cells[1:]:
        row[cells[0].index("zo")] = GONE
    few = text(cells)
    with pytest.raises(BadInput, match="0 rows have both zp and zo, and 8 are needed"):
        read(write(tmp_path / "few.csv", few))


def test_files_that_cannot_be_read(tmp_path: Path):
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(BadInput, match="cannot be read"):
            read(path)
    write(tmp_path / "trial.csv", text(table()))
    os.truncate(tmp_path / "trial.csv", LARGEST + 1)
    with pytest.raises(BadInput, match="larger than 50 MB"):
        read(tmp_path / "trial.csv")


def test_a_folder_in_the_order_of_its_numbers(tmp_path: Path):
    for name in ("Trial #10.csv", "Trial #2.csv", "trial A.txt", ".trial 1.csv", "fit.csv", "x.py"):
        write(tmp_path / name, text(table()))
    names = [trial.name for trial in read_folder(tmp_path)]
    assert names == ["Trial #2", "Trial #10", "trial A"]


def test_a_folder_without_the_word_trial(tmp_path: Path):
    for name in ("b2.csv", "a3.txt"):
        write(tmp_path / name, text(table()))
    assert [trial.name for trial in read_folder(tmp_path)] == ["b2", "a3"]


def test_folders_without_trials(tmp_path: Path):
    with pytest.raises(BadInput, match="there are no trials"):
        read_folder(tmp_path)
    with pytest.raises(BadInput, match="cannot be read"):
        read_folder(tmp_path / "none")
