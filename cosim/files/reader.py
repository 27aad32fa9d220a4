"""The safe reader of every file that a scene, a command or another file names.

It reads regular files only, of a size that memory holds: a device or a pipe would never end, and
some do something when they are merely opened. Who watches is told how far long reading is.
"""

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import IO

from cosim.errors import BadInput, plain

_CHUNK = 1 << 20  # bytes

Watcher = Callable[[str, float], None]

_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


class Refused(Exception):
    """Why a file does not pass, as the end of a sentence; its cause is the system's error."""


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Within this context ``watcher`` is told each file at work, and which share of it is done."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def tell(path: Path | str, share: float) -> None:
    """Tell who watches how much of the file is done, from 0 to 1."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher(str(path), share)


def contents(path: Path | str, most: int) -> bytes:
    """The bytes of a regular file, at most ``most`` of them. Raises Refused."""
    with _opened(path, most) as file:
        read = BytesIO()
        size = os.fstat(file.fileno()).st_size
        while chunk := file.read(_CHUNK):
            read.write(chunk)
            if read.tell() > most:  # it grows, or its size is not told
                raise Refused(_too_large(most))
            if size > _CHUNK:
                tell(path, 0.5 * min(1.0, read.tell() / size))
        return read.getvalue()


def read(path: Path, most: int) -> bytes:
    """What :func:`contents` gives. Raises BadInput."""
    try:
        return contents(path, most)
    except Refused as refused:
        raise bad(path, refused) from refused.__cause__


@contextmanager
def opened(path: Path, most: int) -> Iterator[IO[bytes]]:
    """A regular file, of at most ``most`` bytes, open for reading. Raises BadInput."""
    try:
        with _opened(path, most) as file:
            yield file
    except Refused as refused:
        raise bad(path, refused) from refused.__cause__


def bad(path: Path, refused: Refused) -> BadInput:
    """The sentence on a file that does not pass."""
    return BadInput(f"{plain(path)}: cannot be read ({refused}).")


@contextmanager
def _opened(path: Path | str, most: int) -> Iterator[IO[bytes]]:
    flags = os.O_RDONLY
    for more in ("O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY", "O_BINARY"):
        flags |= getattr(os, more, 0)
    try:
        _check(os.stat(path), most)
        file = open(os.open(path, flags), "rb")  # noqa: SIM115
        with file:
            _check(os.fstat(file.fileno()), most)  # another one may have taken its place
            yield file
    except OSError as error:
        raise Refused(error.strerror or str(error)) from error
    except ValueError as error:  # a NUL or a lone surrogate in the path
        if "embedded null" in str(error) or isinstance(error, UnicodeEncodeError):
            raise Refused("it is no possible file name") from None
        raise


def _check(about: os.stat_result, most: int) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise Refused("it is a directory")
    if not stat.S_ISREG(about.st_mode):
        raise Refused("it is not a regular file")
    if about.st_size > most:
        raise Refused(_too_large(most))


def _too_large(most: int) -> str:
    return f"it is larger than {most / 1e6:g} MB"
