"""What to measure next: which single measurement narrows the answer most."""

from pathlib import Path

from cosim.studies.limits import RIG, RIGS
from cosim.studies.study import OVERRIDES, SEED, WORKERS, Option, chart, quick

STUDIES = (
    chart(
        "measure.measure.measure",
        "which single measurement narrows most what the device is said to achieve",
        *(RIG, OVERRIDES),
        Option("--rigs", RIGS, "FILE", Path, needed=True),
        *(SEED, WORKERS),
        quick("fewer rigs, in a fraction of the time"),
    ),
)
