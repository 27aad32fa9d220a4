"""What the settings of a machine can achieve, and which limit of its circuit binds."""

from dataclasses import replace
from pathlib import Path

from cosim.studies.study import DASK, OVERRIDES, SCENE, SEED, WORKERS, Option, chart, quick

RIGS = (
    "other rigs that may be meant: a JSON or TOML file whose list ensemble has tables of keys and "
    "values, such as identify.json"
)
AT = "scenes at whose own settings each limit is lifted (default: trial-01 … trial-10)"

STUDIES = (
    chart(
        "limits.report.limits",
        "what is achievable, and which limit binds",
        replace(SCENE, help=f"the rig: {SCENE.help}", default="paper", many="optional"),
        OVERRIDES,
        Option("--rigs", RIGS, "FILE", Path),
        Option("--at", AT, "SCENE", many="some"),
        *(SEED, WORKERS, DASK),
        Option("--effort", "times the runs that each search may make", "X", float, 1.0),
        quick("a coarse search, in a fraction of the time"),
    ),
)
