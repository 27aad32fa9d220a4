"""The run's own netCDF (classic format), for another folder."""

from io import BytesIO

from cosim.waveforms.formats.source import Format, Run
from cosim.waveforms.storage import netcdf


def write(run: Run, file: BytesIO) -> str:
    """The same bytes as the run's ``waveforms.nc``."""
    netcdf(file, run.waveforms, run.units, run.attributes)
    return "netCDF 3, with the scene"


FORMAT = Format("nc", "waveforms.nc", "netCDF 3", write)
