"""What a format is, and what every format is made from: a run as its folder holds it."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import BadInput
from cosim.scene.messages import plain
from cosim.waveforms.storage import read_netcdf

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """A finished run: its columns (SI, of equal length) with their units, and what was run."""

    folder: Path
    waveforms: dict[str, Array]
    units: dict[str, str]
    title: str
    scene: str
    """The text of its scene.toml."""
    written: datetime

    @property
    def attributes(self) -> dict[str, str]:
        """What goes with the columns, as text."""
        return {"title": self.title, "scene": self.scene}

    @property
    def step(self) -> float:
        """Time between the rows, s."""
        time = self.waveforms["time"]
        return float(time[-1] - time[0]) / (len(time) - 1)


@dataclass(frozen=True)
class Exported:
    """The bytes of a file, and a line on what it holds."""

    content: bytes
    note: str


@dataclass(frozen=True)
class Format:
    """A format that a run can be exported in."""

    name: str
    """What ``--as`` takes."""
    file: str
    """Name of the file that it becomes."""
    help: str
    content: Callable[[Run], Exported]
    """Makes the file; raises BadInput for a run that lacks what the format needs."""


def read(folder: Path) -> Run:
    """The run that ``cosim run`` wrote into ``folder``; raises BadInput."""
    name = plain(str(folder))
    if not folder.is_dir():
        raise BadInput(f"{name}: there is no such folder; name one that cosim run wrote.")
    path = folder / "waveforms.nc"
    if not path.exists():
        raise BadInput(f"{name}: there is no run in this folder (waveforms.nc is missing).")
    waveforms, units, attributes = read_netcdf(path)
    return Run(
        folder,
        waveforms,
        units,
        attributes.get("title", ""),
        attributes.get("scene", ""),
        datetime.fromtimestamp(path.stat().st_mtime, UTC),
    )
