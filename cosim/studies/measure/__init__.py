"""What to measure next: which single measurement narrows the answer most."""

from dataclasses import replace
from pathlib import Path

from cosim.studies.limits import RIGS
from cosim.studies.study import OVERRIDES, SCENE, SEED, WORKERS, Option, chart, quick

STUDIES = (
    chart(
        "measure.measure.measure",
        "which single measurement narrows most what the device is said to achieve",
        replace(SCENE, help=f"the rig: {SCENE.help}", default="paper", many="optional"),
        OVERRIDES,
        Option("--rigs", RIGS, "FILE", Path, needed=True),
        *(SEED, WORKERS),
        quick("fewer rigs, in a fraction of the time"),
    ),
)
