"""A file with the results of long work, from which a killed study resumes.

It is an SQLite file in write-ahead mode: a kill at any moment loses nothing that was written, and
others may read the file while it grows. Results are written every PAUSE, since a transaction costs
as much as a short run: a kill loses at most those of the last PAUSE. One process may write.
"""

import hashlib
import json
import os
import sqlite3
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import islice
from math import inf
from operator import methodcaller
from pathlib import Path
from time import monotonic
from typing import Any, Protocol, TypeVar

from cosim.errors import BadInput, Note, plain
from cosim.files.atomic import locked
from cosim.mechanics import package
from cosim.toolchain.libraries import digest
from cosim.toolchain.versions import versions

T = TypeVar("T")

PAUSE = 0.1
"""s between two transactions, at least."""

MOST_OWED = 64 << 20
"""Bytes of results that wait in memory, at most, while the disk refuses them."""

_TABLE = "CREATE TABLE found (key TEXT PRIMARY KEY, value TEXT NOT NULL)"
_WORK = ""
"""The key under which the hash of the inputs of all results stands."""


class Store:
    """Results (all that JSON can hold) by key, in the file ``path``, or in memory alone.

    They follow from the inputs ``asked`` (what JSON can hold) and this version of all programs. To
    be used in a ``with`` block, by one thread; a file that is still empty at its end is removed.

    Raises BadInput where the file belongs to other work, is damaged, a link or no regular file, or
    another process writes it.
    """

    def __init__(self, path: Path | None, *asked: Any) -> None:
        self._path, self._file = path, None if path is None else _locked(path)
        self._owed: dict[str, str] = {}
        """Results that are not written yet, as JSON by key."""
        self._refused = False
        """Whether the disk refused the last write."""
        self._written = -inf
        """Time of the last write by the monotonic clock, s."""
        try:
            where = ":memory:" if path is None else str(path)
            self._base = sqlite3.connect(where, isolation_level=None)
            self._told(self._take_up, hashed(asked, versions(), package.token(), digest("stepper")))
            self.resumed = len(self)
            """Number of results that the file held at first."""
        except BaseException:
            self._close()
            raise

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(sqlite3.Error, BadInput):
            self._write()
            if not len(self):
                self.remove()
        self._close()

    def __len__(self) -> int:
        """Number of results that were written."""
        return self._told(self._base.execute, "SELECT count(*) - 1 FROM found").fetchone()[0]

    def get(self, key: str) -> Any:
        """The result under a key; None without one."""
        return self.some([key]).get(key)

    def some(self, keys: Sequence[str]) -> dict[str, Any]:
        """The results under these keys, at most 32,766 (SQLite's limit), by key."""
        places = ", ".join("?" * len(keys))
        rows = self._told(
            self._base.execute, f"SELECT key, value FROM found WHERE key IN ({places})", keys
        ).fetchall()
        owed = ((key, self._owed[key]) for key in keys if key in self._owed)
        found = {}
        for key, text in (*rows, *owed):
            with suppress(ValueError, TypeError, RecursionError):  # changed from outside
                found[key] = json.loads(text)
        return found

    def add(self, key: str, found: Any) -> None:
        """Add a result; it is written at once, or with later ones if PAUSE has not passed.

        If the disk refuses, a note says so and it is tried again; BadInput beyond MOST_OWED.
        """
        self._owed[key] = json.dumps(found)
        if monotonic() - self._written >= PAUSE:
            self._write()

    def _write(self) -> None:
        size = len(self._owed)
        while self._owed:
            batch = dict(islice(self._owed.items(), size))
            try:
                with self._base:  # all of them or none
                    self._base.execute("BEGIN")
                    self._base.executemany(
                        "INSERT OR REPLACE INTO found VALUES (?, ?)", batch.items()
                    )
            except sqlite3.OperationalError as error:
                if size > 1:
                    size //= 2  # the disk may have room for a smaller transaction
                    continue
                self._tell(f"{plain(self._path)}: cannot be written ({error})", error)
                break
            for key in batch:
                del self._owed[key]
            self._refused = False
        self._written = monotonic()

    def _tell(self, words: str, error: sqlite3.OperationalError) -> None:
        if sum(map(len, self._owed.values())) > MOST_OWED:
            raise BadInput(f"{words}.") from error
        if not self._refused:
            warnings.warn(
                f"{words}; the work goes on, and a kill now would lose what is not written.",
                Note,
                stacklevel=4,
            )
        self._refused = True

    def once(self, key: str, work: Callable[[], T]) -> T:
        """The result under ``key``; without one that of ``work``, which is added."""
        found = self.get(key)
        if found is None:
            found = work()
            self.add(key, found)
        return found

    def remove(self) -> None:
        """Remove the file: the work is done."""
        self._close()
        if self._path is not None:
            for path in _files(self._path):
                path.unlink(missing_ok=True)

    def _take_up(self, work: str) -> None:
        """Create the table, or check that its results follow from inputs with the hash ``work``."""
        for pragma in ("trusted_schema = OFF", "journal_mode = WAL", "synchronous = NORMAL"):
            self._base.execute(f"PRAGMA {pragma}")
        tables = self._base.execute(
            "SELECT type, name, sql FROM sqlite_master WHERE sql NOT NULL"  # as the index's is
        ).fetchall()
        if not tables:  # a new file, or one that a kill left empty
            with self._base:
                self._base.execute("BEGIN")
                self._base.execute(_TABLE)
                self._base.execute("INSERT INTO found VALUES (?, ?)", (_WORK, work))
        elif tables != [("table", "found", _TABLE)]:
            raise sqlite3.DatabaseError("its tables are others")
        elif self._base.execute("SELECT value FROM found WHERE key = ''").fetchone() != (work,):
            raise BadInput(
                f"{plain(self._path)}: this belongs to other work (its scene, keys, values or "
                "version of cosim differ); remove it, or choose another --out."
            )

    def _told(self, act: Callable[..., T], *given: Any) -> T:
        """The result of ``act``. Raises BadInput where SQLite cannot read or write the file."""
        name = plain(self._path)
        try:
            return act(*given)
        except sqlite3.OperationalError as error:
            raise BadInput(f"{name}: cannot be written ({error}).") from error
        except sqlite3.DatabaseError as error:
            raise BadInput(
                f"{name}: this is no store of this version of cosim, or it is damaged ({error}); "
                "remove it, or choose another --out."
            ) from error

    def _close(self) -> None:
        """Close SQLite's file first: closing the other descriptor would release SQLite's locks."""
        if hasattr(self, "_base"):
            self._base.close()
        if self._file is not None:
            os.close(self._file)
            self._file = None


