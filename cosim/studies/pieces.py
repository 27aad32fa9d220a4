"""The pieces of a long study, each done once: a killed one goes on from its journal."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from cosim.files.journal import Journal

T = TypeVar("T")


class Pieces:
    """Called with a piece's name and what does it, gives what the journal has or that makes:
    numbers, texts, and lists and tables of these, which come back bit by bit."""

    def __init__(self, journal: "Journal[tuple[str, Any]] | None" = None) -> None:
        """Without a journal all is done anew."""
        self._journal = journal
        self._done = {name: found for _, (name, found) in journal.read()} if journal else {}

    def __call__(self, name: str, work: Callable[[], T]) -> T:
        if name not in self._done:
            self._done[name] = found = work()
            if self._journal:
                self._journal.add(len(self._done), (name, found))
        return self._done[name]


@contextmanager
def pieces(path: Path, *asked: Any) -> Iterator[Pieces]:
    """Those of the study that follows from ``asked`` (what JSON can hold) and this version of all
    programs, in a journal at ``path`` that is gone at the end.

    Raises BadInput where the journal is another study's, or another process writes it.
    """
    from cosim.mechanics import package
    from cosim.toolchain.versions import versions

    said = json.dumps([asked, versions(), package.token()], sort_keys=True).encode()
    with Journal(path, hashlib.sha256(said).hexdigest(), _encoded, _decoded) as journal:
        try:
            yield Pieces(journal)
        except BaseException:
            if not journal.done:
                journal.remove()
            raise
        journal.remove()


def _encoded(piece: tuple[str, Any]) -> dict[str, Any]:
    return {"name": piece[0], "found": piece[1]}


def _decoded(_: int, record: dict[str, Any]) -> tuple[str, Any]:
    if type(record["name"]) is not str:
        raise ValueError
    return record["name"], record["found"]
