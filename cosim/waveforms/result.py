"""A finished run: its waveforms, its summary, its figure and its files."""

import os
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.arrays import Array
from cosim.files.atomic import as_json, together
from cosim.scene import Scene, to_toml
from cosim.typed import typed
from cosim.waveforms import identity
from cosim.waveforms.columns import UNITS, about
from cosim.waveforms.report import table
from cosim.waveforms.storage import csv, netcdf

if TYPE_CHECKING:
    import xarray as xr

    from cosim.files.picture import Picture


@dataclass(frozen=True, eq=False)
class Result:
    """A finished run.

    ``columns`` are the waveforms as arrays of equal length, SI, by the names of
    :data:`cosim.waveforms.columns.COLUMNS`; ``summary`` holds the numbers of the run, SI; ``scene``
    is what was run, with the choices of ``"auto"`` made.
    """

    scene: Scene
    columns: dict[str, Array]
    summary: dict[str, Any]
    units: Mapping[str, str] = field(default_factory=lambda: UNITS)
    """Units of the columns (and perhaps of others); a scene with its own FMUs has its own ones."""

    @cached_property
    def waveforms(self) -> "xr.Dataset":
        """The columns over the dimension ``time``, s; each with ``units`` and ``long_name``."""
        import xarray as xr

        variables = {
            name: ("time", values, about(name, self.units[name]))
            for name, values in self.columns.items()
        }
        return xr.Dataset(variables, attrs=self._attributes())

    def plot(self) -> "Picture":
        """The figure of the run, as ``figure.png`` shows it."""
        from cosim.waveforms import figure

        if self.scene.has_ports:
            return figure.draw_own(self.scene, self.columns, self.units)
        return figure.draw(self.scene, self.columns, self.summary)

    @typed
    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write what ``cosim run`` writes: ``waveforms.csv``, ``waveforms.nc``, ``scene.toml``,
        ``summary.json`` and ``figure.png``, each whole or not at all.

        Older files are replaced only when all but the figure are written. Each other file contains
        the hash of ``waveforms.csv``, by which :mod:`cosim.waveforms.identity` finds strangers.
        Raises BadInput where the folder cannot be written to.
        """
        *data, figure = (Path(folder) / name for name in identity.FILES)
        # A kill must not leave the figure of an older run beside the numbers of this one.
        with together(data, outdated=[figure]) as (table, waveforms, scene, summary):
            with open(table, "wb") as file:
                csv(file, self.columns, self.units)
            run = identity.of_table(table)
            about = self._attributes() | {"scene": to_toml(self.scene, folder=folder), "run": run}
            with open(waveforms, "wb") as file:
                netcdf(file, self.columns, self.units, about)
            scene.write_text(about["scene"], encoding="utf-8")
            summary.write_text(as_json({"run": run, **self.summary}), encoding="utf-8")
        self.plot().write(figure, identity.in_figure(run))

    def _attributes(self) -> dict[str, str]:
        return {"title": self.scene.description or self.scene.name, "scene": to_toml(self.scene)}

    def __repr__(self) -> str:
        return f"{self.scene.name}: {len(self.columns['time'])} rows of {', '.join(self.columns)}"

    def _repr_html_(self) -> str:
        """For notebooks: the figure, and the table that ``cosim run`` prints."""
        image = b64encode(self.plot().png()).decode()
        return (
            f'<img src="data:image/png;base64,{image}">'
            f"<pre>{escape(table(self.scene, self.summary, self.units))}</pre>"
        )
