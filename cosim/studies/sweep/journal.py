"""The journal of a sweep, or of anything else that runs points: their outcomes by their number."""

from pathlib import Path
from typing import Any

from cosim.files.journal import Journal
from cosim.studies.sweep.point import Outcome


def journal(path: Path, identity: str, count: int) -> Journal[Outcome]:
    """The journal at ``path`` of ``count`` points that follow from what ``identity`` is a hash of.

    A point whose failure may have been the machine's is not settled. Raises BadInput.
    """

    def decode(number: int, record: dict[str, Any]) -> Outcome:
        numbers, failure, machine = record["numbers"], record["failure"], record["machine"]
        known = 0 <= number < count and type(failure) is str and type(machine) is bool
        named = all(name.isidentifier() and len(name) < 100 for name in numbers)
        values = [value for value in numbers.values() if type(value) in (int, float)]
        if not (known and named and len(values) == len(numbers)):
            raise ValueError
        return Outcome({name: float(value) for name, value in numbers.items()}, failure, machine)

    return Journal(path, identity, vars, decode, lambda outcome: not outcome.machine)
