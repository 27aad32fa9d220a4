"""A store keeps what was found, whatever befalls the process, the disk and the file."""

import math
import os
import random
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from cosim.errors import BadInput, Note
from cosim.evaluate.store import PAUSE, Store
from tests.helpers import needs

resource = pytest.importorskip("resource")
pytestmark = [pytest.mark.reliability, needs.posix]


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """No file grows beyond ``size`` bytes: the last write is short, and then there is an error."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that is added is written."""
    monkeypatch.setattr("cosim.evaluate.store.PAUSE", 0.0)


def test_what_was_found_comes_back_bit_by_bit(tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    made: dict[str, Any] = {
        "numbers": [0.1 + 0.2, 5e-324, -math.inf, 7],
        "table": {"text": "µ, 'quoted'", "nested": [[1e300], "", True]},
    }
    with pytest.raises(KeyboardInterrupt), Store(path, "study", 1) as store:
        for name, found in made.items():
            assert store.once(name, lambda found=found: found) == found
        store.once("nan", lambda: math.nan)
        raise KeyboardInterrupt
    with pytest.raises(BadInput, match="belongs to other work"):
        Store(path, "study", 2)
    with Store(path, "study", 1) as store:
        assert store.resumed == len(store) == 3
        with pytest.raises(BadInput, match="another process is writing it"):
            Store(path, "study", 1)
        for name, found in made.items():
            assert store.once(name, lambda: pytest.fail("done twice")) == found
        assert math.isnan(store.once("nan", lambda: 0.0))
        assert store.once("new", lambda: 3) == store.get("new") == 3
        store.remove()
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_of_work_that_found_nothing(tmp_path: Path) -> None:
    with Store(tmp_path / "any.sqlite"):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("at_once")
def test_others_read_it_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    reading = "SELECT count(*) FROM found WHERE key <> ''"
    with Store(path) as store:
        for number in range(1, 50):
            store.add(f"{number}", "found" * 1000)
            with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as other:
                assert other.execute(reading).fetchone() == (number,)


WRITER = """
import sys
from pathlib import Path
from time import monotonic
from cosim.evaluate.store import Store
with Store(Path(sys.argv[1])) as store:
    for number in range(store.resumed, 1 << 30):
        began = monotonic()
        store.add(str(number), [number] * 50)
        print(number, began, flush=True)
"""


def test_kills_at_any_moment_lose_a_moment_at_most(tmp_path: Path) -> None:
    path, dice, known = tmp_path / "any.sqlite", random.Random(1), 0
    for _ in range(8):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout is not None
        first = writer.stdout.readline()
        time.sleep(dice.uniform(0.0, 0.3))
        writer.kill()
        lines = [first, *writer.communicate()[0].splitlines()]
        added = [line.split() for line in lines if len(line.split()) == 2]
        assert int(added[0][0]) == known
        with Store(path) as store:
            assert known < len(store) <= int(added[-1][0]) + 2
            known = len(store)
            assert all(store.get(str(n)) == [n] * 50 for n in range(known))
        lost = [float(began) for number, began in added[:-1] if int(number) >= known]
        assert not lost or lost[-1] - lost[0] < PAUSE


@pytest.mark.usefixtures("at_once")
def test_a_disk_that_is_full_for_a_while(tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    with Store(path) as store:
        with disk_of(150_000), pytest.warns(Note, match="cannot be written") as told:
            for number in range(300):
                store.add(f"{number}", f"{number}" * 200)
            assert store.get("299") == "299" * 200
            assert 10 < len(store) < 290
        assert len(told) == 1
        store.add("300", "more")
    with Store(path) as again:
        assert len(again) == 301
        assert all(again.get(f"{number}") == f"{number}" * 200 for number in range(300))


@pytest.mark.usefixtures("at_once")
def test_a_disk_that_stays_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.evaluate.store.MOST_OWED", 50_000)
    with (
        Store(tmp_path / "any.sqlite") as store,
        disk_of(50_000),
        pytest.warns(Note),
        pytest.raises(BadInput, match="cannot be written"),
    ):
        for number in range(1000):
            store.add(f"{number}", "found" * 100)


@pytest.mark.parametrize("size", [0, 1, 2000, 4096, 5000, 20_000])
def test_no_room_to_begin_with(size: int, tmp_path: Path) -> None:
    """It is told, and in the way of nothing later."""
    path = tmp_path / "any.sqlite"
    with disk_of(size), pytest.raises(BadInput, match="cannot be written"), Store(path) as store:
        for number in range(100):
            store.add(f"{number}", "found" * 100)
        pytest.fail(f"there was room: {store}")
    with Store(path) as store:
        store.add("a", 1)
        assert store.get("a") == 1


SPOILT: dict[str, bytes] = {
    "no database": b"Sun Nov 22 08:20:06 kernel: nothing to do with this" * 100,
    "zeros": bytes(8192),
    "long": b"x" * 3_000_000,
}


@pytest.mark.parametrize("content", SPOILT.values(), ids=SPOILT)
def test_another_file_is_told_and_left(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    path.write_bytes(content)
    with pytest.raises(BadInput, match="no store of this version of cosim, or it is damaged"):
        Store(path)
    assert path.read_bytes() == content


def test_a_page_that_was_overwritten_is_told(tmp_path: Path) -> None:
    """Or nothing is wrong with what is read."""
    path = tmp_path / "any.sqlite"
    with Store(path) as store:
        for number in range(500):
            store.add(f"{number}", f"{number}" * 50)
    whole, told = path.read_bytes(), 0
    dice = random.Random(3)
    for page in range(len(whole) // 4096):
        path.write_bytes(whole[: 4096 * page] + dice.randbytes(4096) + whole[4096 * (page + 1) :])
        try:
            with Store(path) as store:
                found = [store.get(f"{number}") for number in range(500)]
            assert all(f in (None, f"{n}" * 50) for n, f in enumerate(found))
        except BadInput as error:
            assert "damaged" in str(error) or "other work" in str(error)
            told += 1
    assert told > 5


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE found SET value = '{\"torn' WHERE key = 'a'",
        "UPDATE found SET value = x'00ff' WHERE key = 'a'",
        f"UPDATE found SET value = '{'[' * 100_000}' WHERE key = 'a'",
    ],
)
def test_a_finding_that_is_none_is_found_again(change: str, tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    with Store(path) as store:
        store.add("a", 1)
    with closing(sqlite3.connect(path)) as other:
        other.execute(change)
        other.commit()
    with Store(path) as store:
        assert store.once("a", lambda: 2) == store.get("a") == 2


@pytest.mark.parametrize(
    "change",
    [
        "CREATE TRIGGER t AFTER INSERT ON found BEGIN DELETE FROM found; END",
        "CREATE VIEW v AS SELECT load_extension('x')",
        "DROP TABLE found; CREATE TABLE found (key, value)",
    ],
)
def test_tables_of_a_strangers_are_refused(change: str, tmp_path: Path) -> None:
    path = tmp_path / "any.sqlite"
    with Store(path) as store:
        store.add("a", 1)
    with closing(sqlite3.connect(path)) as other:
        other.executescript(change)
    with pytest.raises(BadInput, match="its tables are others"):
        Store(path)


@pytest.mark.parametrize("more", ["", "-wal", "-shm", "-journal"])
def test_a_link_is_not_followed(more: str, tmp_path: Path) -> None:
    target = tmp_path / "precious"
    target.write_bytes(b"mine")
    (tmp_path / f"work.sqlite{more}").symlink_to(target)
    with pytest.raises(BadInput, match="it is a link"):
        Store(tmp_path / "work.sqlite")
    assert target.read_bytes() == b"mine"


def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "work.sqlite")
    with pytest.raises(BadInput, match="not a regular file"):
        Store(tmp_path / "work.sqlite")
