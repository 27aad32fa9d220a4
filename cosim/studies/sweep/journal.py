"""The journal of a sweep: a line for each finished point, from which a killed sweep goes on.

The first line says which sweep it is. A line is written in one go and counts only with its end, so
a kill in the middle loses the one point at most. One process at a time may write to it.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from cosim.errors import BadInput
from cosim.studies.sweep.point import Outcome

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class Journal:
    """The journal at ``path`` of the sweep with this ``identity``; to be used in a ``with`` block.

    ``done`` are the numbers of the points that stand in it. Raises BadInput where the file belongs
    to another sweep, or another process writes to it.
    """

    def __init__(self, path: Path, identity: str) -> None:
        self.path = path
        self.done: set[int] = set()
        try:
            self._file: IO[bytes] = open(path, "a+b", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise BadInput(f"{path}: cannot be written ({error.strerror}).") from error
        try:
            self._lock()
            self._take_up(identity)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(self, number: int, outcome: Outcome) -> None:
        """Write down a finished point."""
        record = {"point": number, "numbers": outcome.numbers, "failure": outcome.failure}
        self._file.write(json.dumps(record).encode() + b"\n")
        self.done.add(number)

    def read(self) -> Iterator[tuple[int, Outcome]]:
        """The points that stand in it."""
        with open(self.path, "rb") as file:
            file.readline()
            for line in file:
                if line.endswith(b"\n"):
                    record = json.loads(line)
                    yield record["point"], Outcome(record["numbers"], record["failure"])

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise BadInput(f"{self.path}: another process is writing this sweep.") from error

    def _take_up(self, identity: str) -> None:
        header = json.dumps({"sweep": identity}).encode() + b"\n"
        self._file.seek(0)
        first = self._file.readline()
        if first != header:
            # What a kill has left of the first line is no journal yet.
            if first.endswith(b"\n") or not header.startswith(first):
                raise BadInput(
                    f"{self.path}: this is the journal of another sweep (its scene, keys, values "
                    "or version of cosim differ); remove it, or choose another --out."
                )
            self._file.truncate(0)
            self._file.write(header)
            return
        end = self._file.tell()
        for line in iter(self._file.readline, b""):
            if not line.endswith(b"\n"):
                break
            try:
                self.done.add(json.loads(line)["point"])
            except (ValueError, KeyError, TypeError) as error:
                raise BadInput(f"{self.path}: this journal is damaged; remove it.") from error
            end += len(line)
        self._file.truncate(end)
        os.fsync(self._file.fileno())
