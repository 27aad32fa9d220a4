"""Netlists as the package reads them."""

from pathlib import Path

from cosim.circuit.dialect.lines import Line
from cosim.circuit.lint import deck


def read(path: Path) -> list[Line]:
    """The lines that ngspice needs, the title first."""
    return deck.read(path)[0]
