"""Netlists as the package reads them."""

from pathlib import Path

from cosim.circuit.lint import deck


def read(path: Path) -> list[deck.Line]:
    """The lines that ngspice needs, the title first."""
    return deck.read(path)[0]
