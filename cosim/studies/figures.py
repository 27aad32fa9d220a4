"""What the figures of all studies share."""

from pathlib import Path

from cosim.files.picture import Picture


def blank(width: float, height: float) -> Picture:
    """An empty figure, sizes in inches."""
    return Picture(width, height, "constrained")


def save(figure: Picture, path: Path) -> None:
    """Write a figure as a PNG."""
    figure.write(path)
