"""A journal: a line for each finished piece of long work, from which a killed one goes on.

The first line says which work it is. A line counts only whole: what a kill, a full disk or another
program has spoilt costs itself only, and its piece is done again. One process at a time may write.
"""

import json
import os
import stat
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

from cosim.errors import BadInput, Note, plain

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

T = TypeVar("T")

LONGEST_LINE = 1 << 20
"""Bytes; far above any honest one."""

MOST_OWED = 64 << 20
"""Bytes that are kept for a disk that takes them later."""


class Journal(Generic[T]):
    """The journal at ``path`` of the work with this ``identity``; to be used in a ``with`` block.

    ``encode`` makes of a finished piece what JSON can hold, ``decode`` the piece of that; it raises
    ValueError, TypeError, KeyError, AttributeError or OverflowError for what is none. ``settled``
    says whether a piece that stands in the journal is not to be done again.

    ``done`` are the numbers of the pieces that are settled. Raises BadInput where the file belongs
    to other work, is no regular file, or another process writes to it.
    """

    def __init__(
        self,
        path: Path,
        identity: str,
        encode: Callable[[T], dict[str, Any]],
        decode: Callable[[int, dict[str, Any]], T],
        settled: Callable[[T], bool] = lambda piece: True,
    ) -> None:
        self.path = path
        self.done: set[int] = set()
        self._encode, self._decode, self._settled = encode, decode, settled
        self._owed: list[bytes] = []
        """Lines that the disk did not take."""
        self._end = 0
        """Bytes of whole lines."""
        self._file = _opened(path)
        try:
            self._lock()
            self._take_up(identity)
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> "Journal[T]":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._file)

    def add(self, number: int, piece: T) -> None:
        """Write down a finished piece.

        What the disk does not take is kept and tried again with the next one; a note tells it.
        Raises BadInput where that is too much.
        """
        self._owed.append(json.dumps({"number": number, **self._encode(piece)}).encode() + b"\n")
        try:
            while self._owed:
                self._write(self._owed[0])
                del self._owed[0]
        except OSError as error:
            words = f"{plain(str(self.path))}: cannot be written ({error.strerror})"
            if sum(map(len, self._owed)) > MOST_OWED:
                raise BadInput(f"{words}.") from error
            if len(self._owed) == 1:
                warnings.warn(
                    f"{words}; the work goes on, and a kill now would lose what is not written.",
                    Note,
                    stacklevel=2,
                )
        if self._settled(piece):
            self.done.add(number)

    def read(self) -> Iterator[tuple[int, T]]:
        """The pieces that stand in it, in the order in which they were written; the last one of a
        number counts."""
        with open(self.path, "rb") as file:
            for _, line in _lines(file):
                yield from self._piece(line)
        for line in self._owed:
            yield from self._piece(line)

    def remove(self) -> None:
        """The work is done, and the journal of no more use."""
        self.path.unlink(missing_ok=True)

    def _piece(self, line: bytes) -> Iterator[tuple[int, T]]:
        """The piece of a line, if it is one."""
        try:
            record = json.loads(line.decode())
            number = record.pop("number")
            if type(number) is not int:
                return
            piece = self._decode(number, record)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
            return
        yield number, piece

    def _write(self, line: bytes) -> None:
        """Append a line, whole or not at all."""
        if os.fstat(self._file).st_size != self._end:
            os.ftruncate(self._file, self._end)
        left = memoryview(line)
        try:
            while left:
                left = left[os.write(self._file, left) :]
        except OSError:
            os.ftruncate(self._file, self._end)
            raise
        self._end += len(line)

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise BadInput(f"{plain(str(self.path))}: another process is writing it.") from error

    def _take_up(self, identity: str) -> None:
        name = plain(str(self.path))
        header = json.dumps({"journal": identity}).encode() + b"\n"
        with open(self._file, "rb", closefd=False) as file:
            file.seek(0)
            first = file.readline(LONGEST_LINE)
            # What a kill has left of the first line is no journal yet.
            if first != header and (first.endswith(b"\n") or not header.startswith(first)):
                raise BadInput(
                    f"{name}: this is the journal of other work (its scene, keys, values or "
                    "version of cosim differ); remove it, or choose another --out."
                )
            if first == header:
                self._end = len(header)
                spoilt = 0
                for length, line in _lines(file):
                    self._end += length
                    found = list(self._piece(line))
                    spoilt += not found
                    for number, piece in found:
                        (self.done.add if self._settled(piece) else self.done.discard)(number)
                if spoilt:
                    words = f"{spoilt} damaged line{'s' * (spoilt > 1)}"
                    warnings.warn(
                        f"{name}: {words}; what stood there is done again.", Note, stacklevel=2
                    )
        try:
            if first == header:
                os.ftruncate(self._file, self._end)
            else:
                self._write(header)
            os.fsync(self._file)
        except OSError as error:
            raise BadInput(f"{name}: cannot be written ({error.strerror}).") from error


def _opened(path: Path) -> int:
    """The file, to be read and appended to; never one elsewhere that a link names."""
    name = plain(str(path))
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND
    for more in ("O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK", "O_BINARY"):
        flags |= getattr(os, more, 0)
    try:
        file = os.open(path, flags, 0o666)
    except OSError as error:
        reason = "it is a link" if path.is_symlink() else error.strerror
        raise BadInput(f"{name}: cannot be written ({reason}).") from error
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise BadInput(f"{name}: this is not a regular file.")
    return file


def _lines(file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Each whole line with its length; without its content where it is too long."""
    length = 0
    while chunk := file.readline(LONGEST_LINE):
        length += len(chunk)
        if chunk.endswith(b"\n"):
            yield length, chunk if length == len(chunk) else b""
            length = 0
