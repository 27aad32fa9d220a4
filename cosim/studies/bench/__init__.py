"""Speed as ratios, each taken side by side in one run."""

from pathlib import Path

from cosim.studies.study import Option, Study, quick

STUDIES = (
    Study(
        "bench.run.bench",
        "speed ratios, taken side by side in one run",
        (
            Option("--trials", "folder of tracked trials", "DIR", Path),
            quick("fewer rounds: under a minute"),
        ),
        command="bench",
        out="results/bench",
        saves=False,
        writes="bench.json",
    ),
)
