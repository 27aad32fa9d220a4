"""Rows of numbers that a run appends: few stay in memory, many go to disk.

The file has no name, so it vanishes however the process ends.
"""

import mmap
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from stat import S_ISREG
from typing import IO
from weakref import ref

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import BadInput

IN_MEMORY = 8 << 20
"""Bytes of a tape that stay in memory: enough for a run of some seconds."""

BLOCK = 1 << 16
"""Rows that are processed at a time where not all of them need to be in memory."""

_mapped: dict[int, "ref[mmap.mmap]"] = {}
"""Mapped files by their ids. No WeakSet: an interrupt within its callback would be lost."""

_folder: ContextVar[Path | None] = ContextVar("folder", default=None)


@contextmanager
def on_disk_in(folder: Path) -> Iterator[None]:
    """Within this context tapes that outgrow memory lie in ``folder``, not the system's own."""
    token = _folder.set(folder)
    try:
        yield
    finally:
        _folder.reset(token)


def place() -> Path | None:
    """Where tapes lie that outgrow memory; None for the system's own folder."""
    return _folder.get()


class Packed:
    """Columns of equal length, written to a temporary file for another process: in TMPDIR, whatever
    folder untrusted code has changed to. Raises BadInput where the disk is full."""

    def __init__(self, columns: Mapping[str, Array]) -> None:
        rows = len(next(iter(columns.values())))
        handle, path = tempfile.mkstemp()
        self.told = os.path.basename(path), tuple(columns), rows
        """Arguments for :func:`unpacked` after the folder."""
        with open(handle, "wb", buffering=0) as file:
            for values in columns.values():
                for part in blocks(rows):
                    _write(file, values[part])


def unpacked(folder: str, name: str, names: Sequence[str], rows: int) -> dict[str, Array]:
    """Map the columns ``names`` of a file in ``folder``, and unlink it. The arguments may come from
    untrusted code: raises ValueError, TypeError and OSError where they or the file are not as
    :class:`Packed` makes them."""
    if os.path.basename(name) != name or not all(isinstance(each, str) for each in names):
        raise ValueError(name)
    path = os.path.join(folder, name)
    alone = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(path, "r+b", opener=lambda at, flags: os.open(at, flags | alone)) as file:
        about = os.fstat(file.fileno())
        if not S_ISREG(about.st_mode) or about.st_size != 8 * len(names) * rows:
            raise ValueError(path)
        mapped = mmap.mmap(file.fileno(), 0)
    os.unlink(path)
    _mapped[id(mapped)] = ref(mapped)
    columns = np.frombuffer(mapped, np.float64).reshape(len(names), rows)
    return dict(zip(names, columns, strict=True))


class Tape:
    """Rows of ``columns`` numbers, appended, then read as an array. ``rows`` is about their number,
    if known.

    Raises BadInput where the disk is full.
    """

    def __init__(self, columns: int, rows: int = 0) -> None:
        self._columns = columns
        self._rows = 0
        self._most = IN_MEMORY // (8 * columns)
        self._kept = np.empty((min(rows, self._most), columns))
        self._file: IO[bytes] | None = None
        self._array: Array | None = None

    def __len__(self) -> int:
        return self._rows

    def append(self, rows: npt.ArrayLike) -> None:
        """Add rows, of which a copy is kept."""
        block = np.asarray(rows, np.float64).reshape(-1, self._columns)
        if not len(block):
            return
        before, self._rows = self._rows, self._rows + len(block)
        self._array = None
        if self._file is not None or self._rows > self._most:
            self._spill(before, block)
            return
        if self._rows > len(self._kept):
            more = np.empty((min(max(2 * len(self._kept), self._rows), self._most), self._columns))
            more[:before] = self._kept[:before]
            self._kept = more
        self._kept[before : self._rows] = block

    def _spill(self, before: int, block: Array) -> None:
        if self._file is None:
            try:
                self._file = tempfile.TemporaryFile(dir=_folder.get(), buffering=0)  # noqa: SIM115
            except OSError as error:
                raise _no_room(error) from error
            _write(self._file, self._kept[:before])
            self._kept = np.empty((0, self._columns))
        _write(self._file, block)

    def array(self) -> Array:
        """All rows so far; the file itself, mapped, where they are on disk."""
        if self._array is None:
            shape = (self._rows, self._columns)
            if self._file is not None:
                mapped = mmap.mmap(self._file.fileno(), self._rows * self._columns * 8)
                _mapped[id(mapped)] = ref(mapped)
                self._array = np.frombuffer(mapped, np.float64).reshape(shape)
            else:
                self._array = self._kept[: self._rows]
        return self._array

    def column(self, number: int = 0) -> Array:
        """One of the columns of :meth:`array`."""
        return self.array()[:, number]


def _write(file: IO[bytes], rows: Array) -> None:
    left = np.ascontiguousarray(rows).data.cast("B") if len(rows) else b""
    try:
        while left:
            left = left[file.write(left) :]
    except OSError as error:
        raise _no_room(error) from error


def _no_room(error: OSError) -> BadInput:
    where = _folder.get() or tempfile.gettempdir()
    return BadInput(f"{where}: cannot hold the waveforms while the scene runs ({error.strerror}).")


def blocks(count: int) -> Iterator[slice]:
    """Slices of at most BLOCK of ``count`` rows; after each, tapes' pages leave the memory."""
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))
        release()


def release() -> None:
    """Drop the pages of tapes on disk from this process's memory; they can be read again."""
    if hasattr(mmap, "MADV_DONTNEED"):
        for each in list(_mapped.values()):
            if (mapped := each()) is not None:
                mapped.madvise(mmap.MADV_DONTNEED)
