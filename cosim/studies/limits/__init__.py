"""What a machine can achieve, and what would change that: waveform, heat, grip, circuit."""

from dataclasses import replace
from pathlib import Path

from cosim.studies.study import DASK, OVERRIDES, SCENE, SEED, WORKERS, Option, chart, quick

RIGS = (
    "other rigs that fit the trials: a JSON or TOML file whose list ensemble has tables of keys "
    "and values, such as identify.json"
)

RIG = replace(SCENE, help=f"the rig: {SCENE.help}", default="paper", many="optional")

STUDIES = (
    chart(
        "limits.report.limits",
        "what is achievable, and what would change it",
        *(RIG, OVERRIDES),
        Option("--rigs", RIGS, "FILE", Path),
        *(SEED, WORKERS, DASK),
        Option("--effort", "factor on the number of runs of each search", "X", float, 1.0),
        quick("a first look: a coarse search with a fraction of the runs, which may miss much"),
    ),
)