def hashed(*said: Any) -> str:
    """A hash of what JSON can hold, and of NumPy's numbers."""
    words = json.dumps(said, sort_keys=True, default=methodcaller("item"))
    return hashlib.sha256(words.encode()).hexdigest()


def _files(path: Path) -> list[Path]:
    """All files that SQLite writes."""
    return [path, *(path.with_name(f"{path.name}-{more}") for more in ("wal", "shm", "journal"))]


def _locked(path: Path) -> int:
    """Open and lock the file for this process. Links are refused: SQLite would follow them."""
    flags = os.O_RDWR | os.O_CREAT
    for more in ("O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK", "O_BINARY"):
        flags |= getattr(os, more, 0)
    name = plain(path)
    for each in _files(path):
        if each.is_symlink() or (each.exists() and not each.is_file()):
            what = "it is a link" if each.is_symlink() else "this is not a regular file"
            raise BadInput(f"{plain(each)}: cannot be written ({what}).")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, flags, 0o666)
    except OSError as error:
        raise BadInput(f"{name}: cannot be written ({error.strerror}).") from error
    if not locked(file):
        os.close(file)
        raise BadInput(f"{name}: another process is writing it.")
    return file


class _Saves(Protocol):
    def save(self, folder: str | os.PathLike[str]) -> object: ...


Made = TypeVar("Made", bound=_Saves)


def reported(
    make: Callable[[Store], Made], out: str | os.PathLike[str] | None, store: str, *asked: Any
) -> Made:
    """The report of ``make``, which follows from the inputs ``asked``, saved in the folder ``out``
    if one is given. Until then the file ``store`` there keeps results, from which an interrupted
    study resumes. Raises BadInput."""
    with Store(None if out is None else Path(out) / store, *asked) as kept:
        made = make(kept)
        if out is not None:
            made.save(out)
        kept.remove()
    return made
