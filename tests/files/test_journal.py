"""A journal keeps every whole line, whatever befalls the disk and the other ones."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cosim.errors import BadInput, Note
from cosim.files.journal import Journal
from tests.helpers import needs

resource = pytest.importorskip("resource")
pytestmark = [pytest.mark.reliability, needs.posix]


def opened(path: Path) -> Journal[str]:
    return Journal(path, "test", lambda text: {"text": text}, lambda _, said: said["text"] + "")


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """No file grows beyond ``size`` bytes: the last write is short, and then there is an error."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [800, 801, 850])  # in different places of a line
def test_a_disk_that_is_full_for_a_while(size: int, tmp_path: Path) -> None:
    path = tmp_path / "work.journal"
    with opened(path) as journal:
        with disk_of(size), pytest.warns(Note, match="cannot be written") as told:
            for number in range(30):
                journal.add(number, f"piece {number}")
            assert len([*journal.read()]) == 30
            written = path.read_bytes()
            assert len(written) <= size and written.endswith(b"\n")
        assert len(told) == 1
        for number in range(30, 60):
            journal.add(number, f"piece {number}")
    assert len(path.read_bytes().splitlines()) == 61
    with opened(path) as again:
        assert [*again.read()] == [(number, f"piece {number}") for number in range(60)]


def test_a_disk_that_stays_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.files.journal.MOST_OWED", 1000)
    with (
        opened(tmp_path / "work.journal") as journal,
        disk_of(400),
        pytest.warns(Note),
        pytest.raises(BadInput, match="cannot be written"),
    ):
        for number in range(100):
            journal.add(number, f"piece {number}")


SPOILT = {
    "torn and joined": b'{"number": 7, "te{"number": 8, "text": "x"}',
    "foreign": b"Sun Nov 22 08:20:06 kernel: nothing to do with this",
    "no UTF-8": b'{"number": 7, "text": "\xff\xfe"}',
    "UTF-16": '{"number": 7, "text": "x"}'.encode("utf-16-be"),
    "zeros": bytes(4096),
    "long": b"x" * 3_000_000,
    "deep": b"[" * 100_000,
    "digits": b'{"number": ' + b"9" * 5000 + b', "text": "x"}',
    "no number": b'{"number": true, "text": "x"}',
    "no piece": b'{"number": 7, "text": 3}',
    "no record": b"3",
}


@pytest.mark.parametrize("line", SPOILT.values(), ids=SPOILT)
def test_a_spoilt_line_costs_itself_only(line: bytes, tmp_path: Path) -> None:
    path = tmp_path / "work.journal"
    with opened(path) as journal:
        for number in range(6):
            journal.add(number, "whole")
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:3], line + b"\n", *lines[3:]]) + line[:20])
    with pytest.warns(Note, match="1 damaged line;"), opened(path) as journal:
        assert [*journal.read()] == [(number, "whole") for number in range(6)]
        assert journal.done == set(range(6))
        journal.add(6, "new")
    with pytest.warns(Note), opened(path) as journal:
        assert len([*journal.read()]) == 7


def test_a_first_line_that_a_kill_has_torn(tmp_path: Path) -> None:
    path = tmp_path / "work.journal"
    header = json.dumps({"journal": "test"}).encode() + b"\n"
    for length in (0, 5, len(header) - 1):
        path.write_bytes(header[:length])
        with opened(path) as journal:
            assert not journal.done
    path.write_bytes(b'{"journal": "other"')
    with pytest.raises(BadInput, match="other work"):
        opened(path)
    assert path.read_bytes() == b'{"journal": "other"'


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    target = tmp_path / "precious"
    target.write_bytes(b"")
    (tmp_path / "work.journal").symlink_to(target)
    with pytest.raises(BadInput, match="it is a link"):
        opened(tmp_path / "work.journal")
    assert target.read_bytes() == b""


def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "work.journal")
    with pytest.raises(BadInput, match="not a regular file"):
        opened(tmp_path / "work.journal")
