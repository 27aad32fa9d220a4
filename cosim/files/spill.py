"""Rows that come one after the other and may become many: in memory while few, then on disk.

What is on disk lies in a file that has no name, so nothing is left of it however the process ends.
"""

import mmap
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO
from weakref import WeakSet

import numpy as np
import numpy.typing as npt

from cosim.errors import BadInput

Array = npt.NDArray[np.float64]

IN_MEMORY = 8 << 20
"""Bytes of a tape that stay in memory; those of a run of some seconds do."""

BLOCK = 1 << 16
"""Rows that are looked at at a time where all of them need not be in memory at once."""

_mapped: "WeakSet[mmap.mmap]" = WeakSet()

_folder: ContextVar[Path | None] = ContextVar("folder", default=None)


@contextmanager
def on_disk_in(folder: Path) -> Iterator[None]:
    """Tapes that outgrow memory within this context lie in ``folder``, not in the system's own."""
    token = _folder.set(folder)
    try:
        yield
    finally:
        _folder.reset(token)


class Tape:
    """Rows of ``columns`` numbers, written once and then read as an array.

    Raises BadInput where the disk takes no more of them.
    """

    def __init__(self, columns: int) -> None:
        self._columns = columns
        self._rows = 0
        self._blocks: list[Array] = []
        self._file: IO[bytes] | None = None
        self._array: Array | None = None

    def __len__(self) -> int:
        return self._rows

    def append(self, rows: npt.ArrayLike) -> None:
        """Add rows, of which a copy is kept."""
        block = np.array(rows, np.float64).reshape(-1, self._columns)
        if not len(block):
            return
        self._rows += len(block)
        self._array = None
        self._blocks.append(block)
        if self._file is not None or self._rows * self._columns * 8 > IN_MEMORY:
            self._spill()

    def _spill(self) -> None:
        folder = _folder.get()
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
            for block in self._blocks:
                left = block.data.cast("B")
                while left:
                    left = left[self._file.write(left) :]
        except OSError as error:
            where = folder or tempfile.gettempdir()
            raise BadInput(
                f"{where}: cannot hold the waveforms while the scene runs ({error.strerror})."
            ) from error
        self._blocks = []

    def array(self) -> Array:
        """All rows so far; the file itself, mapped, where they are on disk."""
        if self._array is None:
            shape = (self._rows, self._columns)
            if self._file is not None:
                mapped = mmap.mmap(self._file.fileno(), self._rows * self._columns * 8)
                _mapped.add(mapped)
                self._array = np.frombuffer(mapped, np.float64).reshape(shape)
            else:
                self._array = np.concatenate([np.empty((0, self._columns)), *self._blocks])
                self._blocks = [self._array]
        return self._array

    def column(self, number: int = 0) -> Array:
        """One of the columns of :meth:`array`."""
        return self.array()[:, number]


def blocks(count: int) -> Iterator[slice]:
    """Slices of BLOCK rows that together are ``count`` rows; what was read of tapes for one does
    not stay in memory for the next.
    """
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))
        release()


def release() -> None:
    """Take what was read of tapes on disk out of this process's memory; it can be read again."""
    if hasattr(mmap, "MADV_DONTNEED"):
        for mapped in list(_mapped):
            mapped.madvise(mmap.MADV_DONTNEED)
