"""The safe reader of every file that a scene, a command or another file names.

It reads regular files of limited size only: devices and pipes may never end, and some act when they
are merely opened.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO

from cosim.errors import BadInput, plain

_CHUNK = 1 << 20  # bytes


class Refused(BadInput):
    """A file that cannot be read; ``__cause__`` is the system's error, if any."""

    why = ""
    """The reason, as the end of a sentence."""


def read(path: Path | str, most: int) -> bytes:
    """The bytes of a regular file, at most ``most`` of them. Raises Refused."""
    with opened(path, most) as file:
        read = BytesIO()
        while chunk := file.read(_CHUNK):
            read.write(chunk)
            _check_size(path, read.tell(), most)  # the file may grow, or have no known size
        return read.getvalue()


@contextmanager
def opened(path: Path | str, most: int) -> Iterator[IO[bytes]]:
    """A regular file, of at most ``most`` bytes, open for reading. Raises Refused."""
    flags = os.O_RDONLY
    for more in ("O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY", "O_BINARY"):
        flags |= getattr(os, more, 0)
    try:
        _check(path, os.stat(path), most)
        file = open(os.open(path, flags), "rb")  # noqa: SIM115
        with file:
            _check(path, os.fstat(file.fileno()), most)  # it may have been replaced meanwhile
            yield file
    except OSError as error:
        raise _refused(path, error.strerror or str(error)) from error
    except ValueError as error:  # a NUL or a lone surrogate in the path
        if "embedded null" in str(error) or isinstance(error, UnicodeEncodeError):
            raise _refused(path, "it is no possible file name") from None
        raise


def _check(path: Path | str, about: os.stat_result, most: int) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise _refused(path, "it is a directory")
    if not stat.S_ISREG(about.st_mode):
        raise _refused(path, "it is not a regular file")
    _check_size(path, about.st_size, most)


def _check_size(path: Path | str, size: int, most: int) -> None:
    if size > most:
        raise _refused(path, f"it is larger than {most / 1e6:g} MB")


def _refused(path: Path | str, why: str) -> Refused:
    error = Refused(f"{plain(path)}: cannot be read ({why}).")
    error.why = why
    return error
