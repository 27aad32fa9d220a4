"""What a search has heard so far, in a journal, so that a killed one goes on where it was."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosim.errors import BadInput
from cosim.files.journal import Journal
from cosim.scene import Scene
from cosim.studies.sweep.journal import outcome_of
from cosim.studies.sweep.point import Number, Outcome
from cosim.studies.sweep.pool import Pool

NAME = "tune.journal"


class _Heard(NamedTuple):
    """An outcome, the rung that it was found on, and the settings."""

    model: str
    values: dict[str, Number]
    outcome: Outcome

    @property
    def key(self) -> tuple[str, tuple[tuple[str, Number], ...]]:
        return self.model, tuple(sorted(self.values.items()))


class Memory:
    """Runs points as a pool does, but for those that ``path`` has; without one all of them.

    A search that begins again asks for the same settings. To be used in a ``with`` block. Raises
    BadInput where the file belongs to another scene.
    """

    def __init__(self, path: Path | None, identity: str) -> None:
        self._journal = None if path is None else Journal(path, identity, _encode, _decode)
        heard = [] if self._journal is None else [one for _, one in self._journal.read()]
        self._known = {one.key: one.outcome for one in heard if not one.outcome.machine}
        self._new, self._count = not heard, len(heard)

    def __enter__(self) -> "Memory":
        return self

    def __exit__(self, kind: type[BaseException] | None, *more: object) -> None:
        if self._journal is not None:
            self._journal.__exit__(kind, *more)
            if self._new and kind is not None and issubclass(kind, BadInput):
                self._journal.remove()  # there is nothing to go on with

    def run(
        self, pool: Pool, scene: Scene, points: Sequence[Mapping[str, Number]]
    ) -> Iterator[tuple[int, Outcome]]:
        """The outcome of each point of ``scene``, with its place, in the order in which they are
        known."""
        asked = [_Heard(scene.circuit.model, dict(values), Outcome({})) for values in points]
        new = [k for k, one in enumerate(asked) if one.key not in self._known]
        for k, one in enumerate(asked):
            if one.key in self._known:
                yield k, self._known[one.key]
        for place, outcome in pool.run(enumerate(points[k] for k in new)):
            one = asked[new[place]]._replace(outcome=outcome)
            if self._journal is not None:
                self._journal.add(self._count, one)
                self._count += 1
            yield new[place], outcome

    def forget(self) -> None:
        """The search is at its end and saved."""
        if self._journal is not None:
            self._journal.remove()


def _encode(heard: _Heard) -> dict[str, Any]:
    return {"model": heard.model, "values": heard.values, **vars(heard.outcome)}


def _decode(number: int, record: dict[str, Any]) -> _Heard:
    values = {str(key): value for key, value in record["values"].items()}
    if number < 0 or not all(type(value) in (int, float) for value in values.values()):
        raise ValueError
    return _Heard(str(record["model"]), values, outcome_of(record))
