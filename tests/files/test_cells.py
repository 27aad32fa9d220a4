"""The one reader of tables never makes one number of another."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import BadInput
from cosim.files.cells import read_cells
from cosim.mechanics.normal_force import normal_force
from cosim.scene import load
from cosim.simulation.rungs.given_surface import read_surface
from cosim.trials.table import read_table

pytestmark = pytest.mark.reliability

HEADS = {
    "drive.file": "time [s],v_surface [m/s]",
    "normal_force_file": "time [s],normal_force [N]",
    "trial": "time [s],current [A]",
}


def values(kind: str, path: Path) -> list[float]:
    """The second column, through each of the three ways in which a table is read."""
    if kind == "drive.file":
        return read_surface(path)[1].tolist()
    if kind == "normal_force_file":
        force = normal_force(load("held", [f"friction.normal_force_file={path}"]))
        assert force is not None
        return force.forces
    return read_table(path).columns["current"].tolist()


GOOD = [f"{k},{k}.5" for k in range(10)]

WRONG = {
    "decimal commas": (["0,0,0,5", *[f"{k},0,{k},5" for k in range(1, 10)]], "it has 4 cells"),
    "one decimal comma": ([*GOOD, "10,5,10.5"], "row 12: it has 3 cells, the header 2; numbers"),
    "digits with _": ([*GOOD, "10,0_5"], "“0_5” is not a number"),
    "other digits": ([*GOOD, "10,\u0661"], "is not a number"),
    "hexadecimal": ([*GOOD, "10,0x1p3"], "is not a number"),
    "Fortran": ([*GOOD, "10,1.5d0"], "is not a number"),
    "thousands": ([*GOOD, "10,1 000"], "is not a number"),
    "two signs": ([*GOOD, "10,--1"], "is not a number"),
    "no finite": ([*GOOD, "10,inf"], "is not finite"),
    "beyond": ([*GOOD, "10,1e999"], "is not finite"),
    "stray quote": ([GOOD[0], '1,"1.5', *GOOD[2:5], '5",5.5', *GOOD[6:]], "a quotation mark"),
    "quote in a cell": ([*GOOD, '10,1"5'], "a quotation mark"),
    "text after a quote": ([*GOOD, '10,"1"5'], "a quotation mark"),
    "cut off": ([*GOOD, "10"], "it has 1 cells, the header 2"),
    "NUL": ([*GOOD, "10,1\0"], "control character U+0000"),
    "line separator": ([*GOOD, "10,1\u20282"], "control character U+2028"),
    "vertical tab": ([*GOOD, "10,1\x0b11,2"], "control character U+000B"),
    "other separator": ([*GOOD, "10;10.5"], "it has 1 cells"),
}


@pytest.mark.parametrize("kind", HEADS)
@pytest.mark.parametrize("fault", WRONG)
def test_what_could_be_two_numbers_is_none(kind: str, fault: str, tmp_path: Path) -> None:
    rows, told = WRONG[fault]
    path = tmp_path / "table.csv"
    path.write_text("\n".join([HEADS[kind], *rows]) + "\n", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        values(kind, path)
    assert told in str(caught.value) and str(caught.value).startswith(f"{path}: row ")


@pytest.mark.parametrize("kind", HEADS)
@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_signs_are_not_mixed(kind: str, separator: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    head = HEADS[kind].replace(",", separator)
    commas = [f"{k}{separator}{k},5" for k in range(10)]
    path.write_text("\n".join([head, *commas]), encoding="utf-8")
    assert values(kind, path) == [k + 0.5 for k in range(10)]
    for other in (f"10{separator}10.5", f"10.0{separator}10,5", f"10{separator}1.000,5"):
        path.write_text("\n".join([head, *commas, other]), encoding="utf-8")
        with pytest.raises(BadInput, match=r"decimal point|is not a number"):
            values(kind, path)


@pytest.mark.parametrize("kind", HEADS)
def test_a_column_that_stands_there_twice(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("\n".join([HEADS[kind] + ",time [s]", *(f"{r},7" for r in GOOD)]))
    with pytest.raises(BadInput, match=r"same column|stands there twice"):
        values(kind, path)


@pytest.mark.parametrize("kind", HEADS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_what_spreadsheets_write(kind: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    quoted = [",".join(f'"{cell}"' for cell in row.split(",")) for row in GOOD]
    path.write_text("\r\n".join([HEADS[kind], *GOOD[:3], "", *quoted[3:]]), encoding=encoding)
    assert values(kind, path) == [k + 0.5 for k in range(10)]


def test_what_a_german_excel_writes(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    rows = [f"{k};{k},5" for k in range(10)]
    path.write_text("\n".join(["sep=;", "time [s];surface [µm]", *rows]), encoding="cp1252")
    np.testing.assert_allclose(read_table(path).columns["z_surface"], (np.arange(10) + 0.5) / 1e6)


NUMBERS = st.floats(-1e300, 1e300)


@given(
    st.lists(st.tuples(NUMBERS, NUMBERS), min_size=8, max_size=20),
    st.sampled_from([",", ";", "\t"]),
    st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_numbers_come_back(
    tmp_path_factory: pytest.TempPathFactory, rows: list, separator: str, end: str
) -> None:
    path = tmp_path_factory.mktemp("cells") / "table.csv"
    lines = [separator.join(map(repr, row)) for row in [("a", "b"), *rows]]
    path.write_text(end.join(lines), encoding="utf-8", newline="")
    cells = read_cells(path)
    cells.even(1)
    found = [cells.numbers(1, place, "x") for place in (0, 1)]
    assert np.array_equal(np.column_stack(found), np.array(rows))


@given(st.binary(max_size=200) | st.text('0123456789.,;-e"\n\t #ti', max_size=80))
def test_any_bytes_pass_or_are_told(
    tmp_path_factory: pytest.TempPathFactory, content: bytes | str
) -> None:
    path = tmp_path_factory.mktemp("cells") / "table.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    for read in (read_table, read_surface, read_cells):
        try:
            read(path)
        except BadInput as error:
            assert str(error).isprintable() and str(error).startswith(str(path))


def test_long_lines_and_many_cells_take_no_long_time(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("," * 5_000_000 + '"')
    with pytest.raises(BadInput, match="cells"):
        read_cells(path)
    path.write_text("time [s],v_surface [m/s]\n0," + " " * 5_000_000 + '"')
    with pytest.raises(BadInput, match="quotation mark"):
        read_cells(path)
    path.write_text("time [s],v_surface [m/s]\n0,1\n0," + "1" * 5_000_000 + "x")
    with pytest.raises(BadInput, match="not a number"):
        read_surface(path)
