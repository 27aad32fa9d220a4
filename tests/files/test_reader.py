"""Files that a scene or a command names: devices, pipes and endless files are refused at once."""

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tqdm import tqdm

import cosim
from cosim.circuit.lint import deck
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.files import cells, reader
from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers import needs

pytestmark = [pytest.mark.reliability, needs.posix]

RUN = ["run.duration=0.01", "run.settle=0"]
READERS: dict[str, Callable[[str], object]] = {
    "scene": load,
    "netlist": lambda path: deck.read(Path(path)),
    "drive.file": lambda path: simulate(load("trial", [*RUN, f"drive.file={path}"])),
    "normal_force_file": lambda path: simulate(
        load("held", [*RUN, f"friction.normal_force_file={path}"])
    ),
    "trial": lambda path: cosim.compare("held", path),
}
"""Whatever reads a file that is named."""


@pytest.fixture
def odd(tmp_path: Path) -> dict[str, str]:
    """Files that are none, or have no end."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    with open(tmp_path / "endless", "wb") as file:
        file.truncate(1 << 40)
    return {
        **{name: str(tmp_path / name) for name in ("pipe", "loop", "endless", "missing")},
        "folder": str(tmp_path),
        "device": "/dev/zero",
        "terminal": "/dev/tty",
        "long": "x" * 5000,
        "below a file": "/dev/null/x",
    }


@pytest.mark.parametrize("reader", READERS)
def test_odd_files_are_refused_at_once(reader: str, odd: dict[str, str]) -> None:
    for kind, path in odd.items():
        with pytest.raises(BadInput, match=r"cannot be read|there is no ") as caught:
            READERS[reader](path)
        assert len(str(caught.value)) < 600 and str(caught.value).isprintable(), kind


@pytest.mark.parametrize("key", ["circuit.netlist", "drive.file", "friction.normal_force_file"])
def test_a_nul_in_a_path(key: str, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    table, _, name = key.partition(".")
    base = {"circuit": "paper", "drive": "trial", "friction": "held"}[table]
    model = 'model = "file"\n' if table == "circuit" else ""
    scene.write_text(f'base = "{base}"\n[{table}]\n{model}{name} = "a\\u0000b"\n')
    assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


def test_one_that_takes_the_place_of_a_regular_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the look at it and its opening."""
    path = tmp_path / "file"
    path.write_bytes(b"x")
    seen = os.stat(path)
    path.unlink()
    os.mkfifo(path)
    monkeypatch.setattr(os, "stat", lambda *_, **__: seen)
    with pytest.raises(reader.Refused, match="not a regular file"):
        reader.read(path, 100)


def test_one_that_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(bytes(3 << 20))
    check = reader._check_size

    def grow(*given: Any) -> None:
        with open(path, "ab") as file:
            file.write(bytes(1 << 20))
        check(*given)

    monkeypatch.setattr(reader, "_check_size", grow)
    with pytest.raises(reader.Refused, match="larger than"):
        reader.read(path, 20 << 20)


def test_long_reading_is_shown_on_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "long.csv"
    rows = "".join(f"{k}e-5,0.5\n" for k in range(150_000))
    path.write_text("time [s],normal_force [N]\n" + rows)
    cells.read_cells(path)
    assert not capsys.readouterr().err
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr("tqdm.tqdm", lambda *rows, **how: tqdm(*rows, **how | {"delay": 0.0}))
    assert len(cells.read_cells(path).rows) == 150_001
    assert "reading long.csv: " in capsys.readouterr().err


def test_readers_meet_no_lock(tmp_path: Path) -> None:
    """A pipe with a writer is refused as well, and the writer is not held up for ever."""
    os.mkfifo(tmp_path / "pipe")

    def write() -> None:
        handle = os.open(tmp_path / "pipe", os.O_RDWR)
        os.write(handle, b"x")
        os.close(handle)

    writer = threading.Thread(target=write)
    writer.start()
    with pytest.raises(reader.Refused, match="not a regular file"):
        reader.read(tmp_path / "pipe", 100)
    writer.join(10)
    assert not writer.is_alive()
