"""The run's own CSV, for another folder: a header ``name [unit]``, ten digits a number."""

from cosim.waveforms.formats.source import Exported, Format, Run
from cosim.waveforms.storage import csv_content


def content(run: Run) -> Exported:
    """The same bytes as the run's ``waveforms.csv``."""
    return Exported(csv_content(run.waveforms, run.units), "comma-separated, ten digits")


FORMAT = Format("csv", "waveforms.csv", "comma-separated", content)
