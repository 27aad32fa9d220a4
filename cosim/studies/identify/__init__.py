"""One rig, and each trial's drive, identified from tracked trials."""

from pathlib import Path

from cosim.studies.study import SEED, Option, Study, folder_of_trials, quick

APART = "a trial that is reported, not fitted; repeatable (always: those that do not repeat)"

STUDIES = (
    Study(
        "identify.run.identify",
        "identify one rig, and each trial's drive, from tracked trials; write report and scenes",
        (
            folder_of_trials("folder of the trials' CSVs"),
            Option("--bounds", "TOML with bounds and priors of one's own", "FILE", Path),
            Option("--apart", APART, "TRIAL", many="repeat"),
            SEED,
            Option("--workers", "threads (default: one for each processor)", "N", int),
            quick("a short search, to see whether the trials are understood"),
        ),
        command="identify",
        out="results/identify",
        writes="identify.json, .csv, .md, figures and scenes",
        unit="look",
        tells={"progress": lambda what, best: (None, None, f"{what}: cost {best:.4f}")},
    ),
)
