"""Files that appear whole or not at all."""

import json
import os
import stat
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from operator import methodcaller
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from uuid import uuid4

from cosim.errors import BadInput, plain

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_YOUNG = 60.0
"""s for which unlocked temporary files and folders stay: a process may be about to lock them."""

_PREFIX = ".cosim-"
"""Prefix of temporary files and folders, by which :func:`tidy` finds those of killed processes."""


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends well."""
    with together([path]) as (temporary,):
        yield temporary


@contextmanager
def together(paths: Sequence[Path], outdated: Sequence[Path] = ()) -> Iterator[list[Path]]:
    """Temporary paths beside ``paths`` that replace these, one right after the other, when the
    block ends without an exception; files ``outdated`` by them are removed right before. Raises
    BadInput where a path cannot be written, or is a directory, a device or a pipe."""
    name = paths[0]
    try:
        for name in (*outdated, *paths):
            with suppress(FileNotFoundError, NotADirectoryError):
                mode = name.stat().st_mode  # of a link's target: root could replace a device
                if not stat.S_ISREG(mode):
                    kind = "a directory, not a file" if stat.S_ISDIR(mode) else "not a regular file"
                    raise BadInput(f"{plain(name)}: this is {kind}.")
        with ExitStack() as stack:
            pairs = []
            for path in paths:
                name = path
                path.parent.mkdir(parents=True, exist_ok=True)
                pairs.append((stack.enter_context(_temporary(path)), path))
            name = paths[0] if len(paths) == 1 else paths[0].parent
            yield [temporary for temporary, _ in pairs]
            for temporary, path in pairs:
                name = path
                # Without it a loss of power may leave the new name with no content.
                with open(temporary, "rb+") as file:
                    os.fsync(file.fileno())
            for name in outdated:
                name.unlink(missing_ok=True)
            for temporary, path in pairs:
                name = path
                os.replace(temporary, path)
    except FileExistsError as error:  # from mkdir: temporary names are unique
        raise BadInput(f"{plain(name.parent)}: this is a file, not a directory.") from error
    except OSError as error:
        raise BadInput(f"{plain(name)}: cannot be written ({error.strerror}).") from error
    except ValueError as error:
        if "embedded null" not in str(error):
            raise
        raise BadInput(f"{plain(name)}: it is no possible file name.") from None


def write_all(files: Mapping[Path, bytes]) -> None:
    """Write files, all or none. Raises BadInput as :func:`together`."""
    with together([*files]) as temporary:
        for path, content in zip(temporary, files.values(), strict=True):
            path.write_bytes(content)


def locked(handle: int) -> bool:
    """Lock an open file or folder until it is closed. False where another process has locked it;
    True also on a file system without locks."""
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """A new file beside ``path``, locked within this context and removed at its end."""
    temporary = path.with_name(f"{_PREFIX}{uuid4().hex}{path.suffix}")
    handle = os.open(
        temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666
    )
    if fcntl is None:  # Windows, which replaces no open file
        os.close(handle)
    try:
        locked(handle)
        yield temporary
    finally:
        if fcntl is not None:
            os.close(handle)
        temporary.unlink(missing_ok=True)


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Lock ``folder`` against other processes that call this, and remove what killed processes have
    left there. Raises BadInput where another process has locked it."""
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        if not locked(handle):
            raise BadInput(
                f"{plain(folder)}: another process is writing into this folder; wait for it, "
                "or choose another --out."
            )
        tidy(folder, ours=True)
        yield
    finally:
        os.close(handle)


def tidy(folder: Path, ours: bool = False) -> None:
    """Remove temporary files and folders of processes that have ended. Young ones stay, but for
    files where the folder is ``ours``: another process may be about to lock them."""
    if fcntl is None:
        return
    for path in folder.glob(f"{_PREFIX}*"):
        with suppress(OSError):
            whole = path.is_dir()
            if time.time() - path.stat().st_mtime <= _YOUNG and (whole or not ours):
                continue
            handle = os.open(
                path, (os.O_RDONLY if whole else os.O_RDWR) | os.O_NOFOLLOW | os.O_NONBLOCK
            )
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if whole:
                    rmtree(path)
                else:
                    path.unlink()
            finally:
                os.close(handle)


def folder_of_ones_own(parent: Path) -> tuple[str, int]:
    """A new folder, and a handle that locks it while it is open here or in a child."""
    tidy(parent)
    folder = mkdtemp(prefix=_PREFIX, dir=parent)
    handle = os.open(folder if fcntl is not None else os.devnull, os.O_RDONLY)
    locked(handle)
    return folder, handle


def write_text(path: Path, text: str) -> None:
    with whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write what JSON can hold, indented; ValueError for a number that is not finite."""
    write_text(path, as_json(content))


def as_json(content: Any) -> str:
    """What :func:`write_json` writes."""
    numbers = methodcaller("item")  # NumPy's
    return (
        json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False, default=numbers) + "\n"
    )
