"""A netlist's logical line, and how one is refused."""

from dataclasses import dataclass
from typing import NoReturn

from cosim.errors import BadInput, printable

MAX_LINE = 200_000
UNKNOWN = ".unknown "
"""Begins the replacement of a line that ngspice must not see; the reason follows."""
NO_MODEL = ".nomodel "
"""Begins that of a model; its name and the reason follow."""
COPY = "; copy its .model line into the netlist"


@dataclass(frozen=True)
class Line:
    """A logical line: comments stripped, continuations joined, where it began."""

    text: str
    file: str
    number: int
    """The first of its lines in the file; 0 for text from elsewhere."""

    @property
    def place(self) -> str:
        return f"{self.file}:{self.number}" if self.number else self.file


def refuse(line: Line, reason: str) -> NoReturn:
    """Raise the one sentence that tells what is wrong with ``line``."""
    raise BadInput(f"{line.place}: {reason}.")


def reason_of(error: BadInput, line: Line) -> str:
    """The reason with which ``refuse`` raised an error for the line."""
    return str(error).removeprefix(f"{line.place}: ").removesuffix(".")


def shown(text: str) -> str:
    """A piece of a netlist as it may stand in a message: short and printable."""
    return printable(text if len(text) <= 40 else f"{text[:37]}...").replace("\n", "\\n")
