"""Simulated against measured: one trial, or all published ones."""

from pathlib import Path

from cosim.studies.study import COLUMNS, OVERRIDES, Option, Study, chart, folder_of_trials

STUDIES = (
    Study(
        "compare.run.compare",
        "simulated against measured: a run's folder or a scene, and a trial",
        (
            Option("run", "a folder that cosim run wrote or a scene", "RUN|SCENE"),
            Option("trial", "a tracked trial, or other measurements", "TRIAL.csv", Path),
            COLUMNS,
            OVERRIDES,
        ),
        command="compare",
        out="results/compare",
        saves=False,
        writes="compare.json, compare.csv, frames.csv",
        figures=("compare.png",),
    ),
    chart(
        "compare.each.trials",
        "the whole chain against every published trial",
        folder_of_trials("folder of the published trials' CSVs"),
        OVERRIDES,
        library=False,
        saves=False,
    ),
)
