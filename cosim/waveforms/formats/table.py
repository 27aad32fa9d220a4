"""The run's own CSV, for another folder: a header ``name [unit]``, numbers with ten digits."""

from io import BytesIO

from cosim.waveforms.formats.source import Format, Run
from cosim.waveforms.storage import csv


def write(run: Run, file: BytesIO) -> str:
    """The same bytes as the run's ``waveforms.csv``."""
    csv(file, run.waveforms, run.units)
    return "comma-separated, ten digits"


FORMAT = Format("csv", "waveforms.csv", "comma-separated", write)
