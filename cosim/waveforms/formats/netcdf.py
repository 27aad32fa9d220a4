"""The run's own netCDF (classic format), for another folder."""

from cosim.waveforms.formats.source import Exported, Format, Run
from cosim.waveforms.storage import netcdf_content


def content(run: Run) -> Exported:
    """The same bytes as the run's ``waveforms.nc``."""
    made = netcdf_content(run.waveforms, run.units, run.attributes)
    return Exported(made, "netCDF 3, with the scene")


FORMAT = Format("nc", "waveforms.nc", "netCDF 3", content)
