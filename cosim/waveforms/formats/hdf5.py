"""HDF5 in the layout of netCDF-4, so that netCDF4 and xarray find the dimension ``time``."""

from io import BytesIO

from cosim.errors import BadInput
from cosim.waveforms.formats.source import Format, Run


def write(run: Run, file: BytesIO) -> str:
    """A dataset for each column with its ``units``, over the dimension scale ``time``; the root has
    ``title`` and ``scene``."""
    try:
        import h5py
    except ImportError:
        raise BadInput(
            "--as hdf5 needs the package h5py, which the extra hdf5 of this project installs."
        ) from None
    # netCDF-4 needs the order in which its variables were created.
    with h5py.File(file, "w", track_order=True) as root:
        root.attrs.update(run.attributes)
        time = root.create_dataset("time", data=run.waveforms["time"])
        time.make_scale("time")
        for name, values in run.waveforms.items():
            dataset = time if name == "time" else root.create_dataset(name, data=values)
            dataset.attrs["units"] = run.units[name]
            if dataset is not time:
                dataset.dims[0].attach_scale(time)
    return "HDF5 that netCDF4 and xarray open too"


FORMAT = Format("hdf5", "waveforms.h5", "as netCDF-4 lays it out", write)
