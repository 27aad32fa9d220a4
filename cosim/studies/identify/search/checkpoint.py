"""What of an identification is done, in a file: an interrupted one goes on there.

A stage draws random numbers of its own, made of the seed and its name, so that it comes out the
same whether or not those before it were read from the file.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cosim.errors import BadInput
from cosim.files.atomic import write_json
from cosim.files.door import Refused, contents
from cosim.studies.identify.search.search import Found

LARGEST = 1 << 28
"""Bytes; far above what all stages take."""


class Journal:
    """The stages that are done, by name; ``path`` None keeps them in memory only."""

    def __init__(self, path: Path | None, seed: int, asked: Any) -> None:
        self._path, self._seed = path, seed
        told = json.dumps([seed, asked], sort_keys=True, default=str)
        self._key = hashlib.sha256(told.encode()).hexdigest()
        self._done: dict[str, Any] = {}
        if path is not None and path.exists():
            self._done = self._read(path)
        self.resumed = len(self._done)

    def _read(self, path: Path) -> dict[str, Any]:
        try:
            content = json.loads(contents(path, LARGEST))
            same, done = content["asked"] == self._key, content["done"]
        except (Refused, ValueError, KeyError, TypeError, RecursionError) as error:
            raise BadInput(f"{path}: is no journal of an identification; delete it.") from error
        return done if same and isinstance(done, dict) else {}

    def stage(
        self, name: str, work: Callable[[np.random.Generator], Sequence[Found]]
    ) -> list[Found]:
        """The solutions of a stage: those of the file, or of ``work``, which are added to it."""
        if name not in self._done:
            found = work(np.random.default_rng([self._seed, crc32(name.encode())]))
            self._done[name] = [_plain(one) for one in found]
            if self._path is not None:
                write_json(self._path, {"asked": self._key, "done": self._done})
        return [_found(one) for one in self._done[name]]


def _plain(found: Found) -> dict[str, Any]:
    arrays = {name: getattr(found, name).tolist() for name in ("place", "own", "costs")}
    return arrays | {"total": found.total}


def _found(plain: Mapping[str, Any]) -> Found:
    place, own, costs = (np.array(plain[name], np.float64) for name in ("place", "own", "costs"))
    return Found(place, own, costs, plain["total"])
