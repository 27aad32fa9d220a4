"""The journal of a sweep, and outcomes as any journal holds them."""

import hashlib
import json
from pathlib import Path
from typing import Any

from cosim.files.journal import Journal
from cosim.studies.sweep.point import Outcome


def journal(path: Path, identity: str, count: int) -> Journal[Outcome]:
    """The journal at ``path`` of ``count`` points that follow from what ``identity`` is a hash of.

    A point whose failure may have been the machine's is not settled. Raises BadInput.
    """

    def decode(number: int, record: dict[str, Any]) -> Outcome:
        if not 0 <= number < count:
            raise ValueError
        return outcome_of(record)

    return Journal(path, identity, vars, decode, lambda outcome: not outcome.machine)


def outcome_of(record: dict[str, Any]) -> Outcome:
    """The outcome of which ``record`` has the fields. Raises what a journal's ``decode`` may."""
    numbers, failure, machine = record["numbers"], record["failure"], record["machine"]
    named = all(name.isidentifier() and len(name) < 100 for name in numbers)
    values = [value for value in numbers.values() if type(value) in (int, float)]
    told = type(failure) is str and type(machine) is bool
    if not (named and told and len(values) == len(numbers)):
        raise ValueError
    return Outcome({name: float(value) for name, value in numbers.items()}, failure, machine)


def hashed(*said: Any) -> str:
    """A hash of what JSON can hold."""
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
