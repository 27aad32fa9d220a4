"""The declaration of a format, and the finished run in a folder from which files are made."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.scene import Scene, load
from cosim.waveforms.identity import tell_strangers
from cosim.waveforms.storage import read_netcdf


@dataclass(frozen=True)
class Run:
    """A finished run: its columns (SI, of equal length), their units, and its scene."""

    folder: Path
    waveforms: dict[str, Array]
    units: dict[str, str]
    attributes: dict[str, str]
    """``title``, ``scene`` (text of scene.toml), and ``run`` (the run's name, if known)."""
    written: datetime

    @property
    def step(self) -> float:
        """Mean time between the rows, s."""
        time = self.waveforms["time"]
        return float(time[-1] - time[0]) / (len(time) - 1)


@dataclass(frozen=True)
class Format:
    """A format that a run can be exported in."""

    name: str
    """Its name for ``--as``."""
    file: str
    """Name of the file that is written."""
    help: str
    write: Callable[[Run, BytesIO], str]
    """Writes the file and returns a line on its content; raises BadInput for a run that lacks
    columns or a drive that the format needs."""


def read(folder: Path) -> Run:
    """The run that ``cosim run`` wrote into ``folder``; raises BadInput."""
    name = plain(folder)
    if not folder.is_dir():
        raise BadInput(f"{name}: there is no such folder; name one that cosim run wrote.")
    path = folder / "waveforms.nc"
    if not path.exists():
        raise BadInput(f"{name}: there is no run in this folder (waveforms.nc is missing).")
    waveforms, units, attributes = read_netcdf(path)
    tell_strangers(folder, attributes)
    about = {"title": "", "scene": ""} | {
        name: text for name, text in attributes.items() if name in ("title", "scene", "run")
    }
    written = datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return Run(folder, waveforms, units, about, written)


def machine(run: Run, form: str, *columns: str) -> Scene:
    """The scene of a run of the built-in machine; raises BadInput for a scene with ports, and for a
    run that lacks one of the ``columns``."""
    scene = load(run.folder / "scene.toml")
    if scene.has_ports:
        raise BadInput(
            f"{plain(run.folder)}: {form} needs a run of the built-in machine, not one of a "
            "scene with its own [[port]]."
        )
    if missing := [name for name in columns if name not in run.waveforms]:
        path = plain(run.folder / "waveforms.nc")
        raise BadInput(f"{path}: {form} needs the column {missing[0]}, which is not in it.")
    return scene


def driven(run: Run, form: str) -> Scene:
    """The scene of a run whose coil follows a command; raises BadInput without a coil."""
    scene = machine(run, form)
    if not scene.rung.driven:
        raise BadInput(
            f"{plain(run.folder)}: {form} needs a run with a coil, not one with circuit.model "
            f'= "{scene.circuit.model}".'
        )
    return scene


def lagging(scene: Scene) -> str:
    """Words that end a line on the first surface's drive where a second one has its own."""
    lag = scene.drive.phase_deg
    return "" if lag is None else f", of the first surface; the second lags by {lag:g}°"
