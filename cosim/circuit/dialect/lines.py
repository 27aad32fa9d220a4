"""A netlist's logical line, and how one is refused."""

from dataclasses import dataclass, replace
from typing import NoReturn

from cosim.errors import BadInput, printable

MAX_LINE = 200_000
MOST = 50
"""At most so many coefficients of a polynomial, and so many tables or integrals in a line."""
DEEPEST = 100
"""Brackets, and calls of the netlist's own functions, within each other."""
COPY = "; copy its .model line into the netlist"


@dataclass(frozen=True)
class Line:
    """A logical line: comments stripped, continuations joined, where it began."""

    text: str
    file: str
    number: int
    """The first of its lines in the file; 0 for text from elsewhere."""
    bad: str = ""
    """The reason not to use it, or the model of which ``text`` then has the name alone."""
    scope: tuple[int, ...] = ()
    """Places in the netlist of the .subckt lines that enclose it, the outermost first; a .subckt
    line lies in its own scope."""

    @property
    def place(self) -> str:
        return f"{self.file}:{self.number}" if self.number else self.file


def refuse(line: Line, reason: str) -> NoReturn:
    """Raise the one sentence that tells what is wrong with ``line``."""
    raise BadInput(f"{line.place}: {reason}.")


def unusable(line: Line, error: BadInput, text: str) -> Line:
    """In place of a line for which ``refuse`` raised an error, what is to be said if it is used."""
    reason = str(error).removeprefix(f"{line.place}: ").removesuffix(".")
    return replace(line, text=text, bad=reason)


def shown(text: str) -> str:
    """A piece of a netlist as it may stand in a message: short and printable."""
    return printable(text if len(text) <= 40 else f"{text[:37]}...").replace("\n", "\\n")
