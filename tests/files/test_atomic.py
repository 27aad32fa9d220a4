"""Files appear whole, and what a kill leaves of them goes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.cli.command import writable
from cosim.errors import BadInput
from cosim.files.atomic import alone, together, whole
from tests.helpers import needs

pytestmark = [pytest.mark.reliability, needs.posix]

KILLED = """
import os, sys
from pathlib import Path
from cosim.files.atomic import alone, whole
with alone(Path(sys.argv[1])), whole(Path(sys.argv[1]) / "it.csv") as temporary:
    temporary.write_bytes(b"half")
    {deed}
"""


def test_what_a_kill_left_goes_with_the_next_run(tmp_path: Path) -> None:
    kill = KILLED.format(deed="os.kill(os.getpid(), 9)")
    done = subprocess.run([sys.executable, "-c", kill, str(tmp_path)], check=False)
    assert done.returncode == -9
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"half"]
    (tmp_path / ".mine").touch()
    with whole(tmp_path / "other.csv") as mine, alone(tmp_path):  # mine is at work
        assert {*tmp_path.iterdir()} == {mine, tmp_path / ".mine"}
    assert {*tmp_path.iterdir()} == {tmp_path / "other.csv", tmp_path / ".mine"}


def test_old_leftovers_go_where_others_may_be_at_work(tmp_path: Path) -> None:
    """As in a folder that charts share; a young file may be one that is about to be locked."""
    old, young = (tmp_path / f".cosim-{age}.png" for age in ("old", "young"))
    for path in (old, young):
        path.touch()
    os.utime(old, (0, 0))
    with whole(tmp_path / "other.png") as locked:
        os.utime(locked, (0, 0))
        with writable(tmp_path, shared=True):
            assert {*tmp_path.iterdir()} == {young, locked}


def test_a_file_in_the_place_of_the_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    told = pytest.raises(BadInput, match=r"taken: this is a file, not a directory\.$")
    with told, whole(tmp_path / "taken" / "page.html"):
        pass


def test_two_at_once_are_told(tmp_path: Path) -> None:
    wait = KILLED.format(deed="print(flush=True); sys.stdin.read()")
    with subprocess.Popen(
        [sys.executable, "-c", wait, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as first:
        assert first.stdout is not None
        first.stdout.readline()
        with pytest.raises(BadInput, match="another process is writing into"), alone(tmp_path):
            pass
        first.communicate()
    with alone(tmp_path):
        assert (tmp_path / "it.csv").read_bytes() == b"half"


def test_all_or_none(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in "abc"]
    for path in paths:
        path.write_text("old")
    with pytest.raises(ZeroDivisionError), together(paths) as new:
        for path in new:
            path.write_text("new")
        raise ZeroDivisionError
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"] * 3
    with together(paths) as new:
        for path in new:
            path.write_text("new")
            assert all(path.read_text() == "old" for path in paths)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["new"] * 3


@pytest.mark.parametrize("linked", [False, True])
def test_no_device_or_pipe_is_replaced(linked: bool, tmp_path: Path) -> None:
    """Also not where a link names it, nor where it is only to go."""
    odd, plain = tmp_path / "odd", tmp_path / "plain"
    if linked:
        odd.symlink_to("/dev/null")
    else:
        os.mkfifo(odd)
    plain.write_text("old")
    for paths, outdated in (([odd], []), ([plain, odd], []), ([plain], [odd])):
        refused = pytest.raises(BadInput, match="odd: this is not a regular file")
        with refused, together(paths, outdated) as new:
            new[0].write_text("new")
        assert {path.name for path in tmp_path.iterdir()} == {"odd", "plain"}
        assert plain.read_text() == "old" and not odd.is_file()
    assert odd.is_symlink() == linked
    link = tmp_path / "link"
    link.symlink_to(plain)
    with whole(link) as new:
        new.write_text("new")
    assert link.read_text() == "new" and plain.read_text() == "old"


def test_no_directory_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told before any other file has its new content."""
    monkeypatch.chdir(tmp_path)
    first, last = Path("first"), Path("last")
    first.write_text("old")
    last.mkdir()
    for name in ("", ".", "..", "/", "last"):
        with pytest.raises(BadInput, match="is a directory"), together([first, Path(name)]) as new:
            new[0].write_text("new")
    assert {path.name for path in tmp_path.iterdir()} == {"first", "last"}
    assert first.read_text() == "old"


def test_what_is_outdated_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kill between two names leaves no old figure beside new numbers; a failure before leaves
    all as it was."""
    paths = [tmp_path / name for name in ("data", "figure")]
    for path in paths:
        path.write_text("old")
    with pytest.raises(ZeroDivisionError), together(paths[:1], paths[1:]):
        raise ZeroDivisionError
    assert [path.read_text() for path in paths] == ["old", "old"]
    monkeypatch.setattr(os, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError), together(paths[:1], paths[1:]):
        pass
    assert paths[0].read_text() == "old" and not paths[1].exists()


def test_content_is_on_disk_before_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda handle: (done.append("sync"), fsync(handle)))
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append("name"), replace(a, b)))
    with together([tmp_path / "a", tmp_path / "b"]):
        pass
    assert done == ["sync", "sync", "name", "name"]


def test_a_name_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no possible file name"), whole(tmp_path / "a\0b"):
        pass
